"""Bounding volume hierarchies by binned surface-area heuristic, built level by level with numpy.

Wald 2007, "On fast Construction of SAH-based Bounding Volume Hierarchies" (binned splits), made breadth-first so that
every step is an array operation over all nodes of a level.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

MAX_BINS = 16  # as Wald 2007 uses; not tuned here
MIN_BINS = 4  # near the leaves, where few items share a node; 1 M boxes: 11.7 -> 7.4 s
MAX_LEAF = 4  # triangles a leaf may hold; 8 took longer in Sponza on llvmpipe
NODE_COST = (
    1.5  # of a visit, in triangle tests, to decide when to stop splitting; 0.5 to 1.5 made no difference in time
)
MAX_DEPTH = 40  # inner nodes on any way down; scenes of a million triangles have 23, so that only odd ones meet it

LEAF_FLAG = np.uint32(1 << 31)  # child reference: LEAF_FLAG | (count - 1) << 28 | first item
LEAF_COUNT_SHIFT = 28

# Two boxes and two child references.
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
    low: NDArray[np.float32], high: NDArray[np.float32], max_leaf: int = MAX_LEAF, max_depth: int = MAX_DEPTH
) -> Bvh:
    """Build a hierarchy over boxes given by their corners, each (n, 3) float32 and finite, 1 <= n <= 2^max_depth.

    Leaves hold at most `max_leaf` <= 8 items; no way down passes more than `max_depth` inner nodes.
    """
    return build_forest(low, high, [len(low)], max_leaf, max_depth)[0]


def build_forest(
    low: NDArray[np.float32],
    high: NDArray[np.float32],
    counts: Sequence[int],
    max_leaf: int = MAX_LEAF,
    max_depth: int = MAX_DEPTH,
) -> list[Bvh]:
    """Build a hierarchy over each run of so many boxes, as `build_bvh` would; many small ones take the time of one."""
    items = _Items(np.arange(len(low)), *([*np.ascontiguousarray(c.T, np.float32)] for c in (low, high)))
    order = np.zeros(len(low), np.int64)
    count = np.array(counts)
    start, tree = np.cumsum(count) - count, np.arange(len(count))
    levels: list[_Level] = []
    while len(start):
        # Halving by count brings so many items into leaves of one within the depth that is left for the children.
        room = 2 ** max(max_depth - len(levels) - 1, 0)
        level = _split_level(items, _Nodes(tree, start, count), max_leaf, room)
        levels.append(level)
        # The items of leaves have found their slots; those of inner nodes go on, still grouped by node.
        done = np.repeat(level.leaf, count)
        slots = np.repeat(start - np.cumsum(count) + count, count) + np.arange(len(items.index))
        order[slots[done]] = items.index[done]
        items = items.take(np.flatnonzero(~done))
        inner, left = ~level.leaf, level.left_count[~level.leaf]
        start = np.stack([start[inner], start[inner] + left], 1).ravel()
        count = np.stack([left, count[inner] - left], 1).ravel()
        tree = np.repeat(tree[inner], 2)
    return _pack(levels, order)


def refit(bvh: Bvh, low: NDArray[np.float32], high: NDArray[np.float32]) -> NDArray[np.void]:
    """Return the nodes of `bvh` around items that have moved: the corners of their boxes, (n, 3) in leaf order."""
    nodes = bvh.nodes.copy()
    # Children come after their parents, level by level: go up from the last level.
    for first, last in reversed(list(zip(bvh.levels[:-1], bvh.levels[1:], strict=True))):
        rows = np.arange(first, last)
        for k in ("0", "1"):
            child = nodes["child" + k][rows].astype(np.int64)
            leaf = child >= int(LEAF_FLAG)
            inner, below = rows[~leaf], child[~leaf]
            nodes["low" + k][inner] = np.minimum(nodes["low0"][below], nodes["low1"][below])
            nodes["high" + k][inner] = np.maximum(nodes["high0"][below], nodes["high1"][below])
            start = child[leaf] & ((1 << LEAF_COUNT_SHIFT) - 1)
            extra = (child[leaf] >> LEAF_COUNT_SHIFT) & 7
            # Slots past the end of a leaf repeat its last item.
            slots = start[:, None] + np.minimum(np.arange(8), extra[:, None])
            nodes["low" + k][rows[leaf]] = low[slots].min(1)
            nodes["high" + k][rows[leaf]] = high[slots].max(1)
    return nodes


@dataclass
class _Items:
    """The items still to be split, grouped by node: original index and box, one array per coordinate."""

    index: NDArray[np.int64]
    low: list[NDArray[np.float32]]
    high: list[NDArray[np.float32]]

    def take(self, rows: NDArray[np.int64]) -> _Items:
        return _Items(self.index[rows], [c[rows] for c in self.low], [c[rows] for c in self.high])


@dataclass
class _Nodes:
    """The nodes of one level, tree by tree: which tree, the first of their items' slots, and how many."""

    tree: NDArray[np.int64]
    start: NDArray[np.int64]
    count: NDArray[np.int64]


@dataclass
class _Level:
    """The nodes of one level with their boxes; `left_count` of an inner node goes to its first child."""

    nodes: _Nodes
    low: NDArray[np.float32]
    high: NDArray[np.float32]
    leaf: NDArray[np.bool_]
    left_count: NDArray[np.int64]


def _split_level(items: _Items, level: _Nodes, max_leaf: int, room: int) -> _Level:
    """Decide for every node of one level whether it is a leaf; group the items of the others by child, in place.

    A child may hold at most `room` items.
    """
    count, nodes = level.count, len(level.count)
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
    area = _half_area((node_high - node_low).T)
    leaf = (count == 1) | ((count <= max_leaf) & (NODE_COST * area + best_cost >= count * area))

    # Halve by count where no plane separates (equal centres), or where the plane might leave a child too many items.
    below = np.choose(best_axis[node_of], bins) <= best_bin[node_of]
    left_count = np.add.reduceat(below.astype(np.int64), first)
    halve = (left_count == 0) | (left_count == count) | (np.maximum(left_count, count - left_count) > room)
    left_count = np.where(halve, count // 2, left_count)
    rank = np.arange(len(node_of)) - first[node_of]
    below = np.where(halve[node_of], rank < left_count[node_of], below)

    # Move the items below the plane to the front of their node, keeping the order on either side.
    below_before: NDArray[np.int64] = np.cumsum(below) - below
    below_before -= below_before[first][node_of]
    place = first[node_of] + np.where(below, below_before, left_count[node_of] + rank - below_before)
    source = np.empty_like(place)
    source[place] = np.arange(len(place))
    moved = items.take(source)
    items.index, items.low, items.high = moved.index, moved.low, moved.high
    return _Level(level, node_low, node_high, leaf, left_count)


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
    # Bins come before nodes, so that sweeping over them goes through contiguous memory.
    key = bins * nodes + node_of
    counts = np.bincount(key, minlength=bin_count * nodes).reshape(bin_count, nodes)
    low = np.full((3, bin_count * nodes), np.inf, np.float32)
    high = np.full((3, bin_count * nodes), -np.inf, np.float32)
    for axis in range(3):
        np.minimum.at(low[axis], key, items.low[axis])
        np.maximum.at(high[axis], key, items.high[axis])
    shape = (3, bin_count, nodes)
    left = _areas_up_to(low.reshape(shape), high.reshape(shape))
    right = _areas_up_to(low.reshape(shape)[:, ::-1], high.reshape(shape)[:, ::-1])[::-1]
    left_count = np.cumsum(counts, 0)
    right_count = left_count[-1] - left_count

    best_cost, best_split = np.full(nodes, np.inf), np.zeros(nodes, np.int64)
    for split in range(bin_count - 1):
        # Sides without items have infinite boxes of no meaning; no plane may be there.
        both = (left_count[split] > 0) & (right_count[split] > 0)
        cost = np.where(both, left_count[split] * left[split] + right_count[split] * right[split + 1], np.inf)
        better = cost < best_cost
        best_cost[better], best_split[better] = cost[better], split
    return best_cost, best_split


def _areas_up_to(low: NDArray[np.float32], high: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return half the surface areas, (bins, nodes), of the boxes around the first 1, 2, ... bins."""
    areas = np.zeros(low.shape[1:])
    so_far_low, so_far_high = low[:, 0].copy(), high[:, 0].copy()
    for b in range(low.shape[1]):
        np.minimum(so_far_low, low[:, b], out=so_far_low)
        np.maximum(so_far_high, high[:, b], out=so_far_high)
        areas[b] = _half_area(so_far_high - so_far_low)
    return areas


def _half_area(size: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return half the surface area of boxes of the given (3, n) size, in float64 so that no size overflows."""
    x, y, z = np.maximum(size, 0).astype(np.float64)
    return x * y + y * z + z * x


def _pack(levels: list[_Level], order: NDArray[np.int64]) -> list[Bvh]:
    """Turn the levels of all trees into inner nodes of each, which hold the boxes of their two children."""
    roots = levels[0].nodes
    inner_trees = [level.nodes.tree[~level.leaf] for level in levels]
    tree = np.concatenate(inner_trees)
    # Number the nodes tree by tree, breadth-first in each.
    sequence = np.argsort(tree, kind="stable")
    count = np.bincount(tree, minlength=len(roots.count))
    first = np.cumsum(count) - count
    number = np.empty(len(tree), np.int64)
    number[sequence] = np.arange(len(tree))
    number -= first[tree]

    # Boxes and references of the children, at first level by level.
    nodes = np.zeros(len(tree), NODE_DTYPE)
    level_ends = np.cumsum([len(t) for t in inner_trees]).tolist()
    for level, begin, end, next_end in zip(levels[1:], [0, *level_ends], level_ends, level_ends[1:], strict=False):
        leaf_start = level.nodes.start - roots.start[level.nodes.tree]
        child = int(LEAF_FLAG) | (level.nodes.count - 1) << LEAF_COUNT_SHIFT | leaf_start
        child[~level.leaf] = number[end:next_end]
        for k in (0, 1):
            nodes[f"low{k}"][begin:end] = level.low[k::2]
            nodes[f"high{k}"][begin:end] = level.high[k::2]
            nodes[f"child{k}"][begin:end] = child[k::2]
    nodes = nodes[sequence]

    on_level = np.stack([np.bincount(t, minlength=len(roots.count)) for t in inner_trees], 1)
    trees = []
    for t in range(len(roots.count)):
        ends = np.cumsum(on_level[t][on_level[t] > 0]).tolist()
        slots = slice(roots.start[t], roots.start[t] + roots.count[t])
        trees.append(Bvh(nodes[first[t] : first[t] + count[t]], order[slots] - roots.start[t], [0, *ends]))
    return trees
