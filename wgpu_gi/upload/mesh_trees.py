"""Chooses what builds and refits the hierarchies of meshes: the device or, for few triangles, numpy.

A mesh that was deformed keeps its tree, with refitted boxes, until that costs REBUILD times as much as when it was
built: Wald et al. 2007, "Ray Tracing Deformable Scenes Using Dynamic Bounding Volume Hierarchies", section 4.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from ..scene.scene import Mesh
from .bvh import LEAF_FLAG, NODE_COST, build_forest
from .tree_builder import TreeBuilder
from .wide_bvh import EMPTY, WideBvh, collapse, refit

NUMPY_BATCH = 1 << 17  # triangles whose trees numpy builds together; more is not faster and takes more memory
DEVICE_BATCH = 1 << 21  # the same on the device; 600 MB of buffers
REBUILD = 1.3


def build_trees(meshes: Sequence[Mesh], builder: TreeBuilder | None) -> list[WideBvh]:
    """Return the hierarchies of correct meshes with at least one triangle each."""
    counts = [len(mesh.triangles) for mesh in meshes]
    if builder is not None and builder.suits(min(sum(counts), builder.largest)):
        return [tree for batch in _batches(meshes, DEVICE_BATCH) for tree in _on_device(batch, builder)]
    return [tree for batch in _batches(meshes, NUMPY_BATCH) for tree in _by_numpy(batch)]


def refit_tree(
    tree: WideBvh, positions: NDArray[np.float32], triangles: NDArray[np.uint32], builder: TreeBuilder | None
) -> WideBvh:
    """Return `tree` with boxes refitted to moved vertices (v, 3); `triangles` (n, 3) are in leaf order."""
    count = len(triangles)
    if builder is not None and builder.suits(count) and builder.fits(count, len(positions), len(tree.child)):
        return builder.refit(tree, positions, triangles)
    corners = positions[triangles]
    return refit(tree, corners.min(1), corners.max(1))


def tree_cost(tree: WideBvh) -> float:
    """Return the cost of a tree by the surface area heuristic, in tests of triangles by a ray that meets its root."""
    if not len(tree.child):
        return float(len(tree.order))
    exists = (tree.child != EMPTY)[..., None]
    x, y, z = np.moveaxis(np.where(exists, tree.high, 0) - np.where(exists, tree.low, 0), 2, 0).astype(np.float64)
    tests = np.where(tree.child >= LEAF_FLAG, tree.child >> 28 & 7, NODE_COST)
    a, b, c = (tree.high[0].max(0) - tree.low[0].min(0)).astype(np.float64)
    root = max(float(a * b + b * c + c * a), 1e-300)
    return NODE_COST + float(((x * y + y * z + z * x) * tests).sum()) / root


def _batches(meshes: Sequence[Mesh], size: int) -> Iterator[list[Mesh]]:
    """Yield consecutive meshes with up to `size` triangles together, or a larger one alone."""
    batch: list[Mesh] = []
    count = 0
    for mesh in meshes:
        if batch and count + len(mesh.triangles) > size:
            yield batch
            batch, count = [], 0
        batch.append(mesh)
        count += len(mesh.triangles)
    if batch:
        yield batch


def _on_device(meshes: list[Mesh], builder: TreeBuilder) -> list[WideBvh]:
    triangles, vertices = sum(len(m.triangles) for m in meshes), sum(len(m.positions) for m in meshes)
    if not builder.fits(triangles, vertices):
        return _by_numpy(meshes)
    return builder.build([(mesh.positions, mesh.triangles) for mesh in meshes])


def _by_numpy(meshes: list[Mesh]) -> list[WideBvh]:
    corners = [np.asarray(mesh.positions, np.float32)[np.asarray(mesh.triangles)] for mesh in meshes]
    low = np.concatenate([c.min(1) for c in corners])
    high = np.concatenate([c.max(1) for c in corners])
    return [collapse(tree) for tree in build_forest(low, high, [len(c) for c in corners])]
