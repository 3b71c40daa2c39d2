"""Converts glTF primitives to triangle lists, and vertex attributes to the form of a Mesh."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..mesh_cleaning import unit_rows

_STRIP, _FAN = 5, 6


def assemble(indices: NDArray[np.uint32], mode: int) -> NDArray[np.uint32]:
    """Return the triangles (m, 3) of a list (mode 4), strip (5) or fan (6), without an incomplete last triangle."""
    if len(indices) < 3:
        return np.zeros((0, 3), np.uint32)
    if mode == _STRIP:
        # Swap the last two corners of every other triangle, so that all have the same winding (glTF 2.0, 3.7.2.1).
        first = np.arange(len(indices) - 2)
        odd = first & 1
        return np.stack([indices[first], indices[first + 1 + odd], indices[first + 2 - odd]], axis=1)
    if mode == _FAN:
        return np.stack([indices[1:-1], indices[2:], np.full_like(indices[2:], indices[0])], axis=1)
    return indices[: len(indices) // 3 * 3].reshape(-1, 3)


def as_floats(name: str, values: NDArray[Any]) -> NDArray[np.float32]:
    """Return a dequantised vertex attribute as float32."""
    if name == "COLOR_0" and values.dtype.kind != "f":
        # Colours must be normalized; some exporters forget the flag.
        values = values / np.float32(np.iinfo(values.dtype).max)
    return values.astype(np.float32, copy=False)


def clean_attribute(name: str, values: NDArray[Any]) -> tuple[NDArray[np.float32], int]:
    """Return a dequantised vertex attribute in the form of a Mesh, and how many rows were not finite.

    Those rows become neutral (zeros, white for colours); positions are returned unchanged. Normals and tangents are
    unit vectors or zero, tangents have w = +-1, and colours are four numbers in [0, 1].
    """
    floats = as_floats(name, values)
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
