"""Anchors: the point of a triangle that its record is relative to, so that hits near the origin are exact.

Rounding errors of a ray's hit grow with the distance from the hit to the stored point. Near the origin of the scene,
where its details are, a corner of a large triangle is far away: on a quad of 1e6 m, hits would be off by 0.1 m. So the
record of such a triangle holds its point nearest to the origin instead of its first corner, and that point's
barycentric weights. Weights are multiples of 2^-14, in float32 exact.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FLAG_BITS = 4  # of `Triangle.flags`; the weights of the second and third corner take 14 bits each above them
WEIGHT_BITS = 14
STEPS = 1 << WEIGHT_BITS
# The nearest point replaces the first corner if it is nearer to the origin by this factor: then every point p of a
# triangle has |anchor| <= 2 |p|, which `wgsl/scene/ray_offset.wgsl` relies on.
GAIN = 2.0


def anchor_triangles(triangles: NDArray[np.void], corners: NDArray[np.floating]) -> None:
    """Fill in anchors, edges and the weights in the flags of records for triangles (n, 3, 3) relative to the origin.

    Small triangles get rounded corners, so that neighbours meet; large ones their exact shape around the anchor.
    """
    # Begin with the first corner as the anchor.
    a, b, c = (corners[:, k].astype(np.float32) for k in range(3))
    triangles["anchor"], triangles["edge1"], triangles["edge2"] = a, b - a, c - a
    triangles["flags"] &= (1 << FLAG_BITS) - 1
    # A triangle whose extent is below half its distance from the origin cannot gain enough.
    extent = np.maximum(np.maximum(a, b), c) - np.minimum(np.minimum(a, b), c)
    large = np.flatnonzero(_largest(extent) > _largest(np.abs(a)) / 2)
    exact = corners[large].astype(np.float64)
    weights = np.minimum(np.floor(_nearest_weights(exact) * STEPS), STEPS - 1) / STEPS
    edges = exact[:, 1:] - exact[:, :1]
    nearest = exact[:, 0] + np.einsum("nk,nkc->nc", weights, edges)
    gains = np.linalg.norm(nearest, axis=1) * GAIN < np.linalg.norm(exact[:, 0], axis=1)
    # Replace it where another point is much nearer.
    chosen, codes = large[gains], (weights[gains] * STEPS).astype(np.uint32)
    triangles["anchor"][chosen] = nearest[gains]
    triangles["edge1"][chosen], triangles["edge2"][chosen] = edges[gains, 0], edges[gains, 1]
    triangles["flags"][chosen] |= codes[:, 0] << FLAG_BITS | codes[:, 1] << (FLAG_BITS + WEIGHT_BITS)


def _largest(vectors: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the largest component of each vector (n, 3); several times as fast as `vectors.max(1)`."""
    largest: NDArray[np.float32] = np.maximum(np.maximum(vectors[:, 0], vectors[:, 1]), vectors[:, 2])
    return largest


def _nearest_weights(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the weights (n, 2) of the second and third corner at the point nearest to the origin."""
    first, edge1, edge2 = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]

    def dot(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.einsum("nc,nc->n", a, b)

    def along(start: NDArray[np.float64], edge: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.clip(-dot(start, edge) / np.maximum(dot(edge, edge), 1e-300), 0, 1)

    # Collect the nearest points of the edges and, where it lies inside, of the plane.
    zero = np.zeros(len(corners))
    s, t, r = along(first, edge1), along(first, edge2), along(first + edge1, edge2 - edge1)
    a, b, c = dot(edge1, edge1), dot(edge1, edge2), dot(edge2, edge2)
    d, e = -dot(first, edge1), -dot(first, edge2)
    area = np.maximum(a * c - b * b, 1e-300)
    inside = np.stack([(c * d - b * e) / area, (a * e - b * d) / area], 1)
    outside = (inside < 0).any(1) | (inside.sum(1) > 1) | ~np.isfinite(inside).all(1)
    inside[outside] = 0
    candidates = np.stack([inside, np.stack([s, zero], 1), np.stack([zero, t], 1), np.stack([1 - r, r], 1)], 1)
    points = first[:, None] + candidates[..., :1] * edge1[:, None] + candidates[..., 1:] * edge2[:, None]
    best = np.linalg.norm(points, axis=2).argmin(1)
    weights: NDArray[np.float64] = candidates[np.arange(len(corners)), best]
    return weights
