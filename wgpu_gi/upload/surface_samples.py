"""Points spread over a scene's surfaces: a cheap stand-in for the geometry where rough distances are enough.

Stratified by triangle, and within triangles by the R2 sequence (Roberts 2018, "The Unreasonable Effectiveness of
Quasirandom Sequences").
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..scene.scene import Instance
from .two_level_bvh import TwoLevelBvh

# Steps of low-discrepancy sequences: multiples modulo 1 of the golden ratio fill the unit interval evenly; those of R2
# (1/g and 1/g^2 with g^3 = g + 1) fill the unit square.
GOLDEN = (5**0.5 - 1) / 2
R2 = np.array([0.7548776662466927, 0.5698402909980532])


def sample_surfaces(instances: list[Instance], hierarchy: TwoLevelBvh, count: int = 4096) -> NDArray[np.float64]:
    """Return at most `count` points (n, 3) relative to the scene's origin; the same scene gives the same points.

    Half of the points are distributed by area and half equally over all instances, so that small objects on a large
    ground also get some.
    """
    # Place the triangles of all instances in the world, with their areas.
    areas, parts = [], []
    for instance in instances:
        place = hierarchy.placement(instance.mesh)
        number = len(place.data.corners)
        # Every n-th triangle represents a large mesh; in leaf order this is a fair choice. Figures are posed for it.
        most = 4 * count if place.figure is None else count // 2
        corners: NDArray = place.corners(slice(None, None, number // (most // 2) if number > most else 1))
        matrix = np.asarray(instance.world_from_local, np.float64)
        corners = corners.astype(np.float64) @ matrix[:3, :3].T + (matrix[:3, 3] - hierarchy.origin)
        area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        parts.append(corners)
        areas.append(area * (number / len(corners)))
    # Give each triangle its share of the points.
    sums = np.array([float(area.sum()) for area in areas])
    if not sums.any():
        return np.zeros((0, 3))
    weights = 0.5 / sums.sum() + 0.5 / (np.count_nonzero(sums) * np.where(sums > 0, sums, 1.0))
    total = np.cumsum(np.concatenate([np.zeros(1), *(a * w for a, w in zip(areas, weights, strict=True))]))
    chosen = np.searchsorted(total[1:], (np.arange(count) + 0.5) / count * total[-1])
    # Place the points, by parallelograms folded to triangles.
    u = np.outer(np.arange(count), R2) % 1.0
    folded = np.where(u.sum(1, keepdims=True) > 1, 1 - u, u)
    corner = np.concatenate(parts)[np.minimum(chosen, len(total) - 2)]
    return corner[:, 0] + folded[:, :1] * (corner[:, 1] - corner[:, 0]) + folded[:, 1:] * (corner[:, 2] - corner[:, 0])
