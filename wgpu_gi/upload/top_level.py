"""The top level of the two-level hierarchy: a tree over subtrees of baked meshes and over instances.

Benthin et al. 2017, "Improved Two-Level BVHs using Partial Re-Braiding". Departures: only baked meshes are opened, by
surface area, until there are up to OPEN_UP_TO subtrees; `bvh.build_bvh` builds the tree over them.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from ..errors import GiError
from .bvh import LEAF_FLAG, build_bvh
from .mesh_data import Placement
from .mesh_trees import REBUILD, tree_cost
from .node_quantization import QuantizationGrid
from .wide_bvh import EMPTY, FIRST_ITEM, WIDTH, WideBvh, collapse, refit

OPEN_UP_TO = 2048  # subtrees in the top level; tools/README.md, "Constants"

Subtrees = tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.int64]]  # low, high, child references


def open_subtrees(places: Iterable[Placement]) -> Subtrees:
    """Return the subtrees of all baked meshes; those of the largest surface area are opened first."""
    heap: list[tuple[float, int, NDArray, NDArray, int, Placement]] = []
    ties = itertools.count()  # heapq compares tuples; a counter keeps equal areas from comparing arrays

    def add(low: NDArray, high: NDArray, reference: int, place: Placement) -> None:
        x, y, z = np.maximum(high - low, 0).astype(np.float64).tolist()
        # Leaves cannot be opened, so they sort after all inner nodes.
        order = 1.0 if reference >= int(LEAF_FLAG) else -(x * y + y * z + z * x)
        heapq.heappush(heap, (order, next(ties), low, high, reference, place))

    for place in places:
        if place.box is not None:
            add(place.box[0], place.box[1], place.data.bvh.root, place)
    # Replace the largest node by its children until there are enough. A single tree overlaps no other.
    while 1 < len(heap) <= OPEN_UP_TO - WIDTH + 1 and heap[0][0] <= 0:
        *_, reference, place = heapq.heappop(heap)
        tree = place.tree
        assert tree is not None
        for k in np.flatnonzero(tree.child[reference] != EMPTY):
            add(tree.low[reference, k], tree.high[reference, k], int(tree.child[reference, k]), place)
    low = np.array([h[2] for h in heap], np.float32).reshape(-1, 3)
    high = np.array([h[3] for h in heap], np.float32).reshape(-1, 3)
    return low, high, np.array([h[5].reference(h[4]) for h in heap], np.int64)


class TopLevel:
    """The tree over subtrees and instances. It is kept, with refitted boxes, until that costs REBUILD times as much.

    That is the rule of deformed meshes (`mesh_trees`). With `keeps_first`, the first tree is kept even then: the tree
    around given boxes does not depend on those between.
    """

    def __init__(self, keeps_first: bool = False) -> None:
        self._keeps_first = keeps_first
        self._tree: WideBvh | None = None
        self._references: NDArray[np.int64] = np.zeros(0, np.int64)
        self._levels = 0
        self._built_cost = 0.0

    def build(
        self,
        low: NDArray[np.float32],
        high: NDArray[np.float32],
        references: NDArray[np.int64],
        grid: QuantizationGrid,
        dtype: np.dtype,
        max_levels: int,
    ) -> tuple[int, NDArray[np.void]]:
        """Return the root reference and the quantised nodes of a tree whose leaves are `references` in boxes (n, 3).

        The tree has at most `max_levels` levels of nodes. Raises GiError if the references do not fit into them.
        """
        if not len(references):
            return EMPTY, np.zeros(0, dtype)
        if len(references) > WIDTH**max_levels:
            raise GiError(
                f"the scene has {len(references)} instances; with meshes of so many triangles, rays can find at most"
                f" {WIDTH**max_levels}: use fewer instances"
            )
        same = self._levels == max_levels and np.array_equal(references, self._references)
        tree = self._refitted(low, high) if same else None
        if tree is None:
            tree = collapse(build_bvh(low, high, 1, 2 * max_levels), max_levels)
            if not (same and self._keeps_first):
                self._tree, self._references, self._levels = tree, references, max_levels
                self._built_cost = tree_cost(tree)
        references = references[tree.order]
        if not len(tree.child):
            return int(references[0]), np.zeros(0, dtype)
        # Replace each leaf, which holds one item, by that item's reference.
        nodes = grid.quantize(tree, dtype)
        leaf = (tree.child >= LEAF_FLAG) & (tree.child != EMPTY)
        slot = np.where(leaf, tree.child & FIRST_ITEM, 0)
        nodes["children"] = np.where(leaf, references[slot], nodes["children"]).astype(np.uint32)
        return 0, nodes

    def _refitted(self, low: NDArray[np.float32], high: NDArray[np.float32]) -> WideBvh | None:
        """Return the last tree that was built, around boxes that have moved, if it is still good."""
        if self._tree is None:
            return None
        tree = refit(self._tree, low[self._tree.order], high[self._tree.order])
        return tree if tree_cost(tree) <= REBUILD * self._built_cost else None
