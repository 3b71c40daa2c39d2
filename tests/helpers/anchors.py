"""Reads the anchors of triangle records back."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wgpu_gi.upload.anchors import FLAG_BITS, STEPS, WEIGHT_BITS


def weights_of(flags: NDArray[np.uint32]) -> NDArray[np.float64]:
    """Return the weights (n, 2) of the anchors of triangles with these flags."""
    mask = STEPS - 1
    return np.stack([flags >> FLAG_BITS & mask, flags >> (FLAG_BITS + WEIGHT_BITS)], -1) / STEPS


def corners_of(triangles: NDArray[np.void]) -> NDArray[np.float64]:
    """Return the corners (n, 3, 3) of triangle records."""
    edges = np.stack([triangles["edge1"], triangles["edge2"]], -2).astype(np.float64)
    first = triangles["anchor"] - np.einsum("nk,nkc->nc", weights_of(triangles["flags"]), edges)
    return np.concatenate([first[:, None], first[:, None] + edges], 1)
