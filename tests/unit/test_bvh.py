"""BVHs against brute force: their items and boxes, their depth, and the hits of rays."""

from __future__ import annotations

import time

import numpy as np
import pytest
from helpers.soups import SIZES, SOUPS, boxes, soup

from wgpu_gi.upload.bvh import LEAF_COUNT_SHIFT, LEAF_FLAG, MAX_DEPTH, build_bvh, build_forest


def leaf_slots(reference):
    """The slots of a child reference, or None for an inner node."""
    if reference < int(LEAF_FLAG):
        return None
    first = reference & ((1 << LEAF_COUNT_SHIFT) - 1)
    return range(first, first + (reference >> LEAF_COUNT_SHIFT & 7) + 1)


def walk(bvh, nodes, low, high):
    """Check that all boxes are tight; return the slots of all leaves and the depth.

    `low` and `high` are the boxes in leaf order.
    """
    leaves, deepest = [], 0
    stack = [(bvh.root, None, None, 0)]
    while stack:
        reference, box_low, box_high, above = stack.pop()
        slots = leaf_slots(reference)
        if slots is not None:
            leaves.append(slots)
            deepest = max(deepest, above)
            below_low, below_high = low[slots].min(0), high[slots].max(0)
        else:
            node = nodes[reference]
            below_low = np.minimum(node["low0"], node["low1"])
            below_high = np.maximum(node["high0"], node["high1"])
            stack += [(int(node[f"child{k}"]), node[f"low{k}"], node[f"high{k}"], above + 1) for k in (0, 1)]
        if box_low is not None:
            assert np.array_equal(box_low, below_low) and np.array_equal(box_high, below_high)
    return leaves, deepest


@pytest.mark.parametrize("count", SIZES)
@pytest.mark.parametrize("kind", SOUPS)
def test_every_item_is_in_one_leaf_inside_its_boxes(kind, count):
    low, high = boxes(SOUPS[kind](count))
    for max_leaf in (1, 4, 8):
        bvh = build_bvh(low, high, max_leaf)
        leaves, depth = walk(bvh, bvh.nodes, low[bvh.order], high[bvh.order])
        assert sorted(slot for leaf in leaves for slot in leaf) == list(range(count))
        assert sorted(bvh.order) == list(range(count))
        assert max(map(len, leaves)) <= max_leaf
        assert bvh.depth == depth and bvh.levels[-1] == len(bvh.nodes) == len(leaves) - 1


@pytest.mark.parametrize("kind", SOUPS)
def test_depth_is_bounded(kind):
    """The bound holds even where only halving by count can keep it."""
    low, high = boxes(SOUPS[kind](1000))
    assert build_bvh(low, high).depth <= MAX_DEPTH
    for max_depth in (10, 11, 14):
        bvh = build_bvh(low, high, 1, max_depth)
        leaves, depth = walk(bvh, bvh.nodes, low[bvh.order], high[bvh.order])
        assert depth <= max_depth and sum(map(len, leaves)) == 1000


def test_depth_is_bounded_if_planes_cut_off_single_items():
    """Each box is twice as large as the one before; by area alone, the tree would become a list."""
    size = 2.0 ** np.arange(-120, 120)
    low = np.stack([size, 0 * size, 0 * size], 1).astype(np.float32)
    bvh = build_bvh(low, low + np.float32(1e-3) * low, 1, 12)
    assert bvh.depth <= 12
    assert build_bvh(low, low + np.float32(1e-3) * low, 1).depth <= MAX_DEPTH


def test_splits_reduce_the_sah_cost():
    """The root separates distant clusters, and a tree over a soup costs a fraction of testing every triangle."""
    clusters = np.concatenate([soup(50, 0, 0.01), soup(200, 1, 0.01) + np.float32(100)])
    bvh = build_bvh(*boxes(clusters))
    root = bvh.nodes[0]
    assert min(root["low0"].min(), root["low1"].min()) < 2 < 98 < max(root["low0"].min(), root["low1"].min())
    low, high = boxes(soup(4000, size=0.01))
    bvh = build_bvh(low, high)

    def half_area(a, b):
        x, y, z = (b - a).T.astype(np.float64)
        return x * y + y * z + z * x

    whole = half_area(low.min(0)[None], high.max(0)[None])[0]
    visits = sum(half_area(bvh.nodes[f"low{k}"], bvh.nodes[f"high{k}"]).sum() for k in (0, 1)) / whole
    assert visits < 200  # nodes that a random line meets; 76 when written


def hit_distance(triangles, origin, direction):
    """Distances along one ray to (n, 3, 3) triangles, inf where it misses (Moeller and Trumbore 1997)."""
    a, u, v = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        p = np.cross(direction, v)
        inverse = 1 / (u * p).sum(1)
        s = origin - a
        q = np.cross(s, u)
        bu, bv, t = (s * p).sum(1) * inverse, (q * direction).sum(1) * inverse, (q * v).sum(1) * inverse
        return np.where((bu >= 0) & (bv >= 0) & (bu + bv <= 1) & (t > 0), t, np.inf)


def trace(bvh, triangles, origin, direction):
    """Return a ray's first hit in the tree, and the number of triangles tested; `triangles` are in leaf order."""
    with np.errstate(divide="ignore"):
        inverse = 1 / direction
    nearest, tested, stack = np.inf, 0, [bvh.root]
    while stack:
        reference = stack.pop()
        slots = leaf_slots(reference)
        if slots is not None:
            nearest = min(nearest, hit_distance(triangles[slots], origin, direction).min())
            tested += len(slots)
            continue
        node = bvh.nodes[reference]
        for k in (0, 1):
            with np.errstate(invalid="ignore"):
                a, b = (node[f"low{k}"] - origin) * inverse, (node[f"high{k}"] - origin) * inverse
            # A ray in the plane of a slab gives 0 * inf, which is no bound.
            enter, leave = np.fmax.reduce(np.fmin(a, b)), np.fmin.reduce(np.fmax(a, b))
            if max(enter, 0) <= leave * (1 + 1e-12) and enter <= nearest:
                stack.append(int(node[f"child{k}"]))
    return nearest, tested


@pytest.mark.parametrize("count", SIZES)
@pytest.mark.parametrize("kind", SOUPS)
def test_rays_find_what_brute_force_finds(kind, count):
    corners = SOUPS[kind](count)
    bvh = build_bvh(*boxes(corners))
    triangles = corners[bvh.order].astype(np.float64)
    rng = np.random.default_rng(count)
    low, extent = triangles.min((0, 1)), np.ptp(triangles, (0, 1)) + 1e-30
    hits = 0
    for ray in range(16):
        origin = low + extent * rng.uniform(-0.5, 1.5, 3)
        # Most rays aim at a point of a triangle; every fourth runs along an axis.
        direction = rng.dirichlet((1, 1, 1)) @ triangles[rng.integers(count)] - origin
        if ray % 4 == 0:
            axis = rng.integers(3)
            origin, direction = origin + direction, np.eye(3)[axis] * extent.max()
            origin -= 3 * direction
        found, _ = trace(bvh, triangles, origin, direction)
        expected = hit_distance(triangles, origin, direction).min()
        assert np.isclose(found, expected, rtol=1e-12, atol=0)  # of two as near, either may be found
        hits += np.isfinite(expected)
    assert hits >= 8 or kind in ("points", "flat") or count == 1


def test_rays_test_few_triangles():
    corners = soup(3000, size=0.01)
    bvh = build_bvh(*boxes(corners))
    triangles = corners[bvh.order].astype(np.float64)
    rng = np.random.default_rng(0)
    tested = [trace(bvh, triangles, rng.random(3), rng.normal(size=3))[1] for _ in range(50)]
    assert np.mean(tested) < 100


def test_building_is_deterministic():
    low, high = boxes(soup(500))
    first, second = build_bvh(low, high), build_bvh(low.astype(np.float64), high)
    assert first.nodes.tobytes() == second.nodes.tobytes() and np.array_equal(first.order, second.order)


def test_a_forest_equals_trees_built_one_by_one():
    corners = [SOUPS[kind](count) for count in (5, 1, 120, 2) for kind in SOUPS]
    low, high = boxes(np.concatenate(corners))
    forest = build_forest(low, high, [len(c) for c in corners])
    for bvh, each in zip(forest, corners, strict=True):
        low, high = boxes(each)
        leaves, depth = walk(bvh, bvh.nodes, low[bvh.order], high[bvh.order])
        assert sorted(bvh.order) == list(range(len(each))) and bvh.depth == depth
        assert sorted(slot for leaf in leaves for slot in leaf) == list(range(len(each)))
    same = [build_bvh(*boxes(c)) for c in (corners[0], corners[0])]
    twice = build_forest(*boxes(np.concatenate([corners[0], corners[0]])), [5, 5])
    for one, other in zip(same, twice, strict=True):
        assert one.nodes.tobytes() == other.nodes.tobytes() and np.array_equal(one.order, other.order)


@pytest.mark.slow
def test_a_million_triangles(record_property, capsys):
    low, high = boxes(soup(1_000_000, size=0.003))
    started = time.perf_counter()
    bvh = build_bvh(low, high)
    seconds = time.perf_counter() - started
    record_property("seconds", seconds)
    with capsys.disabled():
        print(f"\nhierarchy over a million triangles: {seconds:.1f} s, {bvh.depth} levels, {len(bvh.nodes)} nodes")
    assert np.array_equal(np.bincount(bvh.order), np.ones(len(low)))
