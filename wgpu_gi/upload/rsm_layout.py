"""Divides a budget of texels of reflective shadow maps among punctual lights by their sampling probability."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .light_table import KIND_SUN

MIN_LEVEL, MAX_LEVEL = 1, 8  # log2 of texels a side: 2x2 to 256x256


def rsm_layout(lights: NDArray[np.void], count: int, texels: int, dtype: np.dtype) -> tuple[NDArray[np.void], int]:
    """Return RsmLight records (many_light/rsm/trace.wgsl) for the first lights of a light table, and their texel count.

    Each light gets a square map, a power of two a side, of about its share of `texels`.
    """
    punctual = lights[:count][lights["kind"][:count] <= KIND_SUN]
    records = np.zeros(max(len(punctual), 1), dtype)
    if not len(punctual):
        return records, 0
    share = punctual["probability"].astype(np.float64) / punctual["probability"].sum()
    level = np.clip(np.floor(np.log2(np.sqrt(texels * share)) + 1e-6), MIN_LEVEL, MAX_LEVEL).astype(np.int64)
    sizes = 4**level
    records["level"], records["first"] = level, np.cumsum(sizes) - sizes
    return records, int(sizes.sum())
