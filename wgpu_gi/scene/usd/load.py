"""Loads an OpenUSD stage as a `Scene`: geometry, UsdPreviewSurface materials, UsdLux lights and cameras, at one time.

Units: lengths are scaled by metersPerUnit, and +Z up is turned to +Y. Radiance does not depend on the unit of length;
see `lights` for the units of UsdLux.

Departures: subdivision surfaces are shown as their control meshes, curves and volumes are left out, and materials other
than UsdPreviewSurface become their display colours. Layers are composed as USD does, wherever they lie; textures must
lie in the folder of a layer, or in the one that holds all layers. USD unpacks an array of a binary file before its size
counts. Notes say what was approximated.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...errors import GiError
from ...float_limits import MAX_COORDINATE
from ..files.memory import MemoryBudget
from ..files.notes import Notes
from ..scene import Instance, Scene
from ..transforms import invertible
from .cameras import cameras_of
from .geometry import Geometry
from .lights import add_lights
from .prims import Placed, find_shown
from .skinning import bake_skinning
from .stage import Stage, diagnostics, open_stage


def load_usd(path: Path, budget: MemoryBudget, notes: Notes, time: float | None = None) -> Scene:
    """Load a stage at a time code; see `stage.open_stage`.

    Raises GiError without usd-core, for unreadable files, for stages with nothing to show, and beyond the budget.
    """
    with diagnostics(path, notes):
        stage = open_stage(path, time, notes, budget)
        bake_skinning(stage)
        shown = find_shown(stage)
        scene = Scene(name=path.stem)
        scene.instances = _instances(stage, shown.geometry)
        add_lights(stage, shown.lights, scene)
        scene.cameras = cameras_of(stage, shown.cameras)
    if not scene.instances:
        raise GiError(f"{path}: there is no geometry to show. {' '.join(notes.sentences)[:300]}".rstrip())
    scene.notes = notes.sentences
    return scene


def _instances(stage: Stage, placed: list[Placed]) -> list[Instance]:
    """Return the instances of all geometry that can be shown."""
    geometry = Geometry(stage)
    instances = []
    for prim, stage_from_prim in placed:
        part = geometry.part(prim)
        if part is None:
            continue
        matrix = invertible(stage.world_from_stage @ stage_from_prim @ part.world_from_local)
        if matrix is None or not (np.abs(matrix) < MAX_COORDINATE).all():
            stage.note(f"{prim.GetPath()} was left out: it is scaled to zero, or out of range")
            continue
        matrix[3] = 0.0, 0.0, 0.0, 1.0
        instances.append(Instance(part.mesh, matrix, prim.GetName()))
    return instances
