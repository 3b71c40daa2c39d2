"""Reads Wavefront OBJ files; `mtl` reads their materials.

trimesh is not used: it counts negative indices from the end of the file instead of from the face's line (this breaks
the common Cornell box files), cuts polygons as fans, reads only one material library, rounds `Kd` to 8 bits, keeps `Ke`
as text and does not report missing textures.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ...errors import GiError
from ...pictures.color import linear_from_srgb
from ..scene import Material
from .memory import MemoryBudget
from .mtl import read_mtl
from .mtl_textures import Textures
from .notes import Notes
from .polygons import Floats, Ints
from .raw_mesh import Attributes, RawMesh, RawPoints, clay, default_material, polygon_mesh
from .read import decode_text, find_inside, path_inside, read_file

_NONE = -1  # the index of an attribute that a corner does not have
_WRONG = -(1 << 62)  # an index that cannot be read

# Rows that draw something else than polygons.
_NOT_SHOWN = {"l": "lines", "p": "points", "curv": "curves", "curv2": "curves", "surf": "free-form surfaces"}


def read_obj(path: Path, notes: Notes, budget: MemoryBudget) -> RawMesh | RawPoints:
    """Read polygons, normals, texture coordinates, vertex colours and materials of an OBJ file.

    There is one vertex for each distinct `v/vt/vn`. Vertex colours (`v x y z r g b`) are sRGB, as Blender and MeshLab
    write them. Smoothing groups, lines, points, curves and surfaces are skipped. A file of vertices
    alone gives points. Faces and attributes with a wrong index or number are left out with a note. Raises
    GiError for textures beyond the budget.
    """
    lines = _read_lines(path)
    if lines.not_shown and (lines.corner_counts or lines.not_shown != {"points"}):
        notes.add(f"{path}: {', '.join(sorted(lines.not_shown))} are not shown")
    positions, colors = _positions(path, lines.rows["v"], notes)
    if not lines.corner_counts and lines.not_shown <= {"points"}:
        return RawPoints(positions, colors)
    # Look up the rows of each distinct corner.
    index, ids = _unique_corners(lines.corners)
    vertex = index[:, 0]
    ids = np.where((vertex >= 0) & (vertex < len(positions)), np.arange(len(index)), -1)[ids]
    vertex = vertex.clip(0, max(len(positions) - 1, 0))
    texcoords = _attribute(path, lines.rows["vt"], index[:, 1], 2, "vt", notes)
    materials = _materials(path, lines.libraries, list(lines.materials), notes, budget)
    if -1 in lines.material_of_face:
        materials.append(default_material(colors))
    return polygon_mesh(
        positions[vertex] if len(positions) else np.full((len(index), 3), np.nan),
        ids,
        np.array(lines.corner_counts, np.int64),
        str(path),
        notes,
        vertices=Attributes(
            _attribute(path, lines.rows["vn"], index[:, 2], 3, "vn", notes),
            # From v upwards (OBJ) to downwards (glTF and this package).
            None if texcoords is None else texcoords * (1.0, -1.0) + (0.0, 1.0),
            colors=None if colors is None else colors[vertex],
        ),
        materials=materials,
        # -1 (no material) becomes the last material, the default.
        material_of_face=np.array(lines.material_of_face, np.int64) % max(len(materials), 1),
    )


@dataclass
class _Lines:
    """The lines of an OBJ file by kind, faces as the texts of their corners with positive indices."""

    rows: dict[str, list[str]] = field(default_factory=lambda: {"v": [], "vt": [], "vn": []})
    corners: list[str] = field(default_factory=list)
    corner_counts: list[int] = field(default_factory=list)
    material_of_face: list[int] = field(default_factory=list)  # index into `materials`; -1: none
    materials: dict[str, int] = field(default_factory=dict)  # used materials, in order
    libraries: list[str] = field(default_factory=list)
    not_shown: set[str] = field(default_factory=set)


def _read_lines(path: Path) -> _Lines:
    """Sort the lines of a file by their first word."""
    text = decode_text(read_file(path, "OBJ file")).replace("\\\r\n", " ").replace("\\\n", " ")
    found, material = _Lines(), -1
    for line in text.splitlines():
        words = line.split(None, 1)
        if len(words) < 2:
            continue
        key, rest = words
        if key in found.rows:
            found.rows[key].append(rest)
        elif key == "f" or key == "fo":  # fo: an early form of f
            refs = rest.split("#")[0].split()
            if "-" in rest:
                refs = [_absolute(ref, found.rows) for ref in refs]
            found.corners += refs
            found.corner_counts.append(len(refs))
            found.material_of_face.append(material)
        elif key == "usemtl":
            material = found.materials.setdefault(rest.strip(), len(found.materials))
        elif key == "mtllib":
            found.libraries.append(rest.strip())
        elif key in _NOT_SHOWN:
            found.not_shown.add(_NOT_SHOWN[key])
    return found


def _absolute(ref: str, rows: dict[str, list[str]]) -> str:
    """Make the indices of a corner positive; negative indices count back from the latest row."""
    parts = ref.split("/")
    for k, (part, lines) in enumerate(zip(parts, rows.values(), strict=False)):
        if part.startswith("-") and part[1:].isdecimal():
            parts[k] = str(len(lines) + 1 - int(part[1:]))
    return "/".join(parts)


def _unique_corners(corners: list[str]) -> tuple[Ints, Ints]:
    """Return the distinct corners as 0-based indices (n, 3) of v, vt, vn (-1: none), and the row of each corner."""
    row_of = {corner: row for row, corner in enumerate(dict.fromkeys(corners))}
    ids = np.fromiter(map(row_of.__getitem__, corners), np.int64, len(corners))
    # An empty part is no attribute, as is 0.
    parts = [[part or "0" for part in f"{corner}//".split("/", 3)[:3]] for corner in row_of]
    try:
        index = np.array(parts, np.int64).reshape(-1, 3) - 1
    except (ValueError, OverflowError):
        index = np.array([[_index(part) for part in corner] for corner in parts], np.int64).reshape(-1, 3) - 1
    return index, ids


def _index(text: str) -> int:
    """Return an index of a file of one, or _WRONG."""
    try:
        index = int(text)
    except ValueError:
        return _WRONG
    return index if abs(index) < -_WRONG else _WRONG


def _numbers(path: Path, lines: list[str], start: int, stop: int, key: str, notes: Notes) -> Floats:
    """Parse columns [start, stop) of all rows; a number that cannot be read is NaN, a missing one too."""
    try:
        values = np.array([line.split(None, stop)[start:stop] for line in lines], np.float64)
        return values.reshape(len(lines), stop - start)
    except ValueError:
        pass
    # Read word by word, since few files need it.
    values, commas = np.full((len(lines), stop - start), np.nan), 0
    for row, line in enumerate(lines):
        for column, word in enumerate(line.split("#")[0].split(None, stop)[start:stop]):
            try:
                values[row, column] = float(word)
            except ValueError:
                commas += "," in word
                values[row, column] = _float(word.replace(",", "."))
    if commas:
        notes.damage(f"{path}: decimal commas in {key!r} rows were read as points: {commas}")
    return values


def _float(word: str) -> float:
    try:
        return float(word)
    except ValueError:
        return np.nan


def _positions(path: Path, lines: list[str], notes: Notes) -> tuple[Floats, Floats | None]:
    """Return positions (n, 3) and, if every row has them, linear RGBA colours (n, 4)."""
    positions = _numbers(path, lines, 0, 3, "v", notes)
    if not lines or any(len(line.split()) < 6 for line in lines):
        return positions, None
    colors = np.ones((len(lines), 4))
    colors[:, :3] = linear_from_srgb(_numbers(path, lines, 3, 6, "v", notes))
    return positions, colors


def _attribute(path: Path, lines: list[str], index: Ints, width: int, key: str, notes: Notes) -> Floats | None:
    """Return one row per vertex, zeros where it has none; None if no vertex has any."""
    wrong = (index < _NONE) | (index >= len(lines))
    if wrong.any():
        notes.damage(f"{path}: corners whose {key!r} does not exist: {np.count_nonzero(wrong)}")
    index = np.where(wrong, _NONE, index)
    if not (index >= 0).any():
        return None
    rows = _numbers(path, lines, 0, width, key, notes)
    if key == "vt" and np.isnan(rows[:, 1]).any():
        # Textures of one dimension have no v.
        short = np.array([len(line.split("#")[0].split()) == 1 for line in lines])
        rows[short, 1] = 0.0
    bad = ~np.isfinite(rows).all(1)
    if bad.any():
        notes.damage(f"{path}: {key!r} rows that are not {width} finite numbers: {np.count_nonzero(bad)}")
        rows[bad] = 0.0
    return np.concatenate([rows, np.zeros((1, width))])[index]


def _library_names(path: Path, rows: Sequence[str]) -> list[str]:
    """Return the names of `mtllib` rows: each row is one name, with or without spaces, or several."""
    names: list[str] = []
    for row in dict.fromkeys(rows):
        if find_inside(path.parent, row.strip('"'), path.parent) or len(row.split()) == 1:
            names.append(row.strip('"'))
        else:
            # A name ends where the extension does.
            parts = re.findall(r'"[^"]+"|\S.*?\.mtl(?=\s|$)', row, re.IGNORECASE) or row.split()
            names += [part.strip('"') for part in parts]
    return list(dict.fromkeys(names))


def _materials(
    path: Path, libraries: list[str], names: list[str], notes: Notes, budget: MemoryBudget
) -> list[Material]:
    """Return a material for each name in use; a missing one becomes grey, with a note."""
    known: dict[str, Material] = {}
    textures = Textures(path.parent, notes, budget)
    unread = 0
    for library in _library_names(path, libraries):
        file = find_inside(path.parent, library, path.parent) or path_inside(path.parent, library)
        if file is None:
            notes.damage(f"material library {library[:80]!r} is outside the scene's folder; its materials become grey")
            unread += 1
            continue
        try:
            text = decode_text(read_file(file, "material library"))
        except GiError as error:
            notes.damage(f"{error}; its materials become grey")
            unread += 1
            continue
        known |= read_mtl(text, names, textures, file.parent)
    missing = [name for name in names if name not in known]
    if missing and not unread:
        listed = ", ".join(repr(name[:60]) for name in missing[:5])
        notes.damage(f"{path}: no material library defines {listed}; they become grey")
    return [known.get(name) or clay() for name in names]
