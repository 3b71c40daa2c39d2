"""Rays against triangles: the two-level hierarchy against brute force, several rays at once, degenerate triangles."""

from __future__ import annotations

import numpy as np
import pytest

from wgpu_gi.measure.wgsl_evaluator import Evaluator
from wgpu_gi.scene.built_in import scenes as builtin
from wgpu_gi.scene.built_in.shapes import box, sphere
from wgpu_gi.scene.scene import Instance, Mesh, Scene

TRACE = """
fn traced(i: u32) -> vec4f {
    let hit = trace(Ray(origins(i), directions(i)), limits(i));
    return vec4f(hit.distance, bitcast<f32>(hit.triangle), hit.from_anchor);
}
"""
TRACE_ALL = """
fn traced_all(i: u32) -> vec4f {
    let a = Ray(origins_a(i), directions_a(i));
    let b = Ray(origins_b(i), directions_b(i));
    let found = trace_all(Rays(a, limits_a(i), b, limits_b(i), Ray(origins(i), directions(i)), limits(i), 0u, 0u));
    let shadows = select(0.0, 1.0, found.occluded_a) + select(0.0, 2.0, found.occluded_b);
    return vec4f(shadows, found.hit.distance, bitcast<f32>(found.hit.triangle), 0.0);
}
"""
NONE = 0xFFFFFFFF
FAR = 3.4e38


@pytest.fixture
def evaluate(tmp_path):
    return Evaluator(tmp_path)


def world_triangles(scene):
    """All triangles in the world, (m, 3, 3) float64."""
    parts = []
    for instance in scene.instances:
        corners = instance.mesh.positions[instance.mesh.triangles].astype(np.float64)
        m = np.asarray(instance.world_from_local)
        parts.append(corners @ m[:3, :3].T + m[:3, 3])
    return np.concatenate(parts)


def brute_force(scene, origins, directions):
    """First hit distance in lengths of the direction, inf for none; and how near any decision was, in barycentrics."""
    triangles = world_triangles(scene)
    nearest, margin = np.full(len(origins), np.inf), np.full(len(origins), np.inf)
    a, u, v = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    n = np.cross(u, v)
    for rows in np.array_split(np.arange(len(origins)), -(-len(origins) * len(triangles) // 500_000)):
        o, d = origins[rows].astype(np.float64), directions[rows].astype(np.float64)
        moment = np.cross(o, d)
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = -1 / (d @ n.T)
            bu = (moment @ v.T - d @ np.cross(v, a).T) * inverse
            bv = -(moment @ u.T + d @ np.cross(a, u).T) * inverse
            t = (o @ n.T - (a * n).sum(1)) * inverse
            inside = np.minimum(np.minimum(bu, bv), 1 - bu - bv)
            inside[~np.isfinite(inside + t)] = -1  # edge-on
        hit = (inside >= 0) & (t > 0)
        first = np.where(hit, t, np.inf).min(1)
        # An edge that passes this close to the ray, in front of the hit, may count or not.
        before = (t > 0) & (t <= first[:, None] * (1 + 1e-6))
        close = np.where(before, np.abs(inside), np.inf).min(1)
        nearest[rows], margin[rows] = first, close
    return nearest, margin


def rays(scene, count, seed=1):
    """Random rays from in and around the scene, of lengths 0.1 to 10; some along axes."""
    rng = np.random.default_rng(seed)
    low, high = scene.bounds()
    origins = rng.uniform(low - 0.3 * (high - low), high + 0.3 * (high - low), (count, 3))
    directions = rng.normal(size=(count, 3))
    directions[: count // 8, rng.integers(0, 3)] = 0.0
    directions[: count // 16] *= np.eye(3)[rng.integers(0, 3, count // 16)]
    directions[~directions.any(1)] = (0, 0, 1)
    directions *= 10 ** rng.uniform(-1, 1, (count, 1)) / np.linalg.norm(directions, axis=1, keepdims=True)
    return origins.astype(np.float32), directions.astype(np.float32)


def soup(count, seed=0, extent=1.0):
    """Random triangles of all sizes."""
    rng = np.random.default_rng(seed)
    centres = rng.uniform(-extent, extent, (count, 1, 3))
    sizes = 10 ** rng.uniform(-3, 0, (count, 1, 1))
    points = (centres + sizes * rng.normal(size=(count, 3, 3))).reshape(-1, 3).astype(np.float32)
    return Mesh(points, np.arange(3 * count, dtype=np.uint32).reshape(-1, 3))


def placed(seed, mirrored=False):
    """A random rotation with an uneven scale and a shift."""
    rng = np.random.default_rng(seed)
    rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    if np.linalg.det(rotation) < 0:
        rotation[:, 0] *= -1
    m = np.eye(4)
    m[:3, :3] = rotation @ np.diag(rng.uniform(0.3, 3, 3) * [-1 if mirrored else 1, 1, 1])
    m[:3, 3] = rng.uniform(-3, 3, 3)
    return m


def scenes():
    shared = soup(150, 3)
    return {
        "one soup": Scene([Instance(soup(500))]),
        "one triangle": Scene([Instance(soup(1, 5))]),
        "baked instances": Scene([Instance(soup(100, k), placed(k, k % 2 == 1)) for k in range(6)]),
        "instances of one mesh": Scene([Instance(shared, placed(k, k % 2 == 1)) for k in range(12)]),
        "both": Scene([Instance(shared, placed(k)) for k in range(5)] + [Instance(soup(300, 9, 3.0), placed(9, True))]),
        "flat": Scene([Instance(m) for m in (box((0, 0, 0), (1, 1, 1)), box((0, 1, 0), (5, 1.001, 1)))]),
        "corridor": builtin.corridor(),
        "sphere": Scene([Instance(sphere(subdivisions=3))]),
    }


@pytest.mark.parametrize("name", scenes())
def test_trace_agrees_with_brute_force(evaluate, name):
    scene = scenes()[name]
    origins, directions = rays(scene, 3_000)
    given = {"origins": relative(scene, origins), "directions": directions, "limits": np.full(len(origins), FAR)}
    got = evaluate("scene/trace.wgsl", "traced(i)", "vec4f", functions=TRACE, scene=scene, **given)
    triangle = got[:, 1].copy().view(np.uint32)
    expected, margin = brute_force(scene, origins, directions)
    assert_same_hits(got[:, 0], triangle != NONE, expected, margin)


@pytest.mark.parametrize("name", sorted(scenes()))
def test_trace_agrees_with_brute_force_in_trees_built_on_the_device(evaluate, monkeypatch, name):
    monkeypatch.setattr("wgpu_gi.upload.tree_builder.SMALLEST", 1)
    test_trace_agrees_with_brute_force(evaluate, name)


def relative(scene, points):
    """World points relative to the scene's origin, as on the GPU."""
    return (points - scene.bounds().mean(0)).astype(np.float32)


def assert_same_hits(distance, hit, expected, margin):
    distance = np.where(hit, distance, np.inf)
    clear = margin > 1e-4
    assert clear.mean() > 0.85
    wrong = clear & (hit != np.isfinite(expected))
    both = clear & hit & np.isfinite(expected)
    wrong[both] |= np.abs(distance[both] - expected[both]) > 1e-4 * expected[both] + 2e-5
    assert not wrong.any(), f"{wrong.sum()} of {clear.sum()} rays differ, such as {np.flatnonzero(wrong)[:5]}"
    assert np.isfinite(expected).any()
    # At edges, rays find as many hits on average.
    doubtful = ~clear
    assert abs((hit[doubtful].astype(int) - np.isfinite(expected[doubtful])).sum()) <= 0.02 * len(hit)


@pytest.mark.parametrize("name", ["both", "corridor", "instances of one mesh"])
def test_rays_traced_together_do_not_disturb_each_other(evaluate, name):
    """Two shadow rays up to their limits, then an unrelated ray, any of them absent, in one traversal."""
    scene = scenes()[name]
    rng = np.random.default_rng(4)
    sets = [rays(scene, 3_000, seed) for seed in (2, 3, 5)]
    limits = [np.where(rng.random(3_000) < 0.3, 0.0, 10 ** rng.uniform(-1, 1.5, 3_000)) for _ in range(2)]
    limits.append(np.where(rng.random(3_000) < 0.1, 0.0, FAR))
    given = {}
    for suffix, (origins, directions), limit in zip(("_a", "_b", ""), sets, limits, strict=True):
        given |= {"origins" + suffix: relative(scene, origins), "directions" + suffix: directions}
        given["limits" + suffix] = limit
    got = evaluate("scene/trace.wgsl", "traced_all(i)", "vec4f", functions=TRACE_ALL, scene=scene, **given)
    expected, margin = brute_force(scene, *sets[2])
    expected[limits[2] == 0] = np.inf
    triangle = got[:, 2].copy().view(np.uint32)
    assert_same_hits(got[:, 1], triangle != NONE, expected, margin)
    for k in range(2):
        expected, margin = brute_force(scene, *sets[k])
        near_limit = np.abs(expected - limits[k]) < 1e-4 * limits[k] + 2e-5
        clear = (margin > 1e-4) & ~near_limit
        occluded = (got[:, 0].astype(int) >> k & 1).astype(bool)
        assert np.array_equal(occluded[clear], (expected < limits[k])[clear])


PLANE_HIT = """
fn plane_hit(i: u32) -> vec4f {
    var t: Triangle;
    t.edge1 = edges1(i);
    t.edge2 = edges2(i);
    let h = hit_plane(vec3f(0.0, 0.0, 1.0), directions(i), t);
    return vec4f(h.distance, h.from_anchor, select(0.0, 1.0, h.exists) + select(0.0, 2.0, is_in_triangle(h, t, 9.0)));
}
"""


def test_a_ray_along_a_plane_or_to_a_triangle_without_area_hits_nothing(evaluate):
    x, y, none = (1.0, 0, 0), (0, 1.0, 0), (0.0, 0, 0)
    cases = [
        ((0.2, 0.3, -1), x, y, 3),  # hits the inside
        ((0.6, 0.6, -1), x, y, 1),  # hits the plane beside the triangle
        ((1.0, 0.0, 0), x, y, 0),  # parallel to the plane
        ((0.2, 0.3, -1), x, x, 0),  # no area
        ((0.2, 0.3, -1), none, none, 0),
        ((0.2, 0.3, -1), (1e-30, 0, 0), (0, 1e-30, 0), 0),  # an area below the range of float32
    ]
    directions, edges1, edges2, expected = (np.array(column, np.float32) for column in zip(*cases, strict=True))
    got = evaluate(
        "scene/ray_triangle.wgsl",
        "plane_hit(i)",
        "vec4f",
        functions=PLANE_HIT,
        directions=directions,
        edges1=edges1,
        edges2=edges2,
    )
    assert got[:, 3].tolist() == expected.tolist()
    assert np.allclose(got[0, :3], (1, 0.2, 0.3), atol=1e-6)
