"""Hierarchies with four children a node, collapsed from binary ones.

Wald et al. 2008, "Getting Rid of Packets", section 3.1: a node takes over the two children of its largest inner child
until it has four. Departure: the tree is at most MAX_LEVELS deep, because the traversal's stack holds an entry per
level; where that is at stake, the child of the tallest subtree is replaced instead. Two replacements by height take two
binary levels off every path, so a binary tree of at most twice that depth always fits.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .bvh import LEAF_COUNT_SHIFT, LEAF_FLAG, Bvh

WIDTH = 4  # children of a node
STACK_LEVELS = 23  # nodes on the longest path through both levels: the traversal's stack less its unused last entry
MAX_LEVELS = 13  # of them in a mesh's tree; the top level takes the others
EMPTY = 1 << 31  # the reference of an absent child: a leaf of no triangles
FIRST_ITEM = (1 << LEAF_COUNT_SHIFT) - 1  # bits of a leaf's first item; above them the number of items, and LEAF_FLAG


@dataclass
class WideBvh:
    """Nodes in breadth-first order, root first, with the boxes `low` and `high`, (n, 4, 3) float32, of their children.

    `child` (n, 4) uint32 holds a node's number, LEAF_FLAG | count << 28 | first slot, or EMPTY, with the box (inf,
    -inf). `order` is as in `Bvh`; `levels` holds the first node of each level, and the number of nodes at its end. A
    tree of one leaf has no nodes.
    """

    low: NDArray[np.float32]
    high: NDArray[np.float32]
    child: NDArray[np.uint32]
    order: NDArray[np.int64]
    levels: list[int]

    @property
    def depth(self) -> int:
        """Nodes on the longest path from the root."""
        return len(self.levels) - 1

    @property
    def root(self) -> int:
        """The child reference of the whole tree."""
        return 0 if len(self.child) else int(LEAF_FLAG) | len(self.order) << LEAF_COUNT_SHIFT


def collapse(bvh: Bvh, max_levels: int = MAX_LEVELS) -> WideBvh:
    """Return the tree of `bvh` with four children a node; `bvh` is at most 2 * max_levels deep."""
    # Children by binary node: reference, box, half surface area, and height of the subtree.
    child = np.stack([bvh.nodes["child0"], bvh.nodes["child1"]], 1).astype(np.int64)
    low = np.stack([bvh.nodes["low0"], bvh.nodes["low1"]], 1)
    high = np.stack([bvh.nodes["high0"], bvh.nodes["high1"]], 1)
    x, y, z = np.moveaxis(np.maximum(high - low, 0).astype(np.float64), 2, 0)
    area = x * y + y * z + z * x
    height = _child_heights(bvh, child)

    # Go down level by level; `entries` number the children of binary nodes, 2 * node + side, and -1 is none.
    nodes = np.arange(min(1, len(bvh.nodes)))
    levels, parts, total = [0], [], 0
    while len(nodes):
        entries = np.full((len(nodes), WIDTH), -1)
        entries[:, :2] = 2 * nodes[:, None] + [0, 1]
        for filled in range(2, WIDTH):
            _open_one(entries, filled, child, area, height, 2 * (max_levels - len(levels)))
        taken = child.ravel()[entries]
        inner = (entries >= 0) & (taken < int(LEAF_FLAG))
        nodes = taken[inner]
        total += len(entries)
        # Number the inner children, who make up the next level.
        taken[inner] = total + np.arange(len(nodes))
        counted = taken + (1 << LEAF_COUNT_SHIFT) * (taken >= int(LEAF_FLAG))
        parts.append((entries, np.where(entries >= 0, counted, EMPTY).astype(np.uint32)))
        levels.append(total)
    if not parts:
        none = np.zeros((0, WIDTH, 3), np.float32)
        return WideBvh(none, none, np.zeros((0, WIDTH), np.uint32), bvh.order, [0])
    entries = np.concatenate([p[0] for p in parts])
    exists = (entries >= 0)[..., None]
    return WideBvh(
        np.where(exists, low.reshape(-1, 3)[entries], np.float32(np.inf)),
        np.where(exists, high.reshape(-1, 3)[entries], np.float32(-np.inf)),
        np.concatenate([p[1] for p in parts]),
        bvh.order,
        levels,
    )


def refit(bvh: WideBvh, low: NDArray[np.float32], high: NDArray[np.float32]) -> WideBvh:
    """Return `bvh` with boxes around moved items, given by the corners of theirs, (n, 3) in leaf order."""
    new_low, new_high = bvh.low.copy(), bvh.high.copy()
    leaf = (bvh.child >= LEAF_FLAG) & (bvh.child != EMPTY)
    start = bvh.child[leaf].astype(np.int64) & FIRST_ITEM
    last = (bvh.child[leaf] >> LEAF_COUNT_SHIFT & 7).astype(np.int64) - 1
    # Read 4 slots of every leaf; those past its end repeat its last item.
    slots = start[:, None] + np.minimum(np.arange(4), last[:, None])
    new_low[leaf], new_high[leaf] = low[slots].min(1), high[slots].max(1)
    # Go up from the last level, so that children are refitted before their parents.
    for first, end in reversed(list(zip(bvh.levels[:-1], bvh.levels[1:], strict=True))):
        inner = bvh.child[first:end] < LEAF_FLAG
        below = bvh.child[first:end][inner]
        new_low[first:end][inner] = new_low[below].min(1)
        new_high[first:end][inner] = new_high[below].max(1)
    return WideBvh(new_low, new_high, bvh.child, bvh.order, bvh.levels)


def _child_heights(bvh: Bvh, child: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the number of inner nodes on the longest path from each child down, (n, 2); 0 for leaves."""
    height = np.zeros(child.shape, np.int64)
    for first, last in reversed(list(zip(bvh.levels[:-1], bvh.levels[1:], strict=True))):
        inner = child[first:last] < int(LEAF_FLAG)
        height[first:last][inner] = 1 + height[child[first:last][inner]].max(1)
    return height


def _open_one(
    entries: NDArray[np.int64],
    filled: int,
    child: NDArray[np.int64],
    area: NDArray[np.float64],
    height: NDArray[np.int64],
    room: int,
) -> None:
    """Replace one inner child in each row of `entries` by its two, in place; `filled` columns are in use.

    No child may be left taller than `room` after the last replacement.
    """
    rows = np.arange(len(entries))
    used = entries[:, :filled]
    opened = (used >= 0) & (child.ravel()[used] < int(LEAF_FLAG))
    tall = height.ravel()[used]
    largest = np.where(opened, area.ravel()[used], -1.0).argmax(1)
    tallest = np.where(opened, tall, -1).argmax(1)
    # By height, the remaining replacements can lower at most so many children of height room + 1 or more.
    chosen = np.where((opened & (tall > room)).any(1), tallest, largest)
    possible = opened[rows, chosen]
    node = child.ravel()[used[rows, chosen]][possible]
    entries[rows[possible], chosen[possible]] = 2 * node
    entries[rows[possible], filled] = 2 * node + 1
