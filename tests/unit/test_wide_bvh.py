"""Trees of four children a node: their leaves, boxes and depth, and the boxes after refitting and quantising."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.scene_dtypes import DTYPES
from helpers.soups import SIZES, SOUPS, boxes, soup
from helpers.wide_trees import LEAF, walk

from wgpu_gi.upload.bvh import build_bvh, build_forest
from wgpu_gi.upload.node_quantization import QuantizationGrid
from wgpu_gi.upload.wide_bvh import EMPTY, collapse, refit


def decoded(records, grid):
    """The boxes of all children as the shader decodes them, (n, 4, 3) each."""
    frame = records["frame"].astype(np.int64)
    origin = np.stack([frame[:, 0] & 0xFFFF, frame[:, 0] >> 16, frame[:, 1] & 0xFFFF], 1)
    shift = np.stack([frame[:, 1] >> s & 15 for s in (16, 20, 24)], 1)
    codes = np.stack([records[axis] for axis in "xyz"], 2).astype(np.int64)  # node, side, axis
    codes = codes[:, None] >> np.array([0, 8, 16, 24])[:, None, None] & 255  # node, child, side, axis
    steps = origin[:, None, None] + (codes << shift[:, None, None])
    boxes = grid.low + steps / grid.scale
    return boxes[:, :, 0], boxes[:, :, 1]


@pytest.mark.parametrize("count", SIZES)
@pytest.mark.parametrize("kind", SOUPS)
def test_every_item_is_in_one_leaf_inside_its_boxes(kind, count):
    low, high = boxes(SOUPS[kind](count))
    binary = build_bvh(low, high)
    bvh = collapse(binary)
    leaves, depth = walk(bvh, low[bvh.order], high[bvh.order])
    assert sorted(slot for leaf in leaves for slot in leaf) == list(range(count))
    assert bvh.depth == depth and bvh.levels[-1] == len(bvh.child)
    # The leaves are those of the binary tree, with about a third of its nodes above them.
    assert len(leaves) == len(binary.nodes) + 1
    if count > 100:
        assert len(bvh.child) < 0.5 * len(binary.nodes)


@pytest.mark.parametrize("kind", SOUPS)
def test_depth_is_at_most_half_of_the_binary_depth(kind):
    """Also where only the tallest children may be replaced; no deeper than asked for."""
    low, high = boxes(SOUPS[kind](1000))
    for max_levels in (5, 6, 7):
        binary = build_bvh(low, high, 1, 2 * max_levels)
        bvh = collapse(binary, max_levels)
        leaves, depth = walk(bvh, low[bvh.order], high[bvh.order])
        assert depth == bvh.depth <= max_levels and sum(map(len, leaves)) == 1000


@pytest.mark.parametrize("count", SIZES)
def test_refitted_boxes_contain_moved_items(count):
    low, high = boxes(soup(count))
    bvh = collapse(build_bvh(low, high))
    same = refit(bvh, low[bvh.order], high[bvh.order])
    assert np.array_equal(same.low, bvh.low) and np.array_equal(same.high, bvh.high)
    low, high = boxes(soup(count, seed=9) * np.float32(3))
    walk(refit(bvh, low[bvh.order], high[bvh.order]), low[bvh.order], high[bvh.order])


def test_refitting_a_forest():
    corners = [SOUPS[kind](count) for count in (5, 1, 120, 2) for kind in SOUPS]
    forest = build_forest(*boxes(np.concatenate(corners)), [len(c) for c in corners])
    for binary, each in zip(forest, corners, strict=True):
        low, high = boxes(each)
        bvh = collapse(binary)
        assert np.array_equal(refit(bvh, low[bvh.order], high[bvh.order]).low, bvh.low)


@pytest.mark.parametrize("kind", SOUPS)
def test_quantised_boxes_contain_the_exact_ones(kind):
    """By at most a code and two grid steps on each side; absent children have boxes that no ray meets."""
    corners = SOUPS[kind](400)
    bvh = collapse(build_bvh(*boxes(corners)))
    grid = QuantizationGrid.around(np.stack([corners.min((0, 1)), corners.max((0, 1))]))
    records = grid.quantize(bvh, DTYPES["nodes"], 1000, 5000)
    low, high = decoded(records, grid)
    used = bvh.child != EMPTY
    exact_low, exact_high = bvh.low[used].astype(np.float64), bvh.high[used].astype(np.float64)
    assert (low[used] <= exact_low).all() and (high[used] >= exact_high).all()
    extent = np.where(used[..., None], bvh.high, -np.inf).max(1) - np.where(used[..., None], bvh.low, np.inf).min(1)
    code = np.maximum(extent.astype(np.float64) / 127, 0)[:, None].repeat(4, 1)[used]
    slack = code + 3 / grid.scale
    assert (exact_low - low[used] <= slack).all() and (high[used] - exact_high <= slack).all()
    assert (low[~used] > high[~used]).all()
    leaf = used & (bvh.child >= LEAF)
    assert (records["children"][leaf] == bvh.child[leaf] + 5000).all()
    assert (records["children"][bvh.child < LEAF] == bvh.child[bvh.child < LEAF] + 1000).all()
    assert (records["children"][~used] == EMPTY).all()
