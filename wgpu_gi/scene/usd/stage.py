"""Opens an OpenUSD stage at one time, and reads its values as checked numpy arrays.

`usd-core` (the extra `usd`) parses files and composes layers, so that references, payloads, variants, inherits and
instances mean what they mean elsewhere. What it would print becomes notes.
"""

from __future__ import annotations

import io
import math
import os
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import GiError
from ..files.memory import MemoryBudget
from ..files.notes import Notes
from ..files.polygons import Floats
from ..files.read import read_file
from ..transforms import Matrix

_MOST_WARNINGS = 3
_HARMLESS = ("deprecated version", "MaterialBindingAPI is not applied")
_LONGEST_WARNING = 160


@dataclass
class Stage:
    """An open stage: messages begin with `source`, values are those at `time`, `usd` is the Usd.Stage."""

    usd: Any
    time: Any
    source: str
    transforms: Any  # UsdGeom.XformCache
    world_from_stage: Matrix
    notes: Notes
    budget: MemoryBudget

    def placed(self, prim: Any) -> Matrix:
        """Return the stage_from_prim matrix (4, 4) of a prim; see `matrix_of`."""
        return matrix_of(self.transforms.GetLocalToWorldTransform(prim))

    def note(self, sentence: str) -> None:
        """Note what was approximated or left out."""
        self.notes.add(f"{self.source}: {sentence}")

    def damage(self, sentence: str) -> None:
        """Note a damaged part."""
        self.notes.damage(f"{self.source}: {sentence}")


def open_stage(path: Path, time: float | None, notes: Notes, budget: MemoryBudget) -> Stage:
    """Open a stage at a time code, by default at the start of its range, or else at the earliest sample of each value.

    Raises GiError for missing and empty files, and USD's exception for unreadable ones; see `diagnostics`.
    """
    from pxr import Tf, Usd, UsdGeom

    read_file(path, "USD file")
    stage = Usd.Stage.Open(str(path))
    # Choose the time.
    first, last = stage.GetStartTimeCode(), stage.GetEndTimeCode()
    ranged = stage.HasAuthoredTimeCodeRange() and math.isfinite(first) and math.isfinite(last)
    if time is not None:
        code = Usd.TimeCode(time)
    else:
        code = Usd.TimeCode(first) if ranged else Usd.TimeCode.EarliestTime()
        if ranged and last > first:
            notes.add(f"{path} is shown at time {first:g} of {first:g} to {last:g} (--at, gi.load(time=) set another)")
    # Find the axes and the unit of length.
    try:
        unit = float(UsdGeom.GetStageMetersPerUnit(stage))
    except Tf.ErrorException:  # a float where the schema has a double
        unit = stage.GetRootLayer().pseudoRoot.GetInfo("metersPerUnit")
    if not isinstance(unit, (int, float)) or not 0 < unit < math.inf:
        notes.damage(f"{path}: metersPerUnit is not a number above 0; 0.01 is used")
        unit = 0.01
    world_from_stage = np.diag([unit, unit, unit, 1.0])
    if UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z:
        world_from_stage[:3, :3] = unit * np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
    return Stage(stage, code, str(path), UsdGeom.XformCache(code), world_from_stage, notes, budget)


def prepare_usd() -> None:
    """Let USD read binary files instead of mapping them, if it is not imported yet.

    It complains on the terminal where it cannot map a damaged file, and a mapped file that shrinks ends the process.
    """
    os.environ.setdefault("USDC_USE_ASSET", "1")
    os.environ.setdefault("TF_ENV_SETTING_ALERTS_ENABLED", "0")


@contextmanager
def diagnostics(path: Path, notes: Notes) -> Iterator[None]:
    """Collect what USD would print to the terminal; the first messages become notes of damage.

    Raises GiError without usd-core, and for errors of USD.
    """
    prepare_usd()
    try:
        from pxr import Tf, UsdUtils
    except ImportError:
        raise GiError(f"{path} needs the package usd-core: pip install usd-core") from None
    delegate = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        # Values that cannot be converted to Python are None, with a line on sys.stderr.
        with redirect_stderr(io.StringIO()):
            yield
    except Tf.ErrorException as error:
        raise GiError(f"{path} is not a readable USD file: {_one_line(error)}") from None
    except UnicodeDecodeError:
        raise GiError(f"{path} is damaged: a name in it is not text in UTF-8") from None
    finally:
        messages = [_one_line(each) for each in delegate.TakeUncoalescedDiagnostics()]
        del delegate
    messages = [message for message in dict.fromkeys(messages) if not any(each in message for each in _HARMLESS)]
    for message in messages[:_MOST_WARNINGS]:
        notes.damage(f"{path}: {message}")


def _one_line(message: Any) -> str:
    """Return the first sentence of a message of USD, short and on one line."""
    first = message.args[0] if getattr(message, "args", ()) else message
    try:
        words = " ".join(str(getattr(first, "commentary", "") or message).split())
    except UnicodeDecodeError:  # the text is quoted from the file
        words = "it is not text in UTF-8"
    words = "".join(letter for letter in words if letter.isprintable())
    return words if len(words) <= _LONGEST_WARNING else f"{words[:_LONGEST_WARNING]}..."


def matrix_of(matrix: Any) -> Matrix:
    """Return a Gf.Matrix4d, which multiplies rows, as a (4, 4) matrix that multiplies columns."""
    return np.array(matrix, np.float64).T


def rows(attribute: Any, stage: Stage, width: int) -> Floats | None:
    """Return an attribute as float64 (n, width), (n,) for a width of 1; None if it has no value of that shape.

    Raises GiError beyond the budget, after USD has unpacked the array of a binary file.
    """
    return as_rows(attribute.Get(stage.time) if attribute else None, stage, width)


def as_rows(value: Any, stage: Stage, width: int) -> Floats | None:
    """Return an array of vectors or numbers as `rows` does."""
    if not hasattr(value, "__len__"):
        return None
    stage.budget.take(8 * width * len(value), stage.source)
    try:
        values = np.asarray(value, np.float64)
    except (TypeError, ValueError):
        return None
    if width == 1:
        return values if values.ndim == 1 else None
    return values[:, :width] if values.ndim == 2 and values.shape[1] >= width else None


def whole(attribute: Any, stage: Stage) -> NDArray[np.int64]:
    """Return an attribute as integers (n,), as `rows` does; empty without a value."""
    value: Any = attribute.Get(stage.time) if attribute else None
    if not hasattr(value, "__len__"):
        return np.zeros(0, np.int64)
    stage.budget.take(8 * len(value), stage.source)
    try:
        values = np.asarray(value)
    except (TypeError, ValueError):
        return np.zeros(0, np.int64)
    return values.astype(np.int64) if values.ndim == 1 and values.dtype.kind in "iu" else np.zeros(0, np.int64)


def number(attribute: Any, time: Any, default: float, low: float = -math.inf, high: float = math.inf) -> float:
    """Return an attribute as a number from `low` to `high`; `default` without one."""
    value = attribute.Get(time) if attribute else None
    if isinstance(value, (int, float)) and low <= value <= high and math.isfinite(value):
        return float(value)
    return default


def triple(attribute: Any, time: Any, default: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return an attribute as three finite numbers of at least 0; `default` without them."""
    try:
        values = [max(float(value), 0.0) for value in attribute.Get(time)] if attribute else []
    except TypeError:
        values = []
    if len(values) < 3 or not all(map(math.isfinite, values)):
        return default
    return values[0], values[1], values[2]
