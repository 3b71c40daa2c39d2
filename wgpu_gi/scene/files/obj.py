"""Reads Wavefront OBJ files with their MTL materials.

trimesh is not used: it counts negative indices from the end of the file instead of from the face's line (this breaks
the common Cornell box files), reads only one material library, rounds `Kd` to 8 bits, keeps `Ke` as text and does not
report missing textures.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...errors import GiError
from ...float_limits import LARGEST_LIGHT
from ...pictures.color import linear_from_srgb
from ..scene import Image, Material, Texture
from .memory import MemoryBudget
from .notes import Notes
from .raw_mesh import RawMesh, clay, default_material, fans
from .read import path_inside, read_file

# The most values that each texture option of MTL takes (`-s 2 2 2 wood.png`).
TEXTURE_OPTIONS = {"-s": 3, "-o": 3, "-t": 3, "-mm": 2}


def read_obj(path: Path, notes: Notes, budget: MemoryBudget) -> RawMesh:
    """Read polygons, normals, texture coordinates, vertex colours and materials of an OBJ file.

    There is one vertex for each distinct `v/vt/vn`. Vertex colours (`v x y z r g b`) are sRGB, as Blender and MeshLab
    write them. Smoothing groups, lines, points, curves and surfaces are skipped. Raises GiError for malformed numbers,
    indices out of range and textures beyond the budget.
    """
    lines = _read_lines(path)
    index, ids = _unique_corners(path, lines.corners, {key: len(rows) for key, rows in lines.rows.items()})
    triangles, face = fans(ids, np.array(lines.corner_counts, np.int64))
    materials = _materials(path, lines.libraries, list(lines.materials), notes, budget)
    positions, colors = _positions(path, lines.rows["v"])
    if -1 in lines.material_of_face:
        materials.append(default_material(colors))
    # -1 (no material) becomes the last material, the default.
    material_of_face = np.array(lines.material_of_face, np.int64) % max(len(materials), 1)
    return RawMesh(
        positions=positions[index[:, 0]],
        triangles=triangles,
        materials=materials,
        material_of_triangle=material_of_face[face].astype(np.uint32),
        normals=_attribute(path, lines.rows["vn"], index[:, 2], 3, "vn"),
        texcoords=_flip_v(_attribute(path, lines.rows["vt"], index[:, 1], 2, "vt")),
        colors=None if colors is None else colors[index[:, 0]],
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


def _read_lines(path: Path) -> _Lines:
    """Sort the lines of a file by their first word."""
    text = read_file(path, "OBJ file").decode("utf-8-sig", errors="replace").replace("\\\r\n", " ").replace("\\\n", " ")
    found, material = _Lines(), -1
    for line in text.splitlines():
        words = line.split(None, 1)
        if len(words) < 2:
            continue
        key, rest = words
        if key in found.rows:
            found.rows[key].append(rest)
        elif key == "f":
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
    return found


def _absolute(ref: str, rows: dict[str, list[str]]) -> str:
    """Make the indices of a corner positive; negative indices count back from the latest row."""
    parts = ref.split("/")
    for k, (part, lines) in enumerate(zip(parts, rows.values(), strict=False)):
        if part.startswith("-") and part[1:].isdigit():
            parts[k] = str(len(lines) + 1 - int(part[1:]))
    return "/".join(parts)


def _unique_corners(path: Path, corners: list[str], counts: dict[str, int]) -> tuple[NDArray, NDArray]:
    """Return the distinct corners as 0-based indices (n, 3) of v, vt, vn (-1: none), and the row of each corner."""
    row_of = {corner: row for row, corner in enumerate(dict.fromkeys(corners))}
    ids = np.fromiter(map(row_of.__getitem__, corners), np.int64, len(corners))
    try:
        parts = [(corner + "/0/0").replace("//", "/0/").split("/", 3)[:3] for corner in row_of]
        index = np.array(parts, np.int64).reshape(-1, 3) - 1
    except (ValueError, OverflowError):
        raise GiError(f"{path}: a face has an index that is not a whole number; the file is damaged") from None
    for k, (key, count) in enumerate(counts.items()):
        wrong = (index[:, k] < (0 if key == "v" else -1)) | (index[:, k] >= count)
        if wrong.any():
            corner = list(row_of)[int(np.argmax(wrong))]
            raise GiError(f"{path}: face corner {corner!r} is out of range; the file has {count} {key!r} rows")
    return index, ids


def _numbers(path: Path, lines: list[str], start: int, stop: int, key: str) -> NDArray[np.float64]:
    """Parse columns [start, stop) of all rows. Raises GiError for short or malformed ones."""
    try:
        values = np.array([line.split(None, stop)[start:stop] for line in lines], np.float64)
        return values.reshape(len(lines), stop - start)
    except ValueError:
        message = f"{path}: a {key!r} row does not begin with {stop} numbers; the file is damaged"
        raise GiError(message) from None


def _positions(path: Path, lines: list[str]) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
    """Return positions (n, 3) and, if every row has them, linear RGBA colours (n, 4)."""
    positions = _numbers(path, lines, 0, 3, "v")
    if not lines or any(len(line.split()) < 6 for line in lines):
        return positions, None
    colors = np.ones((len(lines), 4))
    colors[:, :3] = linear_from_srgb(_numbers(path, lines, 3, 6, "v"))
    return positions, colors


def _attribute(path: Path, lines: list[str], index: NDArray, width: int, key: str) -> NDArray[np.float64] | None:
    """Return one row per vertex, zeros where `index` is -1; None if no vertex has any."""
    if not (index >= 0).any():
        return None
    rows = np.concatenate([_numbers(path, lines, 0, width, key), np.zeros((1, width))])
    return rows[index]


def _flip_v(texcoords: NDArray[np.float64] | None) -> NDArray[np.float64] | None:
    """Convert v from upwards (OBJ) to downwards (glTF and this package)."""
    return None if texcoords is None else texcoords * (1.0, -1.0) + (0.0, 1.0)


def _materials(
    path: Path, libraries: list[str], names: list[str], notes: Notes, budget: MemoryBudget
) -> list[Material]:
    """Return a material for each name in use; a missing one becomes grey, with a note."""
    known: dict[str, Material] = {}
    textures = Textures(path.parent, notes, budget)
    unread = 0
    for library in dict.fromkeys(libraries):
        file = path_inside(path.parent, library)
        if file is None:
            notes.damage(f"material library {library!r} lies outside the scene's folder; its materials become grey")
            unread += 1
            continue
        try:
            text = read_file(file, "material library").decode("utf-8-sig", errors="replace")
        except GiError as error:
            notes.damage(f"{error}; its materials become grey")
            unread += 1
            continue
        known |= read_mtl(text, names, textures)
    missing = [name for name in names if name not in known]
    if missing and not unread:
        notes.damage(f"{path}: no material library defines {', '.join(map(repr, missing[:5]))}; they become grey")
    return [known.get(name) or clay() for name in names]


def read_mtl(text: str, names: Iterable[str], textures: Textures) -> dict[str, Material]:
    """Read those materials of an MTL text that have one of the `names`.

    `Kd` is linear reflectance, as in the published Cornell boxes, and `Ke` radiance in W/(m2 sr). `map_Kd` and `map_Ke`
    are sRGB and multiply them; a zero or missing factor beside a map counts as one, since exporters write it so.
    `d`, `Tr` and `map_d` are ignored with a note, other keys (specular, bump, illumination model) without a note.
    """
    blocks: dict[str, dict[str, str]] = {}
    block: dict[str, str] = {}
    for line in text.replace("\\\n", " ").splitlines():
        key, _, rest = line.strip().replace("\t", " ").partition(" ")
        if key.lower() == "newmtl":
            block = blocks.setdefault(rest.strip(), {})
        elif key:
            block[key.lower()] = rest.strip()
    return {name: _material(name, blocks[name], textures) for name in names if name in blocks}


def _material(name: str, block: dict[str, str], textures: Textures) -> Material:
    """Return a material from the rows of its MTL block by key."""
    notes = textures.notes
    material = clay()
    material.name = name
    # Reflectance.
    diffuse = _color(name, "Kd", block, notes)
    material.base_color_texture = textures.of_row(block.get("map_kd"))
    if diffuse is not None:
        if max(diffuse) > 1:
            notes.add(f"material {name!r}: Kd is above 1, more than a surface can reflect; it was limited to 1")
        material.base_color = (*(min(c, 1.0) for c in diffuse), 1.0)  # type: ignore[assignment]
    if material.base_color_texture and (diffuse is None or max(diffuse) == 0):
        material.base_color = (1.0, 1.0, 1.0, 1.0)
    # Emission.
    emission = _color(name, "Ke", block, notes)
    material.emission = emission or (0.0, 0.0, 0.0)
    material.emission_texture = textures.of_row(block.get("map_ke"))
    if material.emission_texture and max(material.emission) == 0:
        material.emission = (1.0, 1.0, 1.0)
    # Transparency.
    opaque = min(_values(block, "d"), default=1.0 - max(_values(block, "tr"), default=0.0)) >= 1.0
    if "map_d" in block or not opaque:
        notes.add(f"material {name!r}: transparency is ignored; it is shown opaque")
    return material


def _values(block: dict[str, str], key: str) -> list[float]:
    """Return the numbers of an MTL row, none if there is no such row or it is malformed."""
    try:
        return [float(word) for word in block.get(key, "").split("#")[0].split()]
    except ValueError:
        return []


def _color(name: str, key: str, block: dict[str, str], notes: Notes) -> tuple[float, float, float] | None:
    """Return an MTL colour (one number means grey); None if it is absent, or malformed, with a note."""
    if key.lower() not in block:
        return None
    values = _values(block, key.lower())
    values = values * 3 if len(values) == 1 else values
    if len(values) != 3 or not all(0.0 <= value <= LARGEST_LIGHT for value in values):
        notes.damage(f"material {name!r}: {key} {block[key.lower()]!r} is not a colour; it was ignored")
        return None
    return values[0], values[1], values[2]


class Textures:
    """The textures in the files below `folder`, each decoded once; `notes` receives what cannot be shown."""

    def __init__(self, folder: Path, notes: Notes, budget: MemoryBudget) -> None:
        self.notes = notes
        self._folder = folder
        self._budget = budget
        self._known: dict[Path | str, Texture | None] = {}

    def of_row(self, row: str | None) -> Texture | None:
        """Return the texture that a `map_` row names after its options; None, with a note, if it cannot be loaded."""
        if not row:
            return None
        words = row.split()
        while words and words[0].startswith("-"):
            option = words.pop(0)
            limit = TEXTURE_OPTIONS.get(option, 1)
            while limit and len(words) > 1 and (option not in TEXTURE_OPTIONS or _is_number(words[0])):
                words.pop(0)
                limit -= 1
        name = " ".join(words)
        file = path_inside(self._folder, name)
        key = file or name
        if key not in self._known:
            self._known[key] = self._load(name, file)
        return self._known[key]

    def _load(self, name: str, file: Path | None) -> Texture | None:
        """Return the texture in a file, or None with a note why it cannot be shown."""
        from .image_files import (
            decode_image,
            open_image,
            without_warnings,
        )  # imports Pillow, which few scenes here need

        if file is None:
            self.notes.damage(f"texture {name!r} lies outside the scene's folder; the plain colour is used")
            return None
        try:
            encoded = read_file(file, "texture")
        except GiError as error:
            self.notes.damage(f"{error}; the plain colour is used")
            return None
        with without_warnings():
            pixels = decode_image(open_image(encoded, self._budget, f"texture {file}"))
        if isinstance(pixels, str):
            self.notes.damage(f"texture {file} cannot be used: {pixels}; the plain colour is used")
            return None
        return Texture(Image(pixels, name))


def _is_number(word: str) -> bool:
    """Tell whether a word of an MTL row is a decimal number, without exponent."""
    return word.lstrip("+-").replace(".", "", 1).isdigit()
