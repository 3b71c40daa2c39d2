"""Checks arrays of vertices, faces and their attributes, and brings them into the form of a mesh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import GiError
from ..float_limits import MAX_COORDINATE
from ..pictures.color import linear_from_srgb
from .mesh_cleaning import has_area, unit_rows
from .rules import shown


@dataclass
class MeshArrays:
    """The arrays of a mesh as in `Mesh`, with positions relative to `centre`; `flat` triangles were left out."""

    centre: NDArray[np.float64]
    positions: NDArray[np.float32]
    triangles: NDArray[np.uint32]
    normals: NDArray[np.float32] | None
    texcoords: NDArray[np.float32] | None
    colors: NDArray[np.float32] | None
    flat: int


def mesh_arrays(vertices: Any, faces: Any, colors: Any, normals: Any, uvs: Any) -> MeshArrays:
    """Return the arrays of a mesh. Raises GiError that names the array, and the first wrong row."""
    # Check the arrays. Quads become two triangles each.
    positions = _rows("vertices", vertices, (3,))
    corners = _indices(faces, len(positions))
    if not len(corners):
        raise GiError("faces must not be empty; a mesh has at least one")
    triangles = corners if corners.shape[1] == 3 else corners[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    directions = None if normals is None else _rows("normals", normals, (3,), len(positions))
    texcoords = None if uvs is None else _rows("uvs", uvs, (2,), len(positions))
    tints, face_tints = _colors(colors, len(positions), len(corners))
    # With a colour for each face, triangles share no vertices.
    if face_tints is not None:
        tints = np.repeat(np.repeat(face_tints, len(triangles) // len(corners), axis=0), 3, axis=0)
        at = triangles.reshape(-1)
        positions, triangles = positions[at], np.arange(len(at)).reshape(-1, 3)
        directions, texcoords = (None if rows is None else rows[at] for rows in (directions, texcoords))
    # Move the mesh to the centre of its box, and leave out triangles without area.
    used = positions[triangles.reshape(-1)]
    centre = (used.min(0) + used.max(0)) / 2
    local = (positions - centre).astype(np.float32)
    kept = has_area(local, triangles)
    if not kept.any():
        raise GiError(f"all {len(kept)} faces have no area; there is nothing to show")
    return MeshArrays(
        centre,
        local,
        triangles[kept].astype(np.uint32),
        None if directions is None else unit_rows(directions),
        None if texcoords is None else texcoords.astype(np.float32),
        None if tints is None else tints.astype(np.float32),
        int(np.count_nonzero(~kept)),
    )


def linear_rgba(colors: NDArray[Any]) -> NDArray[np.float64]:
    """Return (n, 3) or (n, 4) colours as linear RGBA: integers are sRGB over their full range, floats are linear."""
    if colors.dtype.kind in "ui":
        unit = colors / float(np.iinfo(colors.dtype).max)
        rgb, alpha = linear_from_srgb(unit[:, :3]), unit[:, 3:]
    else:
        rgb, alpha = colors[:, :3].astype(np.float64), colors[:, 3:]
    return np.concatenate([rgb, alpha, np.ones((len(rgb), 1))], axis=1)[:, :4]


def _array(name: str, values: Any, words: str) -> NDArray[Any]:
    """Return values as an array of numbers. Raises GiError, which says that they must be `words`, for anything else."""
    try:
        array = np.asarray(values)
    except (ValueError, TypeError):  # rows of different lengths
        array = np.zeros(0, object)
    if array.dtype.kind not in "fiu":
        kind = f"of type {array.dtype}" if isinstance(values, np.ndarray) else f"{shown(values)}"
        raise GiError(f"{name} must be {words}, not {kind}")
    return array


def _rows(name: str, values: Any, widths: Sequence[int], count: int | None = None) -> NDArray[np.float64]:
    """Return values as (n, width) finite float64, with `count` rows. Raises GiError that names the first wrong row."""
    words = f"an array of numbers of shape (n, {' or '.join(map(str, widths))})"
    array = _array(name, values, words)
    if array.ndim != 2 or array.shape[1] not in widths:
        raise GiError(f"{name} must be {words}, not of shape {array.shape}")
    if count is not None and len(array) != count:
        raise GiError(f"{name} must have a row for each of the {count} vertices, not {len(array)} rows")
    rows = array.astype(np.float64)
    with np.errstate(invalid="ignore"):
        wrong = ~(np.abs(rows) <= MAX_COORDINATE).all(1)
    if wrong.any():
        row = int(np.argmax(wrong))
        found = ", ".join(f"{value:g}" for value in rows[row])
        raise GiError(f"{name}[{row}] must be finite and at most {MAX_COORDINATE:g}, not ({found})")
    return rows


def _indices(faces: Any, count: int) -> NDArray[np.int64]:
    """Return faces as (m, 3) or (m, 4) indices of `count` vertices. Raises GiError that names the first wrong face."""
    words = "an array of whole numbers of shape (m, 3), or (m, 4) for quads"
    array = _array("faces", faces, words)
    if array.ndim != 2 or array.shape[1] not in (3, 4):
        raise GiError(f"faces must be {words}, not of shape {array.shape}")
    if array.dtype.kind == "f":
        raise GiError(f"faces must be {words}, not of type {array.dtype}; convert them with .astype(int)")
    wrong = ((array < 0) | (array >= count)).any(1)
    if wrong.any():
        row = int(np.argmax(wrong))
        found = ", ".join(map(str, array[row].tolist()))
        raise GiError(f"faces[{row}] must be indices from 0 to {count - 1} into vertices, not ({found})")
    return array.astype(np.int64)


def _colors(values: Any, vertices: int, faces: int) -> tuple[NDArray[np.float64] | None, NDArray[np.float64] | None]:
    """Return linear RGBA of the vertices, or of the faces; one colour colours all vertices."""
    if values is None:
        return None, None
    words = "one colour, or an array of shape (n, 3) or (n, 4) with a row for each vertex or face"
    array = _array("colors", values, words)
    if array.ndim == 1 and len(array) in (3, 4):
        array = np.tile(array, (vertices, 1))
    if array.ndim != 2 or array.shape[1] not in (3, 4) or len(array) not in (vertices, faces):
        raise GiError(f"colors must be {words} ({vertices} vertices, {faces} faces), not of shape {array.shape}")
    unit = _unit_colors(array)
    if not ((unit >= 0) & (unit <= 1)).all():
        raise GiError("colors must be numbers from 0 to 1 (linear), or whole numbers from 0 to 255 (sRGB)")
    return (unit, None) if len(array) == vertices else (None, unit)


def _unit_colors(array: NDArray[Any]) -> NDArray[np.float64]:
    """Return colours as linear RGBA. Whole numbers are sRGB of 8 or 16 bits, unless all are 0 or 1."""
    if array.dtype.kind == "f" or array.dtype in (np.uint8, np.uint16):
        return linear_rgba(array)
    if array.size and array.min() >= 0 and array.max() <= 1:
        return linear_rgba(array.astype(np.float64))
    if array.size and array.min() >= 0 and array.max() <= 255:
        return linear_rgba(array.astype(np.uint8))
    return np.full((len(array), 4), np.nan)
