"""Measured figures on disk, so that the next picture of a view, or on the same adapter, starts from them.

An entry of figures belongs to a scene, a camera, all settings that are not a candidate's own, an adapter, and a
version; an entry of seconds, to an adapter and a version. A damaged entry, and a folder that cannot be written, count
as nothing measured: the choice is then made from expectations.
"""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import asdict, fields, replace
from pathlib import Path

from ..errors import GiError
from ..pictures.atomic_file import atomic_file
from ..renderer import Renderer
from ..resources import cache_folder
from ..scene.digest import digest
from ..settings import QUALITIES
from ..version import __version__
from .front import Candidate, Figures
from .typical import typical

# Values that stand for an array in an entry's name. All of Sponza's would take 0.3 s. Two scenes that share them share
# figures, which may cost a worse choice, never a wrong picture.
MOST_VALUES = 4096
MOST = 1e12  # no figure, seconds or relMSE, is so large
SECONDS = ("cold", "warm", "fixed", "per_pixel")
# Share of a first start that a later one takes, when the driver has its own cache of compiled shaders. Mesa, Cornell
# box: direct light 4.6 and 1.7 s, many-light 8.6 and 2.5 s.
FILLED = 0.33


class FrontCache:
    """The figures of a renderer's view: its scene, camera, settings and adapter when this is made."""

    def __init__(self, renderer: Renderer) -> None:
        base = replace(renderer.settings, gi="path", seed=0, exposure=None, spp=1)
        base.camera = replace(base.camera, frames=1)
        named = [renderer.posed_scene, renderer.posed_camera, base, renderer.adapter_name, __version__]
        self.path: Path = cache_folder("front") / f"{digest(named, MOST_VALUES)}.json"

    def load(self) -> dict[Candidate, Figures]:
        """Return what is known; nothing if there is no entry, or a damaged one."""
        names = {field.name for field in fields(Figures)}
        with suppress(OSError, ValueError, TypeError, KeyError, AttributeError):
            found: dict[Candidate, Figures] = {}
            for key, values in json.loads(self.path.read_text("utf-8")).items():
                gi, _, quality = key.partition(", ")
                numbers = [values[name] for name in names - {"measured"}]
                if not all(isinstance(x, int | float) and 0 <= x < MOST for x in numbers):
                    return {}
                found[Candidate(gi, quality)] = figures = Figures(**{name: values[name] for name in names})
                if figures.frame_seconds(1) <= 0:
                    return {}
            return found
        return {}

    def store(self, known: dict[Candidate, Figures]) -> None:
        """Write what is known, and keep what the entry has of other candidates.

        A folder that cannot be written is left alone.
        """
        every = self.load() | known
        entry = {f"{candidate.gi}, {candidate.quality}": asdict(figures) for candidate, figures in every.items()}
        _write(self.path, entry)


class AdapterCache:
    """The seconds of candidates on an adapter, whatever the scene: what the first picture of a scene starts from.

    The first start of a candidate fills the driver's own cache of compiled shaders; later processes take less.
    """

    def __init__(self, renderer: Renderer) -> None:
        named = ["seconds", renderer.adapter_name, __version__]
        self.path: Path = cache_folder("front") / f"adapter-{digest(named, MOST_VALUES)}.json"

    def load(self) -> dict[Candidate, Figures]:
        """Return typical figures with the seconds that were measured here; nothing if there is no entry."""
        entry = self._read().items()
        return {c: replace(typical(c), **seconds) for c, (seconds, _) in entry}  # type: ignore[arg-type]

    def _read(self) -> dict[Candidate, tuple[dict[str, float], bool]]:
        """Return the seconds of each candidate, and whether its start was measured."""
        found: dict[Candidate, tuple[dict[str, float], bool]] = {}
        with suppress(OSError, ValueError, TypeError, KeyError, AttributeError):
            for key, values in json.loads(self.path.read_text("utf-8")).items():
                gi, _, quality = key.partition(", ")
                if not all(isinstance(values[name], int | float) and 0 <= values[name] < MOST for name in SECONDS):
                    return {}
                if values["fixed"] + values["per_pixel"] <= 0 or quality not in QUALITIES:
                    return {}
                seconds = {name: float(values[name]) for name in SECONDS}
                found[Candidate(gi, quality)] = seconds, bool(values["started"])
        return found

    def store(
        self, known: Mapping[Candidate, Figures], begun: Collection[Candidate], had_rendered: Collection[Candidate]
    ) -> None:
        """Write the seconds of the candidates that have `begun`; those in `had_rendered` had their pipelines before.

        Seconds of a frame are the geometric mean of these and those before, as scenes differ. A folder that cannot be
        written is left alone.
        """
        entry = self._read()
        for c in begun:
            seconds = {name: float(getattr(known[c], name)) for name in SECONDS}
            before, started = entry.get(c, (seconds, False))
            means = {name: math.sqrt(value * before[name]) for name, value in seconds.items()}
            if c in had_rendered:
                entry[c] = means | {"cold": before["cold"]}, started
            else:
                entry[c] = means | {"cold": seconds["cold"] * (1.0 if started else FILLED)}, True
        texts = {f"{c.gi}, {c.quality}": seconds | {"started": started} for c, (seconds, started) in entry.items()}
        _write(self.path, texts)


def _write(path: Path, entry: object) -> None:
    with suppress(OSError, GiError):
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic_file(path) as temporary:
            temporary.write_text(json.dumps(entry, indent=1), "utf-8")
