"""scene/surface.wgsl: position, normals and sides at hits; a ray that leaves a surface does not meet it again."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.scene_dtypes import DTYPES

from wgpu_gi.measure.wgsl_evaluator import Evaluator
from wgpu_gi.scene.built_in.shapes import quad, sphere
from wgpu_gi.scene.scene import Instance, Scene
from wgpu_gi.upload.two_level_bvh import TwoLevelBvh

SURFACE = "scene/surface.wgsl"
HIT = """
#import "scene/trace.wgsl"
fn position_at(o: vec3f, d: vec3f) -> vec4f {
    let hit = trace(Ray(o, d), FLOAT_MAX);
    if (hit.triangle == NONE) {
        return vec4f(0.0);
    }
    let s = surface_at(hit, d);
    return vec4f(s.position, hit.distance);
}
fn normals_at(o: vec3f, d: vec3f) -> vec4f {
    let hit = trace(Ray(o, d), FLOAT_MAX);
    if (hit.triangle == NONE) {
        return vec4f(0.0);
    }
    let s = surface_at(hit, d);
    return vec4f(s.geometric_normal, select(-1.0, 1.0, s.front));
}
// Distance to the next hit from the first one along `onward` (0: no first hit, 3e38: no next hit), and the offset used.
fn onward_at(o: vec3f, d: vec3f, onward: vec3f) -> vec2f {
    let hit = trace(Ray(o, d), FLOAT_MAX);
    if (hit.triangle == NONE) {
        return vec2f(0.0);
    }
    let s = surface_at(hit, d);
    let next = trace(Ray(leave_surface(s, onward), onward), FLOAT_MAX);
    return vec2f(select(next.distance, 3.0e38, next.triangle == NONE), s.offset);
}
"""


@pytest.fixture
def evaluate(tmp_path):
    return Evaluator(tmp_path)


def placed(scale, shift=(0.0, 0.0, 0.0), seed=0):
    rotation, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    m = np.eye(4)
    m[:3, :3] = rotation @ np.diag(np.broadcast_to(scale, 3))
    m[:3, 3] = shift
    return m


def balls():
    """The unit sphere as it is, placed by instances, mirrored, tiny, huge, flattened, and away from the origin."""
    ball = sphere(subdivisions=3)
    far = (100.0, -40.0, 30.0)
    at_origin = Instance(quad((0, 0, 0), (1e-3, 0, 0), (0, 1e-3, 0)))
    return {
        "baked": [Instance(ball, placed(1.0))],
        "baked, mirrored": [Instance(ball, placed((-1.0, 2.0, 0.5), seed=1))],
        "baked, far from the origin": [Instance(ball, placed(1.0, far)), at_origin],
        "shared": [Instance(ball, placed(1.0)), Instance(ball, placed(0.5, (0, 3, 0)))],
        "shared, mirrored": [Instance(ball, placed((-1.0, 2.0, 0.5))), Instance(ball, placed(0.5, (0, 4, 0)))],
        "shared, flat": [Instance(ball, placed((1.0, 1e-2, 1.0))), Instance(ball, placed(0.5, (0, 3, 0)))],
        "shared, far": [Instance(ball, placed(1.0, far)), Instance(ball, placed(0.5))],
        "tiny": [Instance(ball, placed(1e-4))],
        "huge": [Instance(ball, placed(1e5)), Instance(ball, placed(1e4, (3e5, 0, 0)))],
    }


def rays_at(scene, count=4000):
    """Rays from around the first ball to points in it, relative to the scene's origin; centre and matrix."""
    rng = np.random.default_rng(3)
    m = np.asarray(scene.instances[0].world_from_local)
    outside = rng.normal(size=(count, 3))
    outside *= 1.5 / np.linalg.norm(outside, axis=1, keepdims=True)
    aim = rng.normal(size=(count, 3))
    aim *= 0.98 * rng.random((count, 1)) ** (1 / 3) / np.linalg.norm(aim, axis=1, keepdims=True)
    hierarchy = TwoLevelBvh(DTYPES)
    hierarchy.update(scene.instances, {id(material): 0 for material in scene.materials})
    origin = hierarchy.origin
    o = (outside @ m[:3, :3].T + m[:3, 3] - origin).astype(np.float32)
    target = aim @ m[:3, :3].T + m[:3, 3] - origin
    d = target - o
    return o, (d / np.linalg.norm(d, axis=1, keepdims=True)).astype(np.float32), m, origin


@pytest.mark.parametrize("name", balls())
def test_positions_and_normals_are_those_of_the_sphere(evaluate, name):
    scene = Scene(balls()[name])
    o, d, m, origin = rays_at(scene)
    at = evaluate(SURFACE, "position_at(o(i), d(i))", "vec4f", functions=HIT, scene=scene, o=o, d=d).astype(np.float64)
    seen = at[:, 3] > 0
    assert seen.mean() > 0.99
    at, o, d = at[seen], o[seen].astype(np.float64), d[seen]
    size = np.abs(at[:, :3]).max() + np.abs(m[:3, :3]).max()
    # On the ray, and on the facets of the sphere, which lie up to 0.6 % inside of it.
    assert np.linalg.norm(o + at[:, 3:] * d - at[:, :3], axis=1).max() < 2e-6 * size
    local = (at[:, :3] + origin - m[:3, 3]) @ np.linalg.inv(m[:3, :3]).T
    radius = np.linalg.norm(local, axis=1)
    slack = 2e-6 * size / np.abs(np.linalg.svd(m[:3, :3], compute_uv=False)).min()
    assert (radius > 0.99 - slack).all() and (radius < 1.01 + slack).all()
    got = evaluate(SURFACE, "normals_at(o(i), d(i))", "vec4f", functions=HIT, scene=scene, o=o, d=d).astype(np.float64)
    assert np.allclose(np.linalg.norm(got[:, :3], axis=1), 1, atol=1e-5)
    # From outside the front is visible, also of mirrored balls, and the normal is that of the ellipsoid.
    assert (got[:, 3] == 1).all()
    normal = local @ np.linalg.inv(m[:3, :3])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    assert np.median((normal * got[:, :3]).sum(1)) > 0.995 and ((d * got[:, :3]).sum(1) < 0).all()


@pytest.mark.parametrize("name", balls())
def test_leaving_a_convex_surface_outwards_meets_nothing(evaluate, name):
    """Directions down to a hundredth of a degree above the facet: no ray meets the ball again (shadow acne)."""
    ball, *others = balls()[name]
    if "shared" in name or name == "huge":
        # A tiny second instance in its centre keeps the mesh shared.
        others = [Instance(ball.mesh, placed(1e-3, ball.world_from_local[:3, 3]))]
    scene = Scene([ball, *others])
    o, d, m, _ = rays_at(scene, 20_000)
    given = {"functions": HIT, "scene": scene, "o": o, "d": d}
    normal = evaluate(SURFACE, "normals_at(o(i), d(i)).xyz", "vec3f", **given).astype(np.float64)
    rng = np.random.default_rng(4)
    side = np.cross(normal, rng.normal(size=normal.shape))
    side /= np.maximum(np.linalg.norm(side, axis=1, keepdims=True), 1e-30)
    elevation = 10 ** rng.uniform(-3.7, 0, (len(o), 1))
    onward = elevation * normal + side
    onward /= np.linalg.norm(onward, axis=1, keepdims=True)
    got = evaluate(SURFACE, "onward_at(o(i), d(i), onward(i))", "vec2f", onward=onward, **given)
    hit = got[:, 1] > 0
    assert hit.mean() > 0.99
    assert (got[hit, 0] > 1e38).all(), f"{(got[hit, 0] < 1e38).sum()} of {hit.sum()} rays meet their own surface"
    # The offset is too small to be visible.
    assert got[hit, 1].max() < 1e-5 * (np.abs(o).max() + np.linalg.norm(m[:3, :3]))


@pytest.mark.parametrize("name", balls())
def test_leaving_inwards_meets_the_other_side(evaluate, name):
    """No ray into a closed body gets out of it (light leaks), nor stops where it started."""
    scene = Scene(balls()[name])
    o, d, m, _ = rays_at(scene, 20_000)
    given = {"functions": HIT, "scene": scene, "o": o, "d": d}
    normal = evaluate(SURFACE, "normals_at(o(i), d(i)).xyz", "vec3f", **given).astype(np.float64)
    rng = np.random.default_rng(5)
    # Inwards, within about 60 degrees.
    onward = -normal + 0.85 * rng.normal(size=normal.shape).clip(-1, 1)
    onward /= np.linalg.norm(onward, axis=1, keepdims=True)
    got = evaluate(SURFACE, "onward_at(o(i), d(i), onward(i))", "vec2f", onward=onward, **given)
    inwards = (got[:, 1] > 0) & ((onward * normal).sum(1) < -0.2)
    smallest = np.abs(np.linalg.svd(m[:3, :3], compute_uv=False)).min()
    assert inwards.mean() > 0.7
    assert (got[inwards, 0] < 1e38).all()
    assert np.quantile(got[inwards, 0], 0.01) > 1e-3 * smallest


def test_offset_exceeds_the_rounding_of_hits():
    """Computes hits and the next ray's test in float32, and checks the bound of `scene/ray_offset.wgsl`.

    Triangles of 1e-3 to 1e3 of their distance from the origin, tilted by 1e-6 to 45 degrees off an axis.
    """
    rng = np.random.default_rng(5)
    n = 200_000
    a, edge1, edge2 = rng.normal(size=(3, n, 3))
    size, flat = 10 ** rng.uniform(-3, 3, (n, 1)), 10 ** rng.uniform(-6, 0, n)
    edge1[:, 1] *= flat
    edge2[:, 1] *= flat
    a, edge1, edge2 = (v.astype(np.float32) for v in (a, size * edge1, size * edge2))
    b1 = rng.random((n, 1)).astype(np.float32)
    b2 = (rng.random((n, 1)) * (1 - b1)).astype(np.float32)
    point = a + b1 * edge1 + b2 * edge2
    terms = np.abs(a) + np.abs(b1 * edge1) + np.abs(b2 * edge2)
    assert point.dtype == np.float32
    # The distance off the plane that the next test finds for a ray that starts at the point.
    s = point - a
    q = np.stack([s[:, k - 2] * edge1[:, k - 1] - s[:, k - 1] * edge1[:, k - 2] for k in range(3)], 1)
    product = edge2 * q
    normal = np.cross(edge1.astype(np.float64), edge2.astype(np.float64))
    twice_area = np.linalg.norm(normal, axis=1)
    off = np.abs(product[:, 0] + product[:, 1] + product[:, 2]) / twice_area
    lean = np.abs(normal) / twice_area[:, None]
    bound = 2.0**-24 * ((lean * terms).sum(1) + (lean.sum(1) - lean.max(1)) * terms.max(1))
    sine = twice_area / np.linalg.norm(edge1, axis=1) / np.linalg.norm(edge2, axis=1)
    assert (off < 5 * bound)[sine > 0.1].all()  # of which the offset takes 8
    assert (off > bound)[sine > 0.1].any()
