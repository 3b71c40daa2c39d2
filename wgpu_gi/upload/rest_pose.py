"""The bind pose of a mesh with a skin or morph targets, as arrays for the device, and bounds of any pose of it.

Positions count from the centre of the mesh, and joint matrices are shifted to match: their float32 products round
relative to the size of the mesh, wherever the file's bind pose lies. Influences without weight and displacements of
zero are left out.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..gpu.wgsl.load import load
from ..scene.mesh_check import arrays_of
from ..scene.scene import Mesh

ROUNDING = 2e-6  # of a pose on the device, over its largest term: 32 roundings of 2^-24


class RestPose:
    """What the poses of a correct mesh share; `mesh` must keep its arrays.

    records: RestVertex, Influence and Morph of wgsl/scene/deform/pose.wgsl, by WGSL name. parts: the constants of that
    shader. joints: number of matrices.
    """

    def __init__(self, mesh: Mesh) -> None:
        self.arrays = arrays_of(mesh)
        self.count = len(mesh.positions)
        positions = np.asarray(mesh.positions, np.float64)
        low, high = positions.min(0), positions.max(0)
        self.centre = np.where(np.isfinite(low + high), (low + high) / 2, 0.0)
        self._positions = positions - self.centre
        # Without a skin, all vertices follow one matrix.
        skin = mesh.skin
        self._joints = np.zeros((self.count, 1), np.int64) if skin is None else np.asarray(skin.joints, np.int64)
        self._weights = np.ones((self.count, 1)) if skin is None else np.asarray(skin.weights, np.float64)
        self.joints = int(self._joints.max()) + 1
        self._targets = [_values(t.positions, self.count) for t in mesh.morph_targets]
        self.targets = len(self._targets)
        self.parts = {
            "NORMALS": mesh.normals is not None,
            "TANGENTS": mesh.tangents is not None,
            "MORPHS": self.targets > 0,
        }
        self.records = self._records(mesh)
        self._bound()

    def matrices(self, joint_matrices: NDArray[np.float64] | None) -> NDArray[np.float64]:
        """Return the rows of the matrices (j, 3, 4) that take positions from the centre to the local space."""
        if joint_matrices is None:
            rows = np.tile(np.eye(4)[:3], (self.joints, 1, 1))
        else:
            rows = np.array(joint_matrices[: self.joints, :3], np.float64)
        rows[..., 3] += rows[..., :3] @ self.centre
        return rows

    def weights(self, morph_weights: Sequence[float]) -> NDArray[np.float64]:
        """Return a weight for each morph target, (t,)."""
        return np.append(np.asarray(morph_weights, np.float64), np.zeros(self.targets - len(morph_weights)))

    def positions(
        self, matrices: NDArray[np.float64], weights: NDArray[np.float64], vertices: NDArray[np.integer]
    ) -> NDArray[np.float64]:
        """Return posed positions of some vertices, (..., 3) for indices (...)."""
        used, place = np.unique(vertices, return_inverse=True)
        points = self._positions[used]
        for target in np.flatnonzero(weights):
            points = points + weights[target] * self._targets[target][used]
        blended = np.zeros((len(used), 3, 4))
        for k in range(self._joints.shape[1]):
            blended += self._weights[used, k, None, None] * matrices[self._joints[used, k]]
        posed = np.einsum("nij,nj->ni", blended[..., :3], points) + blended[..., 3]
        found: NDArray[np.float64] = posed[place.reshape(np.shape(vertices))]
        return found

    def box(self, matrices: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a box (2, 3) around a pose, also as the device rounds it.

        A posed vertex is a mean of its joints' images of it, so it lies in the box of what each joint's matrix makes of
        the box of the joint's vertices.
        """
        # Widen the joints' boxes by what their vertices are displaced.
        moves = weights[:, None, None, None] * self._reach
        low = self._low + np.minimum(moves[:, :, 0], moves[:, :, 1]).sum(0)
        high = self._high + np.maximum(moves[:, :, 0], moves[:, :, 1]).sum(0)
        # Arvo 1990, "Transforming Axis-Aligned Bounding Boxes".
        rows = matrices[self._used]
        middle = np.einsum("jab,jb->ja", rows[..., :3], (low + high) / 2) + rows[..., 3]
        reach = np.einsum("jab,jb->ja", np.abs(rows[..., :3]), (high - low) / 2)
        box = np.stack([(middle - reach).min(0), (middle + reach).max(0)])
        # Allow for weights that do not sum to 1, and for rounding.
        largest = np.maximum(np.abs(low), np.abs(high))
        terms = np.einsum("jab,jb->ja", np.abs(rows[..., :3]), largest) + np.abs(rows[..., 3])
        pad = self._excess * np.abs(box).max() + ROUNDING * terms.max()
        return box + np.array([[-pad], [pad]])

    def _bound(self) -> None:
        """Box the vertices of each joint that moves any, and their displacements by each target."""
        weighted = self._weights > 0
        vertices = np.nonzero(weighted)[0]
        joints = self._joints[weighted]
        by_joint = np.argsort(joints, kind="stable")
        self._used, starts = np.unique(joints[by_joint], return_index=True)

        def boxes(values: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
            rows = values[vertices[by_joint]]
            return np.minimum.reduceat(rows, starts), np.maximum.reduceat(rows, starts)

        self._low, self._high = boxes(self._positions)
        reach = [np.stack(boxes(target), 1) for target in self._targets]
        self._reach = np.array(reach).reshape(-1, len(self._used), 2, 3)
        self._excess = float(np.abs(self._weights.sum(1) - 1).max())

    def _records(self, mesh: Mesh) -> dict[str, NDArray[np.void]]:
        """Return the records of the device."""
        shader = load("scene/deform/pose.wgsl")
        weighted = self._weights > 0
        influences = np.zeros(int(weighted.sum()), shader.struct_dtype("Influence"))
        influences["joint"], influences["weight"] = self._joints[weighted], self._weights[weighted]
        # List the displacements of each vertex; without any, one that nothing refers to.
        moves = [
            np.stack([_values(v, self.count) for v in (t.positions, t.normals, t.tangents)], 1)
            for t in mesh.morph_targets
        ]
        moved = [np.flatnonzero((move != 0).any((1, 2))) for move in moves]
        owner = np.concatenate([np.zeros(0, np.int64), *moved])
        rows = np.concatenate([np.zeros((0, 3, 3)), *(m[v] for m, v in zip(moves, moved, strict=True))])
        by_vertex = np.argsort(owner, kind="stable")
        morphs = np.zeros(max(len(owner), 1), shader.struct_dtype("Morph"))
        listed = morphs[: len(owner)]
        listed["number"] = np.repeat(np.arange(len(moved)), [len(v) for v in moved])[by_vertex]
        for k, name in enumerate(("position", "normal", "tangent")):
            listed[name] = rows[by_vertex, k]
        # The record behind the last vertex ends its lists.
        rest = np.zeros(self.count + 1, shader.struct_dtype("RestVertex"))
        rest["position"][:-1] = self._positions
        rest["first_influence"][1:] = np.cumsum(weighted.sum(1))
        rest["first_morph"][1:] = np.cumsum(np.bincount(owner, minlength=self.count))
        if mesh.normals is not None:
            rest["normal"][:-1] = mesh.normals
        if mesh.tangents is not None:
            rest["tangent"][:-1], rest["flipped"][:-1] = mesh.tangents[:, :3], mesh.tangents[:, 3] < 0
        return {"rest": rest, "influences": influences, "morphs": morphs}


def _values(displacements: NDArray[np.float32] | None, count: int) -> NDArray[np.float64]:
    """Return displacements (count, 3), zeros if there are none."""
    return np.zeros((count, 3)) if displacements is None else np.asarray(displacements, np.float64)
