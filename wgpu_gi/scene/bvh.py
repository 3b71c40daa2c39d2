"""Bounding volume hierarchies by binned surface-area heuristic, built level by level with numpy.

Wald 2007, "On fast Construction of SAH-based Bounding Volume Hierarchies" (binned splits), made breadth-first so that
every step is an array operation over all nodes of a level.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

MAX_BINS = 16  # Wald 2007, sec. 3: more bins than 16 no longer lower the cost measurably
MIN_BINS = 4  # near the leaves a few items share a node; so many bins are enough and take a quarter of the time
MAX_LEAF = 4  # triangles a leaf may hold; a node costs about as much to visit as one and a half triangles
NODE_COST = 1.5  # cost of visiting a node relative to one triangle, for the decision to stop splitting
MAX_SAH_DEPTH = 20  # deeper levels split by count, which bounds the depth

LEAF_FLAG = np.uint32(1 << 31)  # child reference: LEAF_FLAG | (count - 1) << 28 | first item
LEAF_COUNT_SHIFT = 28

# Two boxes and two child references; upload.py puts the boxes on a 16-bit grid.
NODE_DTYPE = np.dtype(
    [
        ("low0", np.float32, 3),
        ("child0", np.uint32),
        ("high0", np.float32, 3),
        ("child1", np.uint32),
        ("low1", np.float32, 3),
        ("high1", np.float32, 3),
    ]
)


@dataclass
class Bvh:
    """Inner nodes in breadth-first order (root first) and the order of the items that its leaves refer to.

    `order` (n,) gives for each leaf slot the item's index; a leaf holds the slots first .. first + count - 1.
    `levels` holds the first node of each level and, last, the number of nodes. A tree of one leaf has no nodes at all.
    """

    nodes: NDArray[np.void]
    order: NDArray[np.int64]
    levels: list[int]

    @property
    def depth(self) -> int:
        """The number of inner nodes on the longest way down."""
        return len(self.levels) - 1

    @property
    def root(self) -> int:
        """The child reference of the whole tree."""
        return 0 if len(self.nodes) else int(LEAF_FLAG) | (len(self.order) - 1) << LEAF_COUNT_SHIFT


def build_bvh(
    low: NDArray[np.float32], high: NDArray[np.float32], max_leaf: int = MAX_LEAF, max_sah_depth: int = MAX_SAH_DEPTH
) -> Bvh:
    """Build a hierarchy over n >= 1 boxes given by their corners, each (n, 3) float32 and finite.

    Its depth is at most `max_sah_depth` + log2(n) + 1.
    """
    n = len(low)
    items = _Items(np.arange(n), [*np.ascontiguousarray(low.T, np.float32)], [*np.ascontiguousarray(high.T, np.float32)])
    order = np.zeros(n, np.int64)
    start, count = np.array([0]), np.array([n])
    levels: list[_Level] = []
    while len(start):
        level = _split_level(items, start, count, max_leaf, len(levels) >= max_sah_depth)
        levels.append(level)
        # The items of leaves have found their slots; those of inner nodes go on, still grouped by node.
        done = np.repeat(level.leaf, count)
        slots = np.repeat(start - np.cumsum(count) + count, count) + np.arange(len(items.index))
        order[slots[done]] = items.index[done]
        items = items.take(np.flatnonzero(~done))
        inner, left = ~level.leaf, level.left_count[~level.leaf]
        start = np.stack([start[inner], start[inner] + left], 1).ravel()
        count = np.stack([left, count[inner] - left], 1).ravel()
    nodes, firsts = _pack(levels)
    return Bvh(nodes, order, firsts)


@dataclass
class _Items:
    """The items still to be split, grouped by node: original index and box, one array per coordinate."""

    index: NDArray[np.int64]
    low: list[NDArray[np.float32]]
    high: list[NDArray[np.float32]]

    def take(self, rows: NDArray[np.int64]) -> _Items:
        return _Items(self.index[rows], [c[rows] for c in self.low], [c[rows] for c in self.high])


@dataclass
class _Level:
    """The nodes of one level; `left_count` of an inner node goes to its first child."""

    low: NDArray[np.float32]
    high: NDArray[np.float32]
    start: NDArray[np.int64]
    count: NDArray[np.int64]
    leaf: NDArray[np.bool_]
    left_count: NDArray[np.int64]


def _split_level(items: _Items, start: NDArray, count: NDArray, max_leaf: int, by_count: bool) -> _Level:
    """Decide for every node of one level whether it is a leaf; group the items of the others by child, in place."""
    nodes = len(count)
    first = np.cumsum(count) - count
    node_of = np.repeat(np.arange(nodes), count)
    node_low = np.stack([np.minimum.reduceat(c, first) for c in items.low], 1)
    node_high = np.stack([np.maximum.reduceat(c, first) for c in items.high], 1)

    # Find the best plane among those between the bins of the axes tried.
    centres = [(lo + hi) * np.float32(0.5) for lo, hi in zip(items.low, items.high, strict=True)]
    bin_count = int(np.clip(len(node_of) // nodes, MIN_BINS, MAX_BINS))
    bins = [_bin(c, first, node_of, bin_count) for c in centres]
    best_cost = np.full(nodes, np.inf)
    best_axis, best_bin = np.zeros(nodes, np.int64), np.full(nodes, -1)
    for axis in range(3):
        cost, split = _least_sah(items, bins[axis], node_of, nodes, bin_count)
        better = cost < best_cost
        best_cost[better], best_bin[better], best_axis[better] = cost[better], split[better], axis

    # A small node stays whole where splitting costs more than testing all that is in it.
    area = _half_area(node_high - node_low)
    leaf = (count == 1) | ((count <= max_leaf) & (NODE_COST * area + best_cost >= count * area))

    # Halve by count where no plane separates (equal centres), or where the tree is deep enough.
    below = np.choose(best_axis[node_of], bins) <= best_bin[node_of]
    left_count = np.add.reduceat(below.astype(np.int64), first)
    halve = (left_count == 0) | (left_count == count) | by_count
    left_count = np.where(halve, count // 2, left_count)
    rank = np.arange(len(node_of)) - first[node_of]
    below = np.where(halve[node_of], rank < left_count[node_of], below)

    # Move the items below the plane to the front of their node, keeping the order on either side.
    below_before = np.cumsum(below) - below
    below_before -= below_before[first][node_of]
    place = first[node_of] + np.where(below, below_before, left_count[node_of] + rank - below_before)
    source = np.empty_like(place)
    source[place] = np.arange(len(place))
    moved = items.take(source)
    items.index, items.low, items.high = moved.index, moved.low, moved.high
    return _Level(node_low, node_high, start, count, leaf, left_count)


def _bin(
    centres: NDArray[np.float32], first: NDArray[np.int64], node_of: NDArray[np.int64], bin_count: int
) -> NDArray[np.int64]:
    """Return each item's bin 0..bin_count-1 between the least and the greatest centre of its node."""
    low = np.minimum.reduceat(centres, first)
    length = np.maximum.reduceat(centres, first) - low
    # Lengths below the smallest normal number would make the scale infinite.
    scale = np.where(length > 1e-36, bin_count / np.maximum(length, np.float32(1e-36)), 0).astype(np.float32)
    return np.minimum(((centres - low[node_of]) * scale[node_of]).astype(np.int64), bin_count - 1)


def _least_sah(
    items: _Items, bins: NDArray[np.int64], node_of: NDArray[np.int64], nodes: int, bin_count: int
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return for every node the least SAH cost (area times count, both sides) and the last bin of its left side."""
    key = node_of * bin_count + bins
    counts = np.bincount(key, minlength=nodes * bin_count).reshape(nodes, bin_count)
    low, high = np.full((3, nodes * bin_count), np.inf, np.float32), np.full((3, nodes * bin_count), -np.inf, np.float32)
    for axis in range(3):
        np.minimum.at(low[axis], key, items.low[axis])
        np.maximum.at(high[axis], key, items.high[axis])
    low, high = low.reshape(3, nodes, bin_count), high.reshape(3, nodes, bin_count)
    left_size = np.maximum.accumulate(high, 2) - np.minimum.accumulate(low, 2)
    right_size = np.maximum.accumulate(high[..., ::-1], 2) - np.minimum.accumulate(low[..., ::-1], 2)
    left_area = _half_area(np.moveaxis(left_size, 0, -1))[:, :-1]
    right_area = _half_area(np.moveaxis(right_size, 0, -1))[:, -2::-1]
    left = np.cumsum(counts, 1)[:, :-1]
    right = counts.sum(1, keepdims=True) - left
    # Sides without items have infinite boxes of no meaning; no plane may be there.
    cost = np.full((nodes, bin_count - 1), np.inf)
    both = (left > 0) & (right > 0)
    cost[both] = left[both] * left_area[both] + right[both] * right_area[both]
    split = np.argmin(cost, 1)
    return cost[np.arange(nodes), split], split


def _half_area(size: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return half the surface area of boxes of the given (..., 3) size, in float64 so that no size overflows."""
    x, y, z = np.moveaxis(np.maximum(size, 0).astype(np.float64), -1, 0)
    return x * y + y * z + z * x


def _pack(levels: list[_Level]) -> tuple[NDArray[np.void], list[int]]:
    """Turn the levels into inner nodes that hold the boxes of their two children, and the first node of each level."""
    inner_counts = [int((~level.leaf).sum()) for level in levels[:-1]]
    firsts = [0, *np.cumsum(inner_counts).tolist()]
    nodes = np.zeros(firsts[-1], NODE_DTYPE)
    for level, first, last in zip(levels[1:], firsts[:-1], firsts[1:], strict=True):
        # Inner nodes are numbered level by level; a child's number counts the inner nodes before it in its level.
        reference = last + np.cumsum(~level.leaf) - 1
        leaves = int(LEAF_FLAG) | (level.count - 1) << LEAF_COUNT_SHIFT | level.start
        child = np.where(level.leaf, leaves, reference).astype(np.uint32)
        for k in (0, 1):
            nodes[f"low{k}"][first:last] = level.low[k::2]
            nodes[f"high{k}"][first:last] = level.high[k::2]
            nodes[f"child{k}"][first:last] = child[k::2]
    return nodes, firsts
