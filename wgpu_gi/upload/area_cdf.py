"""Cumulative areas of instances and of their meshes' triangles, to sample points uniformly over all surfaces.

A shader picks an instance by its share of the area, then a triangle of its mesh, both by inverting a CDF.
"""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from ..scene.scene import Instance
from .mesh_data import NONE, MeshData
from .two_level_bvh import TwoLevelBvh

Corners = NDArray[np.float32]


class AreaCdf:
    """The CDFs of a scene: `instances`, AreaInstance of many_light/points/sample.wgsl, and `cdf` over triangles.

    `cdf` is indexed like the triangles of the hierarchy and runs from 0 to 1 within each mesh, in its local space.
    Where a transform scales unevenly, the shader weights each point by the ratio of areas. Of a figure, `cdf` has the
    areas of the pose that its hierarchy was built in, and the shader weights each point by the current area.
    """

    def __init__(self, dtype: np.dtype) -> None:
        self._dtype = dtype
        # Caches: each mesh's CDF and local area, and the world area by mesh and linear map.
        self._shares: WeakKeyDictionary[MeshData, tuple[NDArray[np.float32], float]] = WeakKeyDictionary()
        self._areas: dict[tuple[int, bytes], float] = {}
        self.instances: NDArray[np.void] = np.zeros(1, dtype)
        self.cdf: NDArray[np.float32] = np.ones(1, np.float32)
        self.area = 0.0  # area of all instances, m2

    def update(self, instances: list[Instance], hierarchy: TwoLevelBvh) -> None:
        """Update the CDFs; `hierarchy` must be up to date with `instances`."""
        self.cdf = np.ones(len(hierarchy.triangles), np.float32)
        records = np.zeros(max(len(instances), 1), self._dtype)
        areas = np.zeros(len(records))
        known = {}
        for number, instance in enumerate(instances):
            # The CDF of the mesh's triangles.
            place = hierarchy.placement(instance.mesh)
            data, linear = place.data, np.asarray(instance.world_from_local, np.float64)[:3, :3]
            if data not in self._shares:
                of_triangles = _areas(data.corners)
                total = float(of_triangles.sum())
                cumulative = np.cumsum(of_triangles) / max(total, 1e-300)
                self._shares[data] = (cumulative.astype(np.float32), total)
            shares, local_area = self._shares[data]
            self.cdf[place.triangles] = shares
            # The area in the world.
            key = (id(data), linear.tobytes())
            known[key] = areas[number] = self._areas.get(key, -1.0)
            if areas[number] < 0:
                known[key] = areas[number] = _world_area(data.corners, linear, local_area)
            # The record. Baked triangles are stored in world space, so their local area is that in the world.
            record = records[number]
            record["first"], record["count"] = place.triangles.start, len(data.corners)
            record["instance"] = NONE if place.baked is not None else number
            record["local_area"] = areas[number] if place.baked is not None else local_area
            if place.figure is not None:
                record["local_area"] = 0.0
        self._areas = known
        self.area = float(areas.sum())
        records["share"] = areas / max(self.area, 1e-300)
        cumulative = np.cumsum(areas) / max(self.area, 1e-300)
        # Divide by the last value: it is then exactly 1, so no instance without area at the end of the list is chosen.
        records["cumulative"] = cumulative / max(float(cumulative[-1]), 1e-300)
        self.instances = records


def _areas(corners: NDArray) -> NDArray[np.float64]:
    """Return the areas of triangles (n, 3, 3)."""
    edges = corners[:, 1:].astype(np.float64) - corners[:, :1]
    return np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1) / 2


def _world_area(corners: Corners, linear: NDArray[np.float64], local_area: float) -> float:
    """Return the area of a mesh after a linear map, m2."""
    # A map that scales all directions equally scales every area by the same factor.
    squared = linear.T @ linear
    scale = float(np.trace(squared)) / 3
    if np.allclose(squared, scale * np.eye(3), rtol=0, atol=1e-6 * scale):
        return local_area * scale
    return float(_areas(corners @ linear.T).sum())
