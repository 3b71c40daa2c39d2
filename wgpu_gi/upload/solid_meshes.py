"""Finds the meshes for solid voxelisation: watertight, and thick enough to survive the voxel grid.

Solid voxelisation by parity needs watertight meshes (Eisemann and Decoret 2008; Soler 2010, section 5.3). Of other
meshes, only the surface is voxelised.
"""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from ..scene.scene import Mesh
from .mesh_data import MASKED, Placement, Topology

CHOICES = ("auto", "all", "none")
# The mean thickness of a solid over the diagonal of its box. Thinner meshes, such as cloth, fall between the voxels'
# centres and would not occlude at all. In Sponza thin meshes have up to 0.016, columns and pots 0.05 and more.
MIN_THICKNESS = 0.025


def is_watertight(mesh: Mesh) -> bool:
    """Tell whether every edge belongs to an even number of triangles, after merging corners at the same position.

    Then any line crosses the mesh an even number of times, as parity requires.
    """
    # Number the distinct positions.
    positions = np.ascontiguousarray(mesh.positions, np.float32) + np.float32(0)  # -0 is 0
    _, place = np.unique(positions.view(np.dtype((np.void, 12))).ravel(), return_inverse=True)
    corners = place.ravel()[np.asarray(mesh.triangles, np.int64)]
    # Count the triangles of each edge.
    edges = np.sort(np.stack([corners, np.roll(corners, -1, 1)], -1).reshape(-1, 2), 1)
    # A triangle with two corners at one position has an edge of length zero, and its other edge twice.
    edges = edges[edges[:, 0] != edges[:, 1]]
    _, count = np.unique(edges[:, 0] * np.int64(len(positions)) + edges[:, 1], return_counts=True)
    return not (count % 2).any()


def is_thick(mesh: Mesh) -> bool:
    """Tell whether a watertight mesh is thick for its size; its mean thickness is twice its volume over its area."""
    positions = np.asarray(mesh.positions, np.float64)
    box = np.ptp(positions, 0)
    a, b, c = np.moveaxis((positions - positions.mean(0))[np.asarray(mesh.triangles, np.int64)], 1, 0)
    normals = np.cross(b - a, c - a)  # their length is twice the area
    volume = abs((a * normals).sum()) / 6
    return bool(2 * volume > MIN_THICKNESS * np.linalg.norm(box) * np.linalg.norm(normals, axis=1).sum() / 2)


class SolidMeshes:
    """Tests each mesh once, also if it is deformed.

    `bits` has a bit for each triangle of the scene, in words of 32: 1 if it bounds a solid.
    """

    def __init__(self) -> None:
        self._known: WeakKeyDictionary[Topology, bool] = WeakKeyDictionary()
        self.bits: NDArray[np.uint32] = np.zeros(1, np.uint32)
        self.has_solids = self.has_shells = False

    def update(self, places: list[Placement], triangles: NDArray[np.void], choice: str) -> None:
        """Update `bits` to the scene's `triangles`, whose meshes lie at `places`.

        `choice` is one of CHOICES: "all" and "none" override the tests. A mesh with an alpha mask is never a solid.
        """
        solid = np.zeros(len(triangles), bool)
        for place in places:
            mesh, topology = place.data.mesh, place.data.topology
            if choice == "auto" and topology not in self._known:
                self._known[topology] = is_watertight(mesh) and is_thick(mesh)
            masked = (triangles["flags"][place.triangles] & MASKED).any()
            solid[place.triangles] = not masked and (self._known[topology] if choice == "auto" else choice == "all")
        self.has_solids, self.has_shells = bool(solid.any()), not solid.all()
        packed = np.packbits(solid, bitorder="little")
        self.bits = np.zeros(max(-(-len(solid) // 32), 1), np.uint32)
        self.bits.view(np.uint8)[: len(packed)] = packed
