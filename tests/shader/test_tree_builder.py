"""Hierarchies that the device builds: their leaves, boxes, depth and cost, determinism, scale, and refitting."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.scene_dtypes import DTYPES
from helpers.soups import SOUPS, boxes, soup
from helpers.wide_trees import walk

from wgpu_gi.gpu.device import open_device
from wgpu_gi.scene.scene import Material, Mesh
from wgpu_gi.upload import mesh_trees
from wgpu_gi.upload.bvh import build_bvh
from wgpu_gi.upload.mesh_data import prepare_meshes
from wgpu_gi.upload.mesh_trees import tree_cost
from wgpu_gi.upload.tree_builder import NODE_BYTES, VERTEX_BYTES, TreeBuilder
from wgpu_gi.upload.wide_bvh import collapse

DEEPEST = 14  # WIDE_LEVELS of wgsl/scene/hierarchy/clusters.wgsl


@pytest.fixture(scope="module")
def builder():
    return TreeBuilder(open_device(large_buffers=True))


def arrays(corners):
    """Positions and triangles of triangles (n, 3, 3) that share no vertices."""
    return corners.reshape(-1, 3), np.arange(3 * len(corners), dtype=np.uint32).reshape(-1, 3)


def check(tree, corners):
    """Every triangle is in one leaf, and every box is exactly that of what it holds."""
    low, high = boxes(corners)
    leaves, depth = walk(tree, low[tree.order], high[tree.order])
    assert sorted(tree.order) == list(range(len(corners)))
    assert sorted(slot for leaf in leaves for slot in leaf) == list(range(len(corners)))
    assert max(map(len, leaves)) <= 4 and tree.depth == depth <= DEEPEST


def terrain(side, height=0.1, bend=0.0):
    """A grid of hills, (2 side^2, 3, 3); `bend` makes its cells grow exponentially from one end to the other."""
    x, y = np.meshgrid(np.arange(side + 1) / side, np.arange(side + 1) / side, indexing="ij")
    points = np.stack([x, height * np.sin(9 * x) * np.cos(7 * y), y], -1) * np.exp2(bend * x)[..., None]
    a, b, c, d = points[:-1, :-1], points[1:, :-1], points[:-1, 1:], points[1:, 1:]
    return np.stack([np.stack([a, b, c], 2), np.stack([b, d, c], 2)]).reshape(-1, 3, 3).astype(np.float32)


@pytest.mark.parametrize("kind", SOUPS)
def test_every_triangle_is_in_one_leaf_inside_its_boxes(builder, kind):
    for count in (1, 2, 5, 33, 2000):
        corners = SOUPS[kind](count)
        (tree,) = builder.build([arrays(corners)])
        check(tree, corners)


def test_trees_built_together_hold_their_own_triangles(builder):
    parts = [SOUPS[kind](count) for count in (300, 1, 40, 7) for kind in SOUPS]
    for tree, corners in zip(builder.build([arrays(p) for p in parts]), parts, strict=True):
        check(tree, corners)


@pytest.mark.parametrize(
    "corners",
    [
        terrain(60),
        terrain(60, 0.0),
        terrain(60, bend=20.0),
        soup(6000, size=0.01),
    ],
    ids=["hills", "flat", "growing", "soup"],
)
def test_trees_cost_little_more_than_those_of_binned_splits(builder, corners):
    """By the surface area heuristic. Ratios when written: 1.07, 1.09, 1.01 and 1.05."""
    (tree,) = builder.build([arrays(corners)])
    assert tree_cost(tree) < 1.1 * tree_cost(collapse(build_bvh(*boxes(corners))))


def test_equal_triangles_make_a_balanced_tree(builder):
    """All distances tie; 4^8 leaves of four hold 262,144."""
    corners = np.repeat(soup(1), 50_000, 0)
    (tree,) = builder.build([arrays(corners)])
    assert tree.depth <= 9


def test_building_is_deterministic(builder):
    corners = np.concatenate([soup(5000, size=0.02), np.repeat(soup(1), 500, 0)])
    first, second = (builder.build([arrays(corners)])[0] for _ in range(2))
    assert np.array_equal(first.order, second.order) and first.child.tobytes() == second.child.tobytes()
    assert first.low.tobytes() == second.low.tobytes() and first.high.tobytes() == second.high.tobytes()


@pytest.mark.parametrize("exponent", [-60, -1, 40])
def test_a_scaled_mesh_has_the_same_tree(builder, exponent):
    corners = soup(3000, size=0.02)
    scale = np.float32(2.0**exponent)
    (tree,), (scaled,) = (builder.build([arrays(c)]) for c in (corners, corners * scale))
    assert np.array_equal(tree.order, scaled.order) and np.array_equal(tree.child, scaled.child)
    assert np.array_equal(tree.low * scale, scaled.low) and np.array_equal(tree.high * scale, scaled.high)


def test_refitted_boxes_are_those_of_moved_triangles(builder):
    corners = soup(3000, size=0.02)
    (tree,) = builder.build([arrays(corners)])
    moved = (corners @ np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 2]], np.float32)) + soup(3000, seed=4, size=0.0)
    positions, triangles = arrays(moved)
    check(builder.refit(tree, positions, triangles[tree.order]), moved)
    same = builder.refit(tree, arrays(corners)[0], triangles[tree.order])
    assert same.low.tobytes() == tree.low.tobytes() and same.high.tobytes() == tree.high.tobytes()


@pytest.mark.parametrize("on_device", [True, False])
def test_a_deformed_mesh_is_rebuilt_once_its_tree_has_become_expensive(builder, monkeypatch, on_device):
    """It keeps the order of its triangles while refitting is good enough."""
    monkeypatch.setattr("wgpu_gi.upload.tree_builder.SMALLEST", 1)
    corners = terrain(20)
    positions, triangles = arrays(corners)
    used = builder if on_device else None

    def deformed(points):
        return Mesh(points.astype(np.float32), triangles, materials=[Material()])

    (before,) = prepare_meshes([deformed(positions)], DTYPES["vertices"], used)
    wave = positions + 0.02 * np.sin(5 * positions[:, [1, 2, 0]])
    (after,) = prepare_meshes([deformed(wave)], DTYPES["vertices"], used, [before])
    assert np.array_equal(after.bvh.order, before.bvh.order) and after.built_cost == before.built_cost
    check(after.bvh, wave.astype(np.float32)[triangles])
    assert np.array_equal(after.corners, wave.astype(np.float32)[triangles][after.bvh.order])
    # Triangles that change places make all boxes overlap.
    shuffled = corners[np.random.default_rng(0).permutation(len(corners))].reshape(-1, 3)
    (rebuilt,) = prepare_meshes([deformed(shuffled)], DTYPES["vertices"], used, [after])
    assert not np.array_equal(rebuilt.bvh.order, before.bvh.order)
    assert tree_cost(rebuilt.bvh) < mesh_trees.REBUILD * before.built_cost
    check(rebuilt.bvh, shuffled[triangles])


def test_nodes_beyond_the_largest_buffer_come_in_parts(builder, monkeypatch):
    corners = soup(2000, size=0.02)
    (whole,) = builder.build([arrays(corners)])
    monkeypatch.setattr(builder, "limit", 100 * NODE_BYTES)
    (parts,) = builder.build([arrays(corners)])
    assert len(whole.child) > 300
    assert parts.child.tobytes() == whole.child.tobytes() and parts.low.tobytes() == whole.low.tobytes()


def test_vertices_and_nodes_beyond_the_largest_buffer_are_left_to_numpy(builder):
    vertices, nodes = builder.limit // VERTEX_BYTES, builder.limit // NODE_BYTES
    assert builder.fits(100_000, vertices, nodes)
    assert not builder.fits(100_000, vertices + 1) and not builder.fits(100_000, 1, nodes + 1)


def test_triangles_changed_in_place_get_a_new_tree(builder):
    """A new mesh with the same array of triangles, of other vertices, is no deformed one."""
    positions, triangles = arrays(soup(500, size=0.02))
    (before,) = prepare_meshes([Mesh(positions, triangles, materials=[Material()])], DTYPES["vertices"])
    triangles[:] = np.random.default_rng(1).permutation(triangles.ravel()).reshape(-1, 3)
    changed = Mesh(positions, triangles, materials=[Material()])
    (after,) = prepare_meshes([changed], DTYPES["vertices"], None, [before])
    check(after.bvh, positions[triangles])


def test_few_triangles_are_left_to_numpy(builder):
    """And more than the device's buffers hold."""
    assert not builder.suits(1000) and builder.suits(1_000_000) and not builder.suits(builder.largest + 1)
