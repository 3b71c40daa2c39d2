"""Reads mesh files (OBJ, PLY, STL, OFF) as scenes of one mesh, without lights or cameras.

trimesh parses PLY and STL. It is imported on demand, since that takes up to a second. Only its raw arrays are used: its
mesh class merges vertices and invents normals. `obj` parses OBJ; this module parses OFF.

Conventions: coordinates are metres with Y up, unchanged. 8-bit vertex and face colours of PLY are sRGB, float ones
linear. Shading is smooth only where the file has vertex normals (OBJ, PLY). A surface without material is matte light
grey. For materials and textures of OBJ see `obj.read_mtl`.
"""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import GiError
from ...pictures.color import linear_from_srgb
from ..scene import Scene
from .memory import MemoryBudget
from .notes import Notes
from .obj import read_obj
from .raw_mesh import RawMesh, fans, scene_from_raw
from .read import read_file

MESH_EXTENSIONS = (".obj", ".ply", ".stl", ".off")


def load_mesh_file(path: str | Path, budget: MemoryBudget | None = None, notes: Notes | None = None) -> Scene:
    """Load an OBJ, PLY, STL or OFF file as a scene of one mesh, without lights and cameras.

    Positions are stored relative to the box centre, which is the instance's translation (float64). `Scene.notes` says
    what was left out (degenerate triangles, missing textures, transparency). Raises GiError for a missing, empty,
    damaged or foreign file, for indices out of range, NaN or infinite vertices, for a file without faces, and for
    textures beyond the `budget`.
    """
    path = Path(path)
    extension = path.suffix.lower()
    if extension not in MESH_EXTENSIONS:
        raise GiError(f"{path}: {extension or 'no extension'} is not a mesh format; use {' '.join(MESH_EXTENSIONS)}")
    notes = notes or Notes()
    raw = _READERS[extension](path, notes, budget or MemoryBudget())
    return scene_from_raw(raw, path.stem, str(path), notes)


def _read_ply(path: Path, notes: Notes, budget: MemoryBudget) -> RawMesh:
    from trimesh.exchange.ply import load_ply

    data = read_file(path, "PLY file")
    with _silence():
        try:
            # fix_texture would renumber vertices, but not their normals and colours.
            return _raw_mesh(load_ply(BytesIO(data), fix_texture=False, skip_materials=True))
        except Exception as error:  # trimesh lets any of numpy's exceptions through
            reason = "damaged, truncated or another format"
            if "unexpected length" in str(error):
                reason = "truncated, or binary with polygons of different sizes: export it as triangles"
            raise GiError(f"{path} is not a readable PLY file: {reason}") from None


def _read_stl(path: Path, notes: Notes, budget: MemoryBudget) -> RawMesh:
    from trimesh.exchange.stl import load_stl_ascii, load_stl_binary

    data = read_file(path, "STL file")
    # Tell binary from text by the length, since binary files may begin with "solid", too.
    announced = 84 + 50 * int.from_bytes(data[80:84], "little")
    text = data.decode("utf-8-sig", errors="replace").lower() if announced != len(data) else ""
    if not text.lstrip().startswith("solid"):
        if announced > len(data):
            raise GiError(f"{path} is truncated or not an STL file: it announces {announced} bytes and has {len(data)}")
        load, data = load_stl_binary, data[:announced]
    elif "endsolid" not in text:
        raise GiError(f"{path} is truncated: there is no 'endsolid'")
    else:
        load, data = load_stl_ascii, text.encode()
    # Join the solids of the file.
    with _silence():
        try:
            arrays = load(BytesIO(data))
            parts = list(arrays["geometry"].values()) if "geometry" in arrays else [arrays]
            meshes = [_raw_mesh(part) for part in parts]
        except Exception:  # trimesh lets any of numpy's exceptions through
            raise GiError(f"{path} is not a readable STL file: damaged or another format") from None
    if len(meshes) > 1:
        notes.add(f"{path}: its {len(meshes)} solids were joined into one mesh")
    return _join(meshes)


def _read_off(path: Path, notes: Notes, budget: MemoryBudget) -> RawMesh:
    """Read a text OFF file; skip colours and normals. trimesh cannot read its polygons of five corners."""
    text = read_file(path, "OFF file").decode("utf-8-sig", errors="replace")
    lines = [words for line in text.splitlines() if (words := line.split("#")[0].split())]
    if not lines or not lines[0][0].upper().endswith("OFF"):
        raise GiError(f"{path} is not an OFF file: it does not begin with the word OFF")
    # The counts may follow the word OFF on its line or below it.
    lines = [lines[0][1:], *lines[1:]] if len(lines[0]) > 1 else lines[1:]
    try:
        vertex_count, face_count = int(lines[0][0]), int(lines[0][1])
        vertex_lines = lines[1 : 1 + vertex_count]
        face_lines = lines[1 + vertex_count : 1 + vertex_count + face_count]
        if vertex_count < 0 or face_count < 0 or len(vertex_lines) + len(face_lines) < vertex_count + face_count:
            raise GiError(f"{path} is truncated: {vertex_count} vertices and {face_count} faces are announced")
        positions = np.array([words[:3] for words in vertex_lines], np.float64).reshape(-1, 3)
        counts = np.array([int(words[0]) for words in face_lines], np.int64)
        corners = [words[1 : 1 + count] for words, count in zip(face_lines, counts, strict=True)]
        ids = np.array([int(word) for words in corners for word in words], np.int64)
        triangles, _ = fans(ids, np.array([len(words) for words in corners], np.int64))
    except (ValueError, IndexError, OverflowError):
        raise GiError(f"{path} is not a readable OFF file: it is damaged") from None
    return RawMesh(positions, triangles)


@contextmanager
def _silence() -> Iterator[None]:
    """Suppress trimesh's log and numpy's warnings; raise numpy's warnings about text that is not a number."""
    # Its modules log to children of this logger, whose records end here.
    logger, nowhere = logging.getLogger("trimesh"), logging.NullHandler()
    before = logger.propagate
    logger.propagate = False
    logger.addHandler(nowhere)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            warnings.filterwarnings("error", message="string or file could not be read")
            warnings.filterwarnings("error", message="invalid value encountered in cast")
            yield
    finally:
        logger.removeHandler(nowhere)
        logger.propagate = before


def _raw_mesh(arrays: dict[str, Any]) -> RawMesh:
    """Turn trimesh's arrays into triangles; with face colours, triangles share no vertices."""
    positions = np.asarray(arrays.get("vertices", ()), np.float64).reshape(-1, 3)
    faces = np.asarray(arrays.get("faces", ()))
    corners = faces.shape[1] if faces.ndim == 2 else 3
    fan = [faces.reshape(-1, corners)[:, [0, k, k + 1]] for k in range(1, corners - 1)]
    triangles = np.concatenate(fan).astype(np.int64)
    colors, face_colors = _linear_colors(arrays.get("vertex_colors")), _linear_colors(arrays.get("face_colors"))
    # Damaged files give arrays of Python objects, which the conversion refuses.
    normals = None if arrays.get("vertex_normals") is None else np.asarray(arrays["vertex_normals"], np.float64)
    if colors is None and face_colors is not None:
        normals = None if normals is None else normals[triangles].reshape(-1, 3)
        positions = positions[triangles].reshape(-1, 3)
        colors = np.repeat(np.tile(face_colors, (len(fan), 1)), 3, axis=0)
        triangles = np.arange(len(positions)).reshape(-1, 3)
    return RawMesh(positions, triangles, normals=normals, colors=colors)


def _linear_colors(colors: NDArray | None) -> NDArray[np.float64] | None:
    """Return linear RGBA; integers are sRGB over their full range, floats are linear."""
    if colors is None or len(colors) == 0:
        return None
    if colors.dtype.kind in "ui":
        unit = colors / float(np.iinfo(colors.dtype).max)
        rgb, alpha = linear_from_srgb(unit[:, :3]), unit[:, 3:]
    else:
        rgb, alpha = colors[:, :3].astype(np.float64), colors[:, 3:]
    return np.concatenate([rgb, alpha, np.ones((len(rgb), 1))], axis=1)[:, :4]


def _join(meshes: list[RawMesh]) -> RawMesh:
    """Concatenate meshes without attributes, such as the solids of an STL file; a single one is returned unchanged."""
    if len(meshes) == 1:
        return meshes[0]
    counts = [0, *(len(mesh.positions) for mesh in meshes)]
    starts = np.cumsum(counts)
    return RawMesh(
        np.concatenate([np.zeros((0, 3)), *(mesh.positions for mesh in meshes)]),
        np.concatenate([np.zeros((0, 3), np.int64), *(m.triangles + s for m, s in zip(meshes, starts, strict=False))]),
    )


_READERS: dict[str, Callable[[Path, Notes, MemoryBudget], RawMesh]] = {
    ".obj": read_obj,
    ".ply": _read_ply,
    ".stl": _read_stl,
    ".off": _read_off,
}
