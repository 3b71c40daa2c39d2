"""Which triangles bound solids: those of thick meshes without open edges, found once per mesh."""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from ..scene.scene import Mesh
from .mesh_data import MASKED, Placement

CHOICES = ("auto", "all", "none")
# Of its box's diagonal, the mean thickness of a solid: cloth and slabs that are thinner would be lost between the cells
# of a grid, even where they fill the picture. Chosen; in Sponza sheets have at most 0.016, what is round 0.05 and more.
LEAST_THICKNESS = 0.025


def is_watertight(mesh: Mesh) -> bool:
    """Tell whether every edge has an even number of triangles, corners at the same place being the same.

    Then any line meets the mesh an even number of times, which is what parity needs of a solid.
    """
    positions = np.ascontiguousarray(mesh.positions, np.float32) + np.float32(0)  # -0 is 0
    _, place = np.unique(positions.view(np.dtype((np.void, 12))).ravel(), return_inverse=True)
    corners = place.ravel()[np.asarray(mesh.triangles, np.int64)]
    edges = np.sort(np.stack([corners, np.roll(corners, -1, 1)], -1).reshape(-1, 2), 1)
    # A triangle that is only a line has one edge back and forth.
    edges = edges[edges[:, 0] != edges[:, 1]]
    _, count = np.unique(edges[:, 0] * np.int64(len(positions)) + edges[:, 1], return_counts=True)
    return not (count % 2).any()


def is_thick(mesh: Mesh) -> bool:
    """Tell whether a closed mesh is thick for its size: twice its volume over its surface."""
    positions = np.asarray(mesh.positions, np.float64)
    box = np.ptp(positions, 0)
    a, b, c = np.moveaxis((positions - positions.mean(0))[np.asarray(mesh.triangles, np.int64)], 1, 0)
    normals = np.cross(b - a, c - a)  # as long as twice the area
    volume = abs((a * normals).sum()) / 6
    return bool(2 * volume > LEAST_THICKNESS * np.linalg.norm(box) * np.linalg.norm(normals, axis=1).sum() / 2)


class SolidMeshes:
    """Keeps what is known of each mesh; `bits` has one for each triangle of the scene, in words of 32."""

    def __init__(self) -> None:
        self._known: WeakKeyDictionary[Mesh, bool] = WeakKeyDictionary()
        self.bits: NDArray[np.uint32] = np.zeros(1, np.uint32)
        self.has_solids = self.has_shells = False

    def update(self, places: list[Placement], triangles: NDArray[np.void], choice: str) -> None:
        """Find the bits of the scene's `triangles`, which lie as `places` says.

        `choice` is one of CHOICES: "all" and "none" override the tests. A mesh of which parts are cut out is none.
        """
        solid = np.zeros(len(triangles), bool)
        for place in places:
            mesh = place.data.mesh
            if choice == "auto" and mesh not in self._known:
                self._known[mesh] = is_watertight(mesh) and is_thick(mesh)
            cut_out = (triangles["flags"][place.triangles] & MASKED).any()
            solid[place.triangles] = not cut_out and (self._known[mesh] if choice == "auto" else choice == "all")
        self.has_solids, self.has_shells = bool(solid.any()), not solid.all()
        packed = np.packbits(solid, bitorder="little")
        self.bits = np.zeros(max(-(-len(solid) // 32), 1), np.uint32)
        self.bits.view(np.uint8)[: len(packed)] = packed
