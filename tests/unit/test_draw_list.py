"""The draw list: every triangle once, with its own provoking vertex, in clusters that enclose it."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise

import numpy as np
import pytest
from helpers.anchors import corners_of
from helpers.medley import at

from wgpu_gi.scene.built_in.shapes import box, grid, quad, sphere
from wgpu_gi.scene.scene import Instance, Material, Mesh, Scene
from wgpu_gi.upload import draw_list
from wgpu_gi.upload.draw_list import (
    MANY_INSTANCES,
    SMALL_GAP,
    assign_provoking_vertices,
    build_draw_list,
    fill_gaps,
    merge_draw_calls,
)
from wgpu_gi.upload.mesh_data import MASKED, NONE
from wgpu_gi.upload.two_level_bvh import TwoLevelBvh

SLACK = 4e-6  # of the coordinates: how far rounding to float32 may take a triangle out of its box


# ------------------------------------------------------------------------------------------------ First vertices


def check_provoking_vertices(triangles, vertex_count):
    """Assert that each triangle has its own provoking vertex, and the same corners as before, rotated at most."""
    triangles = np.asarray(triangles, np.uint32).reshape(-1, 3)
    raster = assign_provoking_vertices(triangles, vertex_count)
    count = len(triangles)
    assert raster.source.shape == raster.owner.shape and raster.corners.shape == (count, 3)
    assert np.array_equal(raster.source[:vertex_count], np.arange(vertex_count))
    assert np.array_equal(raster.owner[raster.corners[:, 0]], np.arange(count))
    assert (raster.owner >= 0).sum() == count
    meant = raster.source[raster.corners]
    turned = [np.roll(triangles, -k, axis=1) for k in range(3)]
    assert np.any([(meant == t).all(1) for t in turned], axis=0).all()
    return raster


@pytest.mark.parametrize("seed", range(20))
def test_random_triangles(seed):
    rng = np.random.default_rng(seed)
    vertices, count = int(rng.integers(1, 60)), int(rng.integers(0, 120))
    check_provoking_vertices(rng.integers(0, vertices, (count, 3)), vertices)


@pytest.mark.parametrize(
    "triangles",
    [
        [],
        [(0, 0, 0)],
        [(0, 0, 0)] * 5,
        [(0, 1, 2)] * 4,
        [(1, 1, 0), (1, 1, 0), (0, 1, 1)],
        [(0, k + 1, k + 2) for k in range(8)],
    ],
    ids=["none", "point", "points", "the same one", "needles", "fan"],
)
def test_degenerate_triangles(triangles):
    check_provoking_vertices(triangles, 10)


def test_vertices_are_duplicated_only_if_none_is_free():
    soup = check_provoking_vertices(np.arange(300).reshape(-1, 3), 300)
    assert len(soup.source) == 300
    fan = check_provoking_vertices([(0, k + 1, k + 2) for k in range(8)], 10)
    assert len(fan.source) == 10
    ball = sphere(subdivisions=4)
    vertices, triangles = len(ball.positions), len(ball.triangles)
    # There are two triangles for each vertex, so at best every vertex provokes one.
    doubled = len(check_provoking_vertices(ball.triangles, vertices).source) - vertices
    assert triangles - vertices <= doubled <= 1.2 * (triangles - vertices)


# ------------------------------------------------------------------------------------------------ Draw list


def half_masked(mesh):
    """Give every other triangle of a mesh an alpha mask."""
    mesh.materials = [Material("solid"), Material("leaf", alpha_mode="mask")]
    mesh.material_of_triangle = np.arange(len(mesh.triangles), dtype=np.uint32) % 2
    return mesh


def some_instances():
    """Baked, mirrored, partly and fully masked meshes, and meshes with several instances."""
    ball, tuft = sphere(subdivisions=1), half_masked(box((-1, 0, -1), (1, 2, 1)))
    sheet = quad((0, 0, 0), (1, 0, 0), (0, 1, 0), Material("sheet", alpha_mode="mask"))
    return [
        Instance(grid(10.0, 20), at(0, -1)),  # more than one cluster
        Instance(ball, at(-2, 1, 0)),
        Instance(half_masked(sphere(subdivisions=2)), at(1, 2, 3, (-1, 2, 1), 0.4)),
        Instance(ball, at(2, 1, 0, (0.5, -1, 2), 0.3)),
        Instance(sheet, at(0, 0, 4)),
        Instance(tuft, at(5, 0, 0, (1, 1, 1), 1.0)),
        Instance(tuft, at(-5, 0, 0, (-1, 1, 1))),
    ]


def drawn_by(draws, runs):
    """Return the index positions and instance slots that draw calls draw, an entry for each triangle."""
    pairs = []
    for first, count, slot, instances in np.asarray(runs, np.int64).reshape(-1, 4).tolist():
        assert first % 3 == 0 and count % 3 == 0 and count > 0
        assert first + count <= draws.indices.size and slot + instances <= len(draws.slots)
        pairs += [(place, slot + k) for k in range(instances) for place in range(first // 3, (first + count) // 3)]
    return pairs


def world_corners(draws, hierarchy, place, slot):
    """Return the corners of a drawn triangle relative to the origin, (3, 3), as `raster_vertex` places them."""
    corners = draws.vertices[draws.indices[place], :3].copy().view(np.float32).astype(np.float64)
    instance = draws.slots[slot]
    if instance != NONE:
        m = hierarchy.instances["world_from_local"][instance, :, :3].astype(np.float64)
        corners = corners @ m[:3] + m[3]
    return corners


def check(draws, hierarchy, instances):
    """Compare everything that is drawn with `instances`, in float64."""
    assert draws.slots[0] == NONE and draws.indices.dtype == np.uint32
    found = Counter()
    for masked, runs in ((False, draws.opaque), (True, draws.masked)):
        for place, slot in drawn_by(draws, runs):
            index = draws.indices[place]
            number = int(draws.vertices[index[0], 3])
            triangle = hierarchy.triangles[number]
            assert bool(triangle["flags"] & MASKED) == masked
            # The sources are that triangle's entries of the vertex table, rotated or mirrored.
            assert sorted(draws.sources[index]) == sorted(hierarchy.triangles["corners"][number])
            instance = int(draws.slots[slot]) if triangle["instance"] == NONE else int(triangle["instance"])
            assert (draws.slots[slot] == NONE) == (triangle["instance"] != NONE)
            found[instance, number] += 1
            corners = corners_of(hierarchy.triangles[number : number + 1])[0]
            if triangle["instance"] == NONE:
                m = hierarchy.instances["world_from_local"][instance, :, :3].astype(np.float64)
                corners = corners @ m[:3] + m[3]
            got = world_corners(draws, hierarchy, place, slot)
            assert np.allclose(_sorted(got), _sorted(corners), rtol=0, atol=1e-5 * (1 + np.abs(corners).max()))
    expected = Counter(
        (number, triangle)
        for number, i in enumerate(instances)
        for triangle in range(*hierarchy.placement(i.mesh).triangles.indices(len(hierarchy.triangles)))
    )
    assert found == expected
    check_clusters(draws, hierarchy)


def _sorted(corners):
    return corners[np.lexsort(np.round(corners, 3).T)]


def check_clusters(draws, hierarchy):
    """Assert that clusters draw the same triangles as the draw calls, once each, inside their boxes."""
    clusters = draws.clusters
    assert len(clusters.runs) == len(clusters.local) == len(clusters.boxes) == len(clusters.instances)
    for masked, runs in ((False, draws.opaque), (True, draws.masked)):
        part = slice(clusters.opaque_count, None) if masked else slice(clusters.opaque_count)
        assert Counter(drawn_by(draws, clusters.runs[part])) == Counter(drawn_by(draws, runs))
        everything = np.ones(len(clusters.runs), bool)
        assert Counter(drawn_by(draws, clusters.visible(everything, masked))) == Counter(drawn_by(draws, runs))
    for run, (low, high), instance in zip(clusters.runs, clusters.boxes, clusters.instances, strict=True):
        drawn = drawn_by(draws, run)
        assert run[3] == 1 and instance == (-1 if run[2] == 0 else draws.slots[run[2]])
        corners = np.concatenate([world_corners(draws, hierarchy, *pair) for pair in drawn])
        slack = SLACK * np.abs(corners).max()
        assert (corners >= low - slack).all() and (corners <= high + slack).all()
        # A box is not much larger than the box of a rotated box of its triangles.
        assert (high - low <= 2.5 * (np.ptp(corners, axis=0).max() + slack)).all()


def material_index(instances):
    materials = {id(m): m for i in instances for m in i.mesh.materials}
    return {key: number for number, key in enumerate(materials)}


def build(dtypes, instances):
    hierarchy, known = TwoLevelBvh(dtypes), {}
    hierarchy.update(instances, material_index(instances))
    draws = build_draw_list(instances, hierarchy, known)
    check(draws, hierarchy, instances)
    return draws, hierarchy, known


def test_everything_is_drawn_once(dtypes):
    instances = some_instances()
    draws, hierarchy, known = build(dtypes, instances)
    # Everything in world space is one draw call.
    assert [slot for _, _, slot, _ in draws.opaque].count(0) == 1
    assert [slot for _, _, slot, _ in draws.masked].count(0) == 1
    assert [run[3] for run in draws.opaque] == [1, 2, 2] and [run[3] for run in draws.masked] == [1, 2]
    assert len(known) == len({id(i.mesh) for i in instances})
    again = build_draw_list(instances, hierarchy, known)
    for name in ("vertices", "sources", "indices", "slots"):
        assert np.array_equal(getattr(again, name), getattr(draws, name))


@pytest.mark.parametrize("scale", [(1, 1, 1), (-1, 1, 1), (1, -2, 1), (-1, -1, -1), (-1e3, 1e-3, 1)])
def test_one_mesh_alone_and_twice(dtypes, scale):
    for mesh in (quad((0, 0, 0), (1, 0, 0), (0, 1, 0)), half_masked(sphere(subdivisions=1))):
        instance = Instance(mesh, at(3, 4, 5, scale, 0.4))
        draws, _, _ = build(dtypes, [instance])
        assert list(draws.slots) == [NONE]
        draws, _, _ = build(dtypes, [instance, Instance(mesh, at(-3, 0, 0, scale))])
        assert list(draws.slots) == [NONE, 0, 1]


def test_empty_scene(dtypes):
    draws, _, _ = build(dtypes, [])
    assert draws.opaque == draws.masked == ()
    assert min(len(getattr(draws, name)) for name in ("vertices", "sources", "indices", "slots")) == 1


def test_degenerate_mesh(dtypes):
    points = np.array([(0, 0, 0), (1, 0, 0), (0, 0, 1), (2, 0, 0), (0, 0, 0)], np.float32)
    triangles = np.array([(0, 1, 2), (0, 1, 3), (0, 4, 0), (3, 3, 3), (0, 1, 2)], np.uint32)
    build(dtypes, [Instance(Mesh(points, triangles))])
    build(dtypes, [Instance(Mesh(points, triangles)), *[Instance(Mesh(points, triangles[3:4]), at(k)) for k in (1, 2)]])


def test_large_meshes_are_cut_into_clusters_and_many_instances_are_not(dtypes, monkeypatch):
    monkeypatch.setattr(draw_list, "CLUSTER", 50)
    ball = sphere(subdivisions=2)  # 320 triangles
    for count, clusters in ((1, 7), (2, 14), (MANY_INSTANCES, 7 * MANY_INSTANCES), (MANY_INSTANCES + 1,) * 2):
        draws, _, _ = build(dtypes, [Instance(ball, at(3 * k)) for k in range(count)])
        assert len(draws.clusters.runs) == clusters


def test_clusters_follow_their_instances(dtypes):
    instances = some_instances()
    draws, hierarchy, known = build(dtypes, instances)
    instances[1].world_from_local = at(-4, 3, 0, (1, 2, 3), 1.2)
    instances[6].world_from_local = at(-9, 1, 0, (1, -1, 1), 2.0)
    hierarchy.update(instances, material_index(instances))
    assert not hierarchy.changed & {"triangles", "vertices"}  # else they would be laid out anew
    before = draws.clusters.boxes.copy()
    draws.clusters.place(hierarchy.instances["world_from_local"])
    check(draws, hierarchy, instances)
    moved = np.isin(draws.clusters.instances, [1, 6])
    assert np.array_equal(draws.clusters.boxes[~moved], before[~moved])
    assert (draws.clusters.boxes[moved] != before[moved]).any((1, 2)).all()
    # A baked mesh that moves is no longer baked.
    instances[0].world_from_local = at(1, -1)
    hierarchy.update(instances, material_index(instances))
    draws = build_draw_list(instances, hierarchy, known)
    check(draws, hierarchy, instances)
    assert 0 in draws.slots


def test_boxes_contain_vertices_rounded_by_shaders(dtypes):
    """Even of meshes far from their own origin, whose vertices are sums of large terms."""
    ball = sphere(subdivisions=2)
    ball.positions = ball.positions + np.float32((3000, -5000, 2000))
    place = at(0, 0, 0, (0.01, 0.02, 0.01), 0.7)
    place[:3, 3] = -place[:3, :3] @ (3000, -5000, 2000)
    draws, hierarchy, _ = build(dtypes, [Instance(ball, at(k) @ place) for k in (0, 1)])
    for run, (low, high), instance in zip(draws.clusters.runs, draws.clusters.boxes, (0, 1), strict=True):
        corners = draws.indices[run[0] // 3 : (run[0] + run[1]) // 3]
        p = draws.vertices[corners, :3].copy().view(np.float32).reshape(-1, 3)
        m = hierarchy.instances["world_from_local"][instance, :, :3]
        p = ((p[:, :1] * m[0] + p[:, 1:2] * m[1]) + p[:, 2:] * m[2]) + m[3]
        assert p.dtype == np.float32 and (p >= low).all() and (p <= high).all()


def test_materials_become_masked(dtypes):
    instances = some_instances()
    _, hierarchy, known = build(dtypes, instances)
    instances[0].mesh.materials[0].alpha_mode = "mask"
    hierarchy.update(instances, material_index(instances))
    assert "triangles" in hierarchy.changed
    check(build_draw_list(instances, hierarchy, known), hierarchy, instances)


def test_far_from_the_origin(dtypes):
    """Positions equal those of the same scene at the origin."""
    far = at(1e7, -2e7, 3e7)
    instances = [Instance(i.mesh, far @ i.world_from_local) for i in some_instances()]
    draws, _, _ = build(dtypes, instances)
    baked = draws.vertices[draws.indices[: draws.opaque[0][1] // 3], :3].copy().view(np.float32)
    assert np.abs(baked).max() < 20


# ------------------------------------------------------------------------------------------------ Runs


def test_draw_calls_of_adjacent_indices_are_merged():
    runs = np.array([(0, 6, 0, 1), (6, 3, 0, 1), (9, 3, 1, 1), (12, 3, 1, 1), (18, 3, 1, 1), (21, 3, 1, 2)])
    assert merge_draw_calls(runs) == [(0, 9, 0, 1), (9, 6, 1, 1), (18, 3, 1, 1), (21, 3, 1, 2)]
    assert merge_draw_calls(runs[:0]) == []
    assert merge_draw_calls(runs[:1]) == [(0, 6, 0, 1)]
    assert merge_draw_calls(runs[::-1]) == [tuple(run) for run in runs[::-1].tolist()]


def test_draw_calls_of_adjacent_instances_are_merged():
    whole = np.array([(0, 6, 1, 1), (0, 6, 2, 1), (0, 6, 3, 2), (0, 6, 6, 1), (6, 6, 7, 1), (6, 3, 8, 1)])
    assert merge_draw_calls(whole) == [(0, 6, 1, 4), (0, 6, 6, 1), (6, 6, 7, 1), (6, 3, 8, 1)]
    # Instances that are shown as a whole; the order of triangles stays the same.
    parts = np.array([(0, 6, 1, 1), (6, 3, 1, 1), (0, 6, 2, 1), (6, 3, 2, 1), (6, 3, 3, 1)])
    assert merge_draw_calls(parts) == [(0, 9, 1, 2), (6, 3, 3, 1)]


@pytest.mark.parametrize("seed", range(5))
def test_visible_clusters_are_drawn_in_order(dtypes, seed, monkeypatch):
    """Besides the clusters that are shown, only small gaps between them are drawn."""
    draws, _, _ = build(dtypes, some_instances())
    clusters = draws.clusters
    shown = np.random.default_rng(seed).random(len(clusters.runs)) < 0.5
    for masked, part in ((False, slice(clusters.opaque_count)), (True, slice(clusters.opaque_count, None))):
        everything = drawn_by(draws, draws.masked if masked else draws.opaque)
        found = {}
        for gap in (0, 20, 10**6):
            monkeypatch.setattr(draw_list, "SMALL_GAP", gap)
            runs = draws.visible(shown, masked)
            found[gap] = set(drawn_by(draws, runs))
            assert drawn_by(draws, runs) == [pair for pair in everything if pair in found[gap]]
            assert all(type(value) is int for run in runs for value in run)
        assert found[0] == set(drawn_by(draws, clusters.runs[part][shown[part]])) <= found[20] <= found[10**6]
    assert draws.visible(np.ones_like(shown), False) == list(draws.opaque)
    assert draws.visible(np.zeros_like(shown), False) == draws.visible(np.zeros_like(shown), True) == []


@pytest.mark.parametrize("seed", range(20))
def test_small_gaps_are_filled(seed):
    rng = np.random.default_rng(seed)
    shown, sizes = rng.random(40) < 0.4, rng.integers(1, SMALL_GAP, 40)
    expected, at = shown.copy(), np.flatnonzero(shown)
    for one, next_ in pairwise(at):
        if sizes[one + 1 : next_].sum() <= SMALL_GAP:
            expected[one:next_] = True
    assert np.array_equal(fill_gaps(shown, 3 * sizes), expected)
    for few in (0, 1):
        assert np.array_equal(fill_gaps(shown[:few], sizes[:few]), shown[:few])


def test_meshes_with_new_positions_move_in_place(dtypes, monkeypatch):
    """The list equals one that is built anew."""
    monkeypatch.setattr(draw_list, "CLUSTER", 8)
    ball = sphere(subdivisions=1)
    ball.triangles = ball.triangles[np.random.default_rng(0).permutation(len(ball.triangles))]
    instances = [Instance(quad((0, 0, 0), (4, 0, 0), (0, 4, 0))), Instance(ball), Instance(ball, at(3, 0, 0))]
    hierarchy, materials = TwoLevelBvh(dtypes), {id(m): k for k, m in enumerate(Scene(instances).materials)}
    hierarchy.update(instances, materials)
    draws = build_draw_list(instances, hierarchy, {})
    ball.positions = (ball.positions * np.float32(1.1)).astype(np.float32)
    hierarchy.update(instances, materials)
    assert hierarchy.moved_meshes == {id(ball)} and not hierarchy.changes_draws
    draws.move(hierarchy.placement(ball), [1, 2])
    draws.clusters.place(hierarchy.instances["world_from_local"])
    fresh = build_draw_list(instances, hierarchy, {})
    for name in ("vertices", "indices", "sources", "slots"):
        assert np.array_equal(getattr(draws, name), getattr(fresh, name)), name
    assert np.array_equal(draws.clusters.boxes, fresh.clusters.boxes) and draws.opaque == fresh.opaque
