"""Loads mesh files (OBJ, PLY, STL, OFF) as scenes of one mesh or of points, without lights or cameras.

Conventions: coordinates are metres with Y up, unchanged. Shading is smooth only where the file has vertex normals. A
surface without material is matte light grey, one with colours is matte. Files of points without faces are shown as
discs or spheres, see `points`.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from ...errors import GiError
from ..scene import Scene
from .memory import MemoryBudget
from .notes import Notes
from .obj import read_obj
from .off import read_off
from .ply_mesh import read_ply_mesh
from .points import points_scene
from .raw_mesh import RawMesh, RawPoints, scene_from_raw
from .stl import read_stl

MESH_EXTENSIONS = (".obj", ".ply", ".stl", ".off")

_READERS: dict[str, Callable[[Path, Notes, MemoryBudget], RawMesh | RawPoints]] = {
    ".obj": read_obj,
    ".ply": read_ply_mesh,
    ".stl": read_stl,
    ".off": read_off,
}


def load_mesh_file(
    path: str | Path,
    budget: MemoryBudget | None = None,
    notes: Notes | None = None,
    point_size: float | None = None,
) -> Scene:
    """Load an OBJ, PLY, STL or OFF file as a scene of one mesh, without lights and cameras.

    Points without faces become discs or spheres of the diameter `point_size` (metres); see `points.points_scene`.

    Positions are stored relative to the box centre, which is the instance's translation (float64). `Scene.notes` says
    what was approximated or left out (degenerate triangles, missing textures, faces with a wrong index). Raises GiError
    for a missing, empty, truncated or foreign file, for one with nothing to show, and for textures beyond the `budget`.
    """
    path = Path(path)
    extension = path.suffix.lower()
    if extension not in MESH_EXTENSIONS:
        raise GiError(f"{path}: {extension or 'no extension'} is not a mesh format; use {' '.join(MESH_EXTENSIONS)}")
    notes = notes or Notes()
    budget = budget or MemoryBudget()
    raw = _READERS[extension](path, notes, budget)
    if isinstance(raw, RawPoints):
        return points_scene(raw, point_size, path.stem, str(path), notes, budget)
    return scene_from_raw(raw, path.stem, str(path), notes)
