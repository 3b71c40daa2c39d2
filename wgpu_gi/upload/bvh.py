"""Bounding volume hierarchies by the binned surface area heuristic (SAH), built level by level with numpy.

Wald 2007, "On fast Construction of SAH-based Bounding Volume Hierarchies". Departure: built breadth-first, so that
every step is an array operation over all nodes of a level. It builds the top level and meshes of few triangles
(`mesh_trees`); for the trees that the device builds, it is the reference.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

MAX_BINS = 16  # Wald 2007, section 3
MIN_BINS = 4  # near the leaves, where nodes hold few items; with 16 everywhere 1 M boxes take 11.7 s instead of 7.4
MAX_LEAF = 4  # triangles in a leaf; 8 took longer to trace in Sponza on llvmpipe
NODE_COST = 1.5  # cost of visiting a node, in triangle tests; values from 0.5 to 1.5 made no difference in time
MAX_DEPTH = 26  # inner nodes on the longest path (`wide_bvh.MAX_LEVELS`); scenes of a million triangles need 23

LEAF_FLAG = np.uint32(1 << 31)  # child reference: LEAF_FLAG | (count - 1) << 28 | first item
LEAF_COUNT_SHIFT = 28

# An inner node: the boxes of both children and references to them.
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
    `levels` holds the first node of each level, and the number of nodes at its end. A tree of one leaf has no nodes.
    """

    nodes: NDArray[np.void]
    order: NDArray[np.int64]
    levels: list[int]

    @property
    def depth(self) -> int:
        """Inner nodes on the longest path from the root."""
        return len(self.levels) - 1

    @property
    def root(self) -> int:
        """The child reference of the whole tree."""
        return 0 if len(self.nodes) else int(LEAF_FLAG) | (len(self.order) - 1) << LEAF_COUNT_SHIFT


def build_bvh(
    low: NDArray[np.float32], high: NDArray[np.float32], max_leaf: int = MAX_LEAF, max_depth: int = MAX_DEPTH
) -> Bvh:
    """Build a hierarchy over boxes given by their corners, each (n, 3) float32 and finite, 1 <= n <= 2^max_depth.

    Leaves hold at most `max_leaf` <= 8 items, and no path passes more than `max_depth` inner nodes.
    """
    return build_forest(low, high, [len(low)], max_leaf, max_depth)[0]


def build_forest(
    low: NDArray[np.float32],
    high: NDArray[np.float32],
    counts: Sequence[int],
    max_leaf: int = MAX_LEAF,
    max_depth: int = MAX_DEPTH,
) -> list[Bvh]:
    """Build a hierarchy over each of `counts` consecutive boxes, as `build_bvh` would, all at once.

    Many small hierarchies take the time of one large one.
    """
    items = _Items(np.arange(len(low)), *([*np.ascontiguousarray(c.T, np.float32)] for c in (low, high)))
    order = np.zeros(len(low), np.int64)
    count = np.array(counts)
    start, tree = np.cumsum(count) - count, np.arange(len(count))
    levels: list[_Level] = []
    while len(start):
        # Children must be able to reach leaves of one item by halving within the remaining depth.
        room = 2 ** max(max_depth - len(levels) - 1, 0)
        level = _split_level(items, _Nodes(tree, start, count), max_leaf, room)
        levels.append(level)
        # Give the items of leaves their slots; keep those of inner nodes, which are now grouped by child.
        done = np.repeat(level.leaf, count)
        slots = np.repeat(start - np.cumsum(count) + count, count) + np.arange(len(items.index))
        order[slots[done]] = items.index[done]
        items = items.take(np.flatnonzero(~done))
        # List the children.
        inner, left = ~level.leaf, level.left_count[~level.leaf]
        start = np.stack([start[inner], start[inner] + left], 1).ravel()
        count = np.stack([left, count[inner] - left], 1).ravel()
        tree = np.repeat(tree[inner], 2)
    return _pack(levels, order)


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
    """The nodes of one level, tree by tree: their tree, first item slot and number of items."""

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
    best_cost, below = _best_split(items, first, node_of)

    # Make a small node a leaf where splitting costs more than testing all of its items.
    area = _half_area((node_high - node_low).T)
    leaf = (count == 1) | ((count <= max_leaf) & (NODE_COST * area + best_cost >= count * area))

    # Halve by count where no plane separates (equal centres), or where a child would get more items than it has room.
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


def _best_split(
    items: _Items, first: NDArray[np.int64], node_of: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return the least SAH cost of a split of each node, over all axes, and whether each item lies below that split."""
    nodes = len(first)
    centres = [(lo + hi) * np.float32(0.5) for lo, hi in zip(items.low, items.high, strict=True)]
    bin_count = int(np.clip(len(node_of) // nodes, MIN_BINS, MAX_BINS))
    bins = [_bin(c, first, node_of, bin_count) for c in centres]
    cost, split = np.empty((3, nodes)), np.empty((3, nodes), np.int64)
    for axis in range(3):
        cost[axis], split[axis] = _least_sah(items, bins[axis], node_of, nodes, bin_count)
    axis_of = cost.argmin(0)
    best_cost, best_bin = (np.take_along_axis(each, axis_of[None], 0)[0] for each in (cost, split))
    return best_cost, np.choose(axis_of[node_of], bins) <= best_bin[node_of]


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
    """Return for every node the least SAH cost along one axis and the last bin left of its plane.

    The cost is the sum of area times count over both sides, with half the surface area.
    """
    # Gather counts and boxes by bin; bins vary slowest, so that the sweeps read contiguous memory.
    key = bins * nodes + node_of
    counts = np.bincount(key, minlength=bin_count * nodes).reshape(bin_count, nodes)
    low = np.full((3, bin_count, nodes), np.inf, np.float32)
    high = np.full((3, bin_count, nodes), -np.inf, np.float32)
    for axis in range(3):
        np.minimum.at(low[axis].reshape(-1), key, items.low[axis])
        np.maximum.at(high[axis].reshape(-1), key, items.high[axis])
    # Sweep over the bins from both sides. A plane with an empty side is no split.
    right = _areas_up_to(low[:, ::-1].copy(), high[:, ::-1].copy())[::-1]
    left = _areas_up_to(low, high)
    left_count = np.cumsum(counts, 0)[:-1]
    right_count = counts.sum(0) - left_count
    both = (left_count > 0) & (right_count > 0)
    cost = np.where(both, left_count * left[:-1] + right_count * right[1:], np.inf)
    return cost.min(0), cost.argmin(0)


def _areas_up_to(low: NDArray[np.float32], high: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return half the surface areas, (bins, nodes), of the boxes around the first 1, 2, ... bins of each node.

    `low` and `high` (3, bins, nodes) are the corners of each bin; the call overwrites them with those of the boxes.
    """
    for b in range(1, low.shape[1]):  # several times as fast as ufunc.accumulate
        np.minimum(low[:, b], low[:, b - 1], out=low[:, b])
        np.maximum(high[:, b], high[:, b - 1], out=high[:, b])
    return _half_area(high - low)


def _half_area(size: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return half the surface area of boxes of the given size, (3, ...), in float64 so that no size overflows."""
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

    # Write boxes and references of the children level by level, then sort the nodes by tree.
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

    # Cut nodes and items apart by tree.
    on_level = np.stack([np.bincount(t, minlength=len(roots.count)) for t in inner_trees], 1)
    trees = []
    for t in range(len(roots.count)):
        ends = np.cumsum(on_level[t][on_level[t] > 0]).tolist()
        slots = slice(roots.start[t], roots.start[t] + roots.count[t])
        trees.append(Bvh(nodes[first[t] : first[t] + count[t]], order[slots] - roots.start[t], [0, *ends]))
    return trees
