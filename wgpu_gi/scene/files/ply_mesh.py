"""Turns the elements of a PLY file into a mesh, or into points if it has no faces.

8-bit colours are sRGB, those of floats linear. Faces may be polygons or triangle strips. Texture coordinates may belong
to vertices or to the corners of faces, as MeshLab writes them, with `comment TextureFile` and `texnumber`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...errors import GiError
from ...pictures.color import linear_from_srgb
from ..scene import Material
from .memory import MemoryBudget
from .mtl_textures import Textures
from .notes import Notes
from .ply import Element, Lists, read_ply
from .polygons import Floats, Ints
from .raw_mesh import Attributes, RawMesh, RawPoints, clay, polygon_mesh
from .read import read_file

_CORNERS = ("vertex_indices", "vertex_index")
_COLORS = (
    ("red", "green", "blue", "alpha"),
    ("diffuse_red", "diffuse_green", "diffuse_blue", "alpha"),
    ("r", "g", "b", "a"),
)
_TEXCOORDS = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))
_NORMALS = (("nx", "ny", "nz"), ("normal_x", "normal_y", "normal_z"))
_LARGEST_INDEX = 1 << 53  # what float64 counts exactly


def read_ply_mesh(path: Path, notes: Notes, budget: MemoryBudget) -> RawMesh | RawPoints:
    """Read a PLY file; one of vertices alone gives points.

    Raises GiError for a file that is damaged or truncated, has no vertices, or has textures beyond the budget.
    """
    file = read_ply(str(path), read_file(path, "PLY file"))
    if file.rest:
        notes.damage(f"{path}: it has more data than its header announces; it was ignored")
    vertex = file.elements.get("vertex")
    if vertex is None or not vertex.count or not {"x", "y", "z"} <= vertex.columns.keys():
        raise GiError(f"{path} has no vertices with x, y and z; there is nothing to show")
    positions = _columns(vertex, (("x", "y", "z"),))
    assert positions is not None
    texcoords = _columns(vertex, _TEXCOORDS)
    attributes = Attributes(
        _columns(vertex, _NORMALS),
        None if texcoords is None else texcoords * (1.0, -1.0) + (0.0, 1.0),
        colors=_colors(vertex),
    )
    face = file.elements.get("face")
    strips = file.elements.get("tristrips")
    corners = None if face is None else next((face.lists[name] for name in _CORNERS if name in face.lists), None)
    if face is not None and face.count and corners is not None:
        if strips is not None and strips.count:
            notes.add(f"{path}: its triangle strips are not shown beside its faces")
        return _with_faces(path, file.textures, face, corners, positions, attributes, notes, budget)
    if strips is not None and (lists := next((strips.lists[n] for n in _CORNERS if n in strips.lists), None)):
        triangles = _strip_triangles(lists)
        return polygon_mesh(
            positions, triangles.ravel(), np.full(len(triangles), 3), str(path), notes,
            vertices=attributes, materials=_materials(path, file.textures, attributes.colors, notes, budget),
        )  # fmt: skip
    edges = file.elements.get("edge")
    if edges is not None and edges.count:
        raise GiError(f"{path} has edges and no faces; lines are not shown")
    return RawPoints(positions, attributes.colors, attributes.normals)


def _with_faces(
    path: Path,
    texture_files: list[str],
    face: Element,
    corners: Lists,
    positions: Floats,
    attributes: Attributes,
    notes: Notes,
    budget: MemoryBudget,
) -> RawMesh:
    """Return the mesh of a file with an element `face`."""
    # Texture coordinates of corners: pairs, as many as the face has corners.
    texcoords = face.lists.get("texcoord")
    corner_texcoords = None
    if texcoords is not None:
        if (texcoords.counts == 2 * corners.counts).all():
            corner_texcoords = texcoords.values.reshape(-1, 2).astype(np.float64) * (1.0, -1.0) + (0.0, 1.0)
        elif texcoords.counts.any():
            notes.damage(f"{path}: texture coordinates that do not belong to every corner of a face were ignored")
    colors = attributes.colors
    face_colors = _colors(face) if colors is None else None
    materials = _materials(path, texture_files, colors if face_colors is None else face_colors, notes, budget)
    number = face.columns.get("texnumber")
    material_of_face = None
    if number is not None and len(materials) > 1:
        material_of_face = _indices(number).clip(0, len(materials) - 1)
    return polygon_mesh(
        positions, _indices(corners.values), corners.counts, str(path), notes,
        vertices=attributes, corners=Attributes(texcoords=corner_texcoords), faces=Attributes(colors=face_colors),
        materials=materials, material_of_face=material_of_face,
    )  # fmt: skip


def _columns(element: Element, candidates: tuple[tuple[str, ...], ...]) -> Floats | None:
    """Return the first complete group of properties as float64 (n, k); None if there is none."""
    for names in candidates:
        if all(name in element.columns for name in names):
            return np.stack([element.columns[name] for name in names], 1).astype(np.float64)
    return None


def _colors(element: Element) -> Floats | None:
    """Return linear RGBA, (n, 4); None if the rows have no colour."""
    for names in _COLORS:
        if not all(name in element.columns for name in names[:3]):
            continue
        kinds = {name: kind for name, kind, _ in element.properties}
        columns = []
        for name in names:
            if name not in element.columns:
                columns.append(np.ones(element.count))
                continue
            values = element.columns[name].astype(np.float64)
            if kinds[name][0] != "f":
                values = values / float(np.iinfo(kinds[name]).max)
                values = values if name == names[3] else linear_from_srgb(values.clip(0, 1))
            columns.append(values)
        return np.stack(columns, 1)
    return None


def _indices(values: NDArray) -> Ints:
    """Return indices as integers; -1 for those that are none."""
    if values.dtype.kind != "f":
        return values.astype(np.int64)
    whole = np.abs(values) < _LARGEST_INDEX  # also false for NaN
    whole &= np.where(whole, values, 0.5) == np.floor(np.where(whole, values, 0.0))
    return np.where(whole, values, -1).astype(np.int64)


def _strip_triangles(strips: Lists) -> Ints:
    """Return the triangles (m, 3) of strips, which end at negative indices; every second one runs the other way."""
    ids = _indices(strips.values)
    # A strip starts where a list does, and behind each negative index.
    first = np.zeros(len(ids) + 1, np.bool_)
    first[np.cumsum(strips.counts) - strips.counts] = True
    first[1:] |= ids < 0
    first = first[: len(ids)]
    start = np.maximum.accumulate(np.where(first, np.arange(len(ids)), 0))
    third = np.arange(2, len(ids))
    third = third[(start[third] <= third - 2) & (ids[third] >= 0)]
    odd = ((third - start[third]) % 2 == 1)[:, None]
    a, b, c = ids[third - 2], ids[third - 1], ids[third]
    return np.where(odd, np.stack([b, a, c], 1), np.stack([a, b, c], 1))


def _materials(
    path: Path, texture_files: list[str], colors: Floats | None, notes: Notes, budget: MemoryBudget
) -> list[Material]:
    """Return a material for each texture that the file names; none if it names none."""
    textures = Textures(path.parent, notes, budget)
    materials = []
    for name in texture_files:
        material = clay()
        material.base_color_texture = textures.of_row(name)
        if material.base_color_texture or colors is not None:
            material.base_color = (1.0, 1.0, 1.0, 1.0)
        materials.append(material)
    return materials
