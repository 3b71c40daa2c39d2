"""The results of a report on an adapter, as plain data, and its JSON file.

The file is `AdapterReport`, with "schema": "wgpu_gi.report" and "version", which increases when a field changes its
meaning. Times are milliseconds, by the clock that `machine` names. null marks what was not measured; `left_out` says
why.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from ...errors import GiError
from ...pictures.atomic_file import atomic_file

SCHEMA, VERSION = "wgpu_gi.report", 1
LARGEST_FILE = 64 * 2**20  # bytes; a report has about 30,000


@dataclass(frozen=True)
class Timestamps:
    """Timestamps around one kind of pass against submit and wait: `share` of the waiting time, None without them."""

    kind: str
    share: float | None
    right: bool


@dataclass(frozen=True)
class CheckResult:
    """A check of the self-test: its deviation from a closed form, and the bound that it holds if it passed."""

    group: str
    name: str
    sentence: str
    passed: bool
    deviation: float | None
    bound: float
    note: str = ""
    seconds: float = 0.0


@dataclass(frozen=True)
class TestRun:
    """The tests of a source checkout: how many passed, failed and were skipped, and the names of failures."""

    passed: int
    failed: int
    skipped: int
    names: list[str]
    finished: bool


@dataclass(frozen=True)
class RayRate:
    """Rays per second of one kind in a scene; `hits` is the share that hit something."""

    scene: str
    triangles: int
    kind: str
    per_second: float
    hits: float


@dataclass(frozen=True)
class Build:
    """Milliseconds from a scene in memory to its copy on the device.

    ms: the first time. geometry_ms: again, with new meshes but known images: hierarchies and tables of triangles.
    moved_ms: again, after one instance has moved. bytes: all buffers and textures of the scene.
    """

    scene: str
    triangles: int
    ms: float
    geometry_ms: float
    moved_ms: float
    bytes: int


@dataclass(frozen=True)
class PassTimes:
    """Medians of frames in which every pass runs while the camera moves.

    passes: by name, in order; passes_ms: their sum. frame_ms: a frame whose passes are not timed, with waiting. bytes:
    what the technique allocates. frames: how many were timed.
    """

    technique: str
    passes_ms: float
    frame_ms: float
    passes: dict[str, float]
    bytes: int
    frames: int


@dataclass(frozen=True)
class SceneTimes:
    """The times of the techniques in a scene."""

    scene: str
    size: tuple[int, int]
    techniques: list[PassTimes]


@dataclass(frozen=True)
class TruthError:
    """relMSE and bias of a technique in a scene with a stored truth: of one frame, and of a finished still picture."""

    scene: str
    technique: str
    relmse: float
    bias: float
    still_relmse: float
    still_bias: float
    frames: int


@dataclass(frozen=True)
class MainThread:
    """Milliseconds of the main thread in a frame in which the camera moves, and how many passes it records."""

    technique: str
    ms: float
    passes: int


@dataclass
class AdapterReport:
    """All results. `memory`: peak bytes of the process, None where the system does not tell."""

    machine: dict[str, Any]
    features: list[str]
    limits: dict[str, int]
    needs_newer_driver: list[str]
    timestamps: list[Timestamps] = field(default_factory=list)
    checks: list[CheckResult] = field(default_factory=list)
    tests: TestRun | None = None
    rays: list[RayRate] = field(default_factory=list)
    builds: list[Build] = field(default_factory=list)
    scenes: list[SceneTimes] = field(default_factory=list)
    errors: list[TruthError] = field(default_factory=list)
    threads: list[MainThread] = field(default_factory=list)
    memory: int | None = None
    left_out: list[str] = field(default_factory=list)
    seconds: float = 0.0

    @property
    def failed(self) -> list[CheckResult]:
        """The checks that failed."""
        return [check for check in self.checks if not check.passed]


def save_json(path: str | Path, report: AdapterReport) -> None:
    """Write the report. Raises GiError if the file cannot be written."""
    text = json.dumps({"schema": SCHEMA, "version": VERSION, **asdict(report)}, indent=1, allow_nan=False) + "\n"
    with atomic_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def load_json(path: str | Path) -> AdapterReport:
    """Read a report. Raises GiError for a file that is missing, damaged, or of another program or version."""
    try:
        if Path(path).stat().st_size > LARGEST_FILE:
            raise ValueError("too large")
        document = json.loads(Path(path).read_text(encoding="utf-8"))
        if document["schema"] != SCHEMA:
            raise KeyError("schema")
        version = document["version"]
        if version != VERSION:
            raise GiError(f"{path}: version {version} of the report; this program reads {VERSION}: measure again")
        return _report(document)
    except OSError as error:
        raise GiError(f"{path}: cannot be read ({error.strerror or error})") from None
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError):
        raise GiError(f"{path}: not a report of wgpu-gi report") from None


def _report(d: Mapping[str, Any]) -> AdapterReport:
    """Return the report of a document. Raises KeyError, TypeError or ValueError if a field does not fit."""
    scenes = []
    for scene in d["scenes"]:
        width, height = scene["size"]
        techniques = [_of(PassTimes, t) for t in scene["techniques"]]
        scenes.append(SceneTimes(str(scene["scene"]), (int(width), int(height)), techniques))
    machine = dict(d["machine"])
    if not isinstance(machine["adapter"], str) or not isinstance(machine.get("packages", {}), dict):
        raise TypeError("machine")
    return AdapterReport(
        machine,
        [str(name) for name in d["features"]],
        {str(name): int(value) for name, value in d["limits"].items()},
        [str(sentence) for sentence in d["needs_newer_driver"]],
        [_of(Timestamps, t) for t in d["timestamps"]],
        [_of(CheckResult, c) for c in d["checks"]],
        None if d["tests"] is None else _of(TestRun, d["tests"]),
        [_of(RayRate, r) for r in d["rays"]],
        [_of(Build, b) for b in d["builds"]],
        scenes,
        [_of(TruthError, e) for e in d["errors"]],
        [_of(MainThread, t) for t in d["threads"]],
        None if d["memory"] is None else int(d["memory"]),
        [str(sentence) for sentence in d["left_out"]],
        float(d["seconds"]),
    )


def _is_number(value: object) -> bool:
    """Tell whether a value is a finite number that a float can hold."""
    return isinstance(value, int | float) and math.isfinite(value)


# By the annotation of a field: whether a value fits.
FITS: dict[str, Callable[[Any], bool]] = {
    "float": _is_number,
    "float | None": lambda value: value is None or _is_number(value),
    "int": lambda value: isinstance(value, int) and _is_number(value),
    "bool": lambda value: isinstance(value, bool),
    "str": lambda value: isinstance(value, str),
    "list[str]": lambda value: isinstance(value, list) and all(isinstance(item, str) for item in value),
    "dict[str, float]": lambda value: isinstance(value, dict) and all(map(_is_number, value.values())),
}


def _of(kind: Any, values: Mapping[str, Any]) -> Any:
    """Return a record of a dataclass. Raises TypeError for a missing or an unknown field, or one of another type."""
    made = kind(**values)
    for name, wanted in kind.__annotations__.items():
        if not FITS[wanted](getattr(made, name)):
            raise TypeError(name)
    return made
