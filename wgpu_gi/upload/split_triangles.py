"""Splits large triangles for rasterisation, where a scene's details lie together on a large ground.

Rasterisers clip in float32: where a triangle of 1e6 m leaves the picture, it ends 0.1 m too early, and pixels at the
picture's edge show no surface. An edge is halved if it is longer than REACH times its distance from the origin. That
depends on the edge alone, so neighbours split their common edge alike, and no gaps open.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

REACH = 2.0  # the longest edge of a triangle around the origin is less than its half away: such triangles are split
# Edges shorter than this share of the scene are not split: 12 halvings, about 150 triangles for one at the origin.
SHORTEST = 2.0**-12


def split_triangles(
    corners: NDArray[np.float64], extent: float
) -> tuple[NDArray[np.bool_], NDArray[np.float64], NDArray[np.int64]]:
    """Return which triangles (n, 3, 3) are split, (n,), the pieces (k, 3, 3), and the triangles they are of, (k,).

    Corners are relative to the origin; extent: of the scene, metres.
    """
    is_split = np.asarray(_long_edges(corners, extent).any(1))
    owner = np.flatnonzero(is_split)
    open_, pieces, owners = corners[owner], [np.zeros((0, 3, 3))], [np.zeros(0, np.int64)]
    while len(open_):
        long = _long_edges(open_, extent)
        done = ~long.any(1)
        pieces.append(open_[done])
        owners.append(owner[done])
        open_, owner, long = open_[~done], owner[~done], long[~done]
        # Halve the longest of the long edges, between corners a and b.
        length = np.linalg.norm(open_[:, [1, 2, 0]] - open_, axis=2) * long
        a = length.argmax(1)
        rows, b, c = np.arange(len(open_)), (a + 1) % 3, (a + 2) % 3
        middle = (open_[rows, a] + open_[rows, b]) / 2
        first = np.stack([open_[rows, a], middle, open_[rows, c]], 1)
        second = np.stack([middle, open_[rows, b], open_[rows, c]], 1)
        open_, owner = np.concatenate([first, second]), np.tile(owner, 2)
    return is_split, np.concatenate(pieces), np.concatenate(owners)


def _long_edges(corners: NDArray[np.float64], extent: float) -> NDArray[np.bool_]:
    """Tell which edges (n, 3) are long, the first from corner 0 to corner 1."""
    edge = corners[:, [1, 2, 0]] - corners
    squared = np.maximum((edge**2).sum(2), 1e-300)
    # The nearest point to the origin; measured from the middle, so that both directions round alike.
    middle = (corners[:, [1, 2, 0]] + corners) / 2
    t = np.clip(-(middle * edge).sum(2) / squared, -0.5, 0.5)
    distance = np.linalg.norm(middle + t[..., None] * edge, axis=2)
    long: NDArray[np.bool_] = np.sqrt(squared) > np.maximum(REACH * distance, SHORTEST * extent)
    return long
