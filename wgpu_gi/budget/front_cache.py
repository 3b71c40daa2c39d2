"""Measured figures on disk, so that the next picture of a view on the same adapter starts from them.

An entry belongs to a scene, a camera, all settings that are not a candidate's own, an adapter, and a version. A damaged
entry, and a folder that cannot be written, count as nothing measured: the choice is then made from expectations.
"""

from __future__ import annotations

import json
from contextlib import suppress
from dataclasses import asdict, fields, replace
from pathlib import Path

from ..errors import GiError
from ..pictures.atomic_file import atomic_file
from ..renderer import Renderer
from ..resources import cache_folder
from ..scene.digest import digest
from ..version import __version__
from .front import Candidate, Figures

# Values that stand for an array in an entry's name. All of Sponza's would take 0.3 s. Two scenes that share them share
# figures, which may cost a worse choice, never a wrong picture.
MOST_VALUES = 4096
MOST = 1e12  # no figure, seconds or relMSE, is so large


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
        with suppress(OSError, GiError):
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with atomic_file(self.path) as temporary:
                temporary.write_text(json.dumps(entry, indent=1), "utf-8")
