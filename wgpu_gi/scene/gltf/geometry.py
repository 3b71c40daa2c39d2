"""Vertex attributes and triangle lists from glTF data, freed of what no renderer can use."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

# Coordinates and matrix entries beyond this are damage, not size: it is a tenth of a light-year in metres.
MAX_COORDINATE = 1e15

_STRIP, _FAN = 5, 6

# A triangle whose doubled area is below this fraction of its longer edge squared is a line: no ray hits it, and its
# float32 coordinates do not say which way it faces. The rounding of the float64 products is 1e-16 in this measure.
_MIN_AREA_RATIO = 1e-12

# Triangles checked at a time, so that the float64 intermediates stay in the cache.
_BLOCK = 1 << 15


def assemble(indices: NDArray[np.uint32], mode: int) -> NDArray[np.uint32]:
    """Return the triangles (m, 3) of a list (4), strip (5) or fan (6); an incomplete one at the end is left out."""
    if len(indices) < 3:
        return np.zeros((0, 3), np.uint32)
    if mode == _STRIP:
        # Every other triangle has its last two corners swapped, so that all wind the same way (glTF 2.0, 3.7.2.1).
        first = np.arange(len(indices) - 2)
        odd = first & 1
        return np.stack([indices[first], indices[first + 1 + odd], indices[first + 2 - odd]], axis=1)
    if mode == _FAN:
        return np.stack([indices[1:-1], indices[2:], np.full_like(indices[2:], indices[0])], axis=1)
    return indices[: len(indices) // 3 * 3].reshape(-1, 3)


def used_vertices(triangles: NDArray[np.uint32], count: int) -> NDArray[np.bool_]:
    """Return for each of `count` vertices whether a triangle uses it."""
    used = np.zeros(count, np.bool_)
    used[triangles.reshape(-1)] = True
    return used


def has_area(positions: NDArray[np.float32], triangles: NDArray[np.uint32]) -> NDArray[np.bool_]:
    """Return for each triangle whether its corners span an area; positions must be finite."""
    result = np.empty(len(triangles), np.bool_)
    for start in range(0, len(triangles), _BLOCK):
        corners = triangles[start : start + _BLOCK].T
        a, b, c = (positions[corner].astype(np.float64).T for corner in corners)
        (ux, uy, uz), (vx, vy, vz) = b - a, c - a
        doubled_area_squared = (uy * vz - uz * vy) ** 2 + (uz * vx - ux * vz) ** 2 + (ux * vy - uy * vx) ** 2
        edge_squared = np.maximum(ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz)
        result[start : start + _BLOCK] = doubled_area_squared > (_MIN_AREA_RATIO * edge_squared) ** 2
    return result


def clean_attribute(name: str, values: NDArray[Any]) -> tuple[NDArray[np.float32], int]:
    """Return a dequantised vertex attribute as a Mesh wants it, and how many rows were not finite.

    Those rows get the value that stands for "none"; positions are passed on as they are. Normals and tangents come
    out with unit length or zero, tangents with w = +-1, colours as four numbers in [0, 1].
    """
    if name == "COLOR_0" and values.dtype.kind != "f":
        # Colours must be normalized; some exporters forget the flag.
        values = values / np.float32(np.iinfo(values.dtype).max)
    floats = values.astype(np.float32, copy=False)
    if name == "POSITION":
        return floats, 0
    finite = np.isfinite(floats).all(axis=1, keepdims=True)
    bad = finite.size - int(np.count_nonzero(finite))
    if bad:
        floats = np.where(finite, floats, np.float32(name == "COLOR_0"))
    if name == "NORMAL":
        floats = unit_rows(floats)
    elif name == "TANGENT":
        floats = np.column_stack([unit_rows(floats[:, :3]), np.where(floats[:, 3] < 0, np.float32(-1), np.float32(1))])
    elif name == "COLOR_0":
        colors = np.ones((len(floats), 4), np.float32)
        colors[:, : floats.shape[1]] = np.clip(floats, 0.0, 1.0)
        floats = colors
    return floats, bad


def unit_rows(vectors: NDArray[Any]) -> NDArray[np.float32]:
    """Return (n, 3) finite vectors with unit length as float32; zero rows stay zero."""
    x, y, z = vectors.astype(np.float64).T
    length = np.sqrt(x * x + y * y + z * z)
    inverse = 1.0 / np.where(length > 0.0, length, 1.0)
    return np.stack([x * inverse, y * inverse, z * inverse], axis=1).astype(np.float32)
