"""For all mesh readers: tests for degenerate triangles and unused vertices, and normalisation of directions."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

# A triangle is degenerate if its doubled area over its squared longer edge is below this: no ray hits it, and its
# float32 corners do not define which way it faces. Rounding of the float64 products is 1e-16 in this measure.
_MIN_AREA_RATIO = 1e-12

_BLOCK = 1 << 15  # triangles tested at a time, so that the float64 intermediates stay in the cache


def used_vertices(triangles: NDArray[Any], count: int) -> NDArray[np.bool_]:
    """Tell for each of `count` vertices whether a triangle (m, 3) uses it."""
    used = np.zeros(count, np.bool_)
    used[triangles.reshape(-1)] = True
    return used


def has_area(positions: NDArray[np.float32], triangles: NDArray[Any]) -> NDArray[np.bool_]:
    """Tell for each triangle (m, 3) whether its corners span an area; positions (n, 3) must be finite."""
    result = np.empty(len(triangles), np.bool_)
    for start in range(0, len(triangles), _BLOCK):
        corners = triangles[start : start + _BLOCK].T
        a, b, c = (positions[corner].astype(np.float64).T for corner in corners)
        (ux, uy, uz), (vx, vy, vz) = b - a, c - a
        doubled_area_squared = (uy * vz - uz * vy) ** 2 + (uz * vx - ux * vz) ** 2 + (ux * vy - uy * vx) ** 2
        edge_squared = np.maximum(ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz)
        result[start : start + _BLOCK] = doubled_area_squared > (_MIN_AREA_RATIO * edge_squared) ** 2
    return result


def unit_rows(vectors: NDArray[Any]) -> NDArray[np.float32]:
    """Return vectors (n, 3) with unit length as float32; zero rows stay zero. Squares must not overflow float64."""
    x, y, z = vectors.astype(np.float64).T
    length = np.sqrt(x * x + y * y + z * z)
    inverse = 1.0 / np.where(length > 0.0, length, 1.0)
    return np.stack([x * inverse, y * inverse, z * inverse], axis=1).astype(np.float32)
