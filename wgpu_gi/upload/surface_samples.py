"""Points spread over a scene's surfaces: a cheap stand-in for the geometry where rough distances are enough.

Stratified by triangle, and within triangles by the R2 sequence (Roberts 2018, "The Unreasonable Effectiveness of
Quasirandom Sequences").
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..scene.scene import Instance
from .mesh_data import Placement
from .two_level_bvh import TwoLevelBvh

# Steps of low-discrepancy sequences: multiples modulo 1 of the golden ratio fill the unit interval evenly; those of R2
# (1/g and 1/g^2 with g^3 = g + 1) fill the unit square.
GOLDEN = (5**0.5 - 1) / 2
R2 = np.array([0.7548776662466927, 0.5698402909980532])


class SurfaceSamples:
    """Draws the samples; it keeps the areas of the triangles of instances that do not change."""

    def __init__(self) -> None:
        self._areas: dict[int, tuple[tuple[object, ...], NDArray[np.float64]]] = {}  # by instance, and their inputs

    def draw(self, instances: list[Instance], hierarchy: TwoLevelBvh, count: int = 4096) -> NDArray[np.float64]:
        """Return at most `count` points (n, 3) relative to the scene's origin; the same scene gives the same points.

        Half of the points are distributed by area and half equally over all instances, so that small objects on a large
        ground also get some.
        """
        # Find the areas of the triangles of all instances in the world.
        places = [hierarchy.placement(instance.mesh) for instance in instances]
        matrices = [np.asarray(instance.world_from_local, np.float64) for instance in instances]
        strides = [_stride(place, count) for place in places]
        known, self._areas = self._areas, {}
        for instance, place, matrix, stride in zip(instances, places, matrices, strides, strict=True):
            linear, version = matrix[:3, :3], None if place.figure is None else place.figure.version
            key = (place.data, version, linear.tobytes(), stride)
            before = known.get(id(instance))
            same = before is not None and before[0] == key
            self._areas[id(instance)] = before if same and before else (key, _areas(place, linear, stride))
        areas = [self._areas[id(instance)][1] for instance in instances]
        # Give each triangle its share of the points.
        sums = np.array([float(area.sum()) for area in areas])
        if not sums.any():
            return np.zeros((0, 3))
        weights = 0.5 / sums.sum() + 0.5 / (np.count_nonzero(sums) * np.where(sums > 0, sums, 1.0))
        total = np.cumsum(np.concatenate([np.zeros(1), *(a * w for a, w in zip(areas, weights, strict=True))]))
        chosen = np.searchsorted(total[1:], (np.arange(count) + 0.5) / count * total[-1])
        chosen = np.minimum(chosen, len(total) - 2)
        # Find their corners, part by part; the chosen ascend.
        ends = np.cumsum([len(area) for area in areas])
        part = np.searchsorted(ends, chosen, "right")
        corners = np.empty((count, 3, 3))
        for number in np.unique(part).tolist():
            rows = part == number
            triangles = (chosen[rows] - (ends[number] - len(areas[number]))) * strides[number]
            matrix = matrices[number]
            local = places[number].corners(triangles).astype(np.float64)
            corners[rows] = local @ matrix[:3, :3].T + (matrix[:3, 3] - hierarchy.origin)
        # Place the points, by parallelograms folded to triangles.
        u = np.outer(np.arange(count), R2) % 1.0
        u = np.where(u.sum(1, keepdims=True) > 1, 1 - u, u)
        first = corners[:, 0]
        return first + u[:, :1] * (corners[:, 1] - first) + u[:, 1:] * (corners[:, 2] - first)


def _stride(place: Placement, count: int) -> int:
    """Return n where every n-th triangle represents a large mesh; in leaf order this is a fair choice.

    Fewer triangles represent a figure, because they are posed for it.
    """
    number, most = len(place.data.corners), 4 * count if place.figure is None else count // 2
    return number // (most // 2) if number > most else 1


def _areas(place: Placement, linear: NDArray[np.float64], stride: int) -> NDArray[np.float64]:
    """Return twice the areas that every `stride`-th triangle of an instance stands for, m2."""
    corners = place.corners(slice(None, None, stride)).astype(np.float64) @ linear.T
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    found: NDArray[np.float64] = area * (len(place.data.corners) / len(corners))
    return found
