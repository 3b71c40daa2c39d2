"""Sorts the wide nodes that the device has built into trees, breadth-first in each."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .bvh import LEAF_FLAG
from .wide_bvh import EMPTY, FIRST_ITEM, WideBvh

# A child of a node, as `Child` of wgsl/scene/hierarchy/emit.wgsl.
NODE = np.dtype([("low", np.float32, 3), ("child", np.uint32), ("high", np.float32, 3), ("pad", np.uint32)])


def split_trees(
    records: NDArray[np.void], order: NDArray[np.int64], counts: NDArray[np.int64], scale: NDArray[np.float64]
) -> list[WideBvh]:
    """Return the hierarchies of trees of `counts` consecutive triangles; `records` (n, 4) are the nodes of all.

    References count from the first node and the first leaf slot of all; `order` has the triangle of each slot. Boxes
    are in units of which `scale` (trees,) make a metre.
    """
    child = records["child"].astype(np.int64)
    inner = child < int(LEAF_FLAG)
    firsts = np.cumsum(counts) - counts
    # Find the roots, which are no node's child, and their trees, by the first triangle below.
    is_root = np.ones(len(child), np.bool_)
    is_root[child[inner]] = False
    frontier = np.flatnonzero(is_root)
    below = frontier
    while inner[below, 0].any():
        below = np.where(inner[below, 0], child[below, 0] % max(len(child), 1), below)
    tree = np.searchsorted(firsts, child[below, 0] & FIRST_ITEM, "right") - 1
    # List the nodes of all trees level by level.
    nodes, trees, levels = [frontier], [tree], [np.zeros(len(frontier), np.int64)]
    while len(frontier):
        takes = inner[frontier]
        tree, frontier = np.repeat(tree, takes.sum(1)), child[frontier][takes]
        nodes.append(frontier)
        trees.append(tree)
        levels.append(np.full(len(frontier), len(levels)))
    # Sort them by tree.
    tree, level = np.concatenate(trees), np.concatenate(levels)
    by_tree = np.argsort(tree, kind="stable")
    listed, level = np.concatenate(nodes)[by_tree], level[by_tree]
    ends = np.cumsum(np.bincount(tree, minlength=len(counts)))
    result = []
    for number, (begin, end) in enumerate(zip(np.append(0, ends[:-1]), ends, strict=True)):
        first, count = int(firsts[number]), int(counts[number])
        level_ends = [0, *np.cumsum(np.bincount(level[begin:end])).tolist()]
        own_order = order[first : first + count] - first
        result.append(_tree(records[listed[begin:end]], own_order, first, level_ends, 1 / scale[number]))
    return result


def boxes_of(
    records: NDArray[np.void], child: NDArray[np.uint32], unit: float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the boxes of all children in metres, (n, 4, 3) each; records are in `unit`, metres, a power of two."""
    exists = (child != EMPTY)[..., None]
    low, high = records["low"] * np.float32(unit), records["high"] * np.float32(unit)
    return np.where(exists, low, np.float32(np.inf)), np.where(exists, high, np.float32(-np.inf))


def _tree(records: NDArray[np.void], order: NDArray[np.int64], first: int, levels: list[int], unit: float) -> WideBvh:
    """Return the hierarchy of a tree from its nodes, breadth-first; its triangles have the slots from `first` on."""
    child = records["child"].copy()
    # In turn, the inner children are the second, third, ... node.
    inner = child < LEAF_FLAG
    child[inner] = 1 + np.arange(inner.sum())
    child[(child >= LEAF_FLAG) & (child != EMPTY)] -= np.uint32(first)
    low, high = boxes_of(records, child, unit)
    return WideBvh(low, high, child, order, levels)
