"""Checks the nodes of trees with four children a node."""

from __future__ import annotations

import numpy as np

from wgpu_gi.upload.wide_bvh import EMPTY

LEAF = 1 << 31


def leaf_slots(reference):
    """The slots of a child reference, or None for an inner node."""
    if not reference & LEAF:
        return None
    first = reference & 0x0FFFFFFF
    return range(first, first + (reference >> 28 & 7))


def walk(bvh, low, high):
    """Check that all boxes are tight; return the slots of all leaves and the depth. `low`, `high` are in leaf order."""
    leaves, deepest = [], 0
    stack = [(bvh.root, None, None, 0)]
    while stack:
        reference, box_low, box_high, above = stack.pop()
        slots = leaf_slots(reference)
        deepest = max(deepest, above)
        if slots is not None:
            leaves.append(slots)
            below_low, below_high = low[slots].min(0), high[slots].max(0)
        else:
            used = bvh.child[reference] != EMPTY
            assert used.sum() >= 2
            below_low, below_high = bvh.low[reference][used].min(0), bvh.high[reference][used].max(0)
            for k in np.flatnonzero(used):
                stack.append((int(bvh.child[reference, k]), bvh.low[reference, k], bvh.high[reference, k], above + 1))
        if box_low is not None:
            assert np.array_equal(box_low, below_low) and np.array_equal(box_high, below_high)
    return leaves, deepest
