"""scene/lights.wgsl: the environment's coordinates and densities, choice of lights, sampled emitters."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.statistics import chi_square_z

from wgpu_gi.measure.wgsl_evaluator import Evaluator
from wgpu_gi.scene.built_in.scenes import matte
from wgpu_gi.scene.built_in.shapes import quad, sphere
from wgpu_gi.scene.scene import DirectionalLight, Environment, Instance, PointLight, Scene, SpotLight

LIGHTS = "scene/lights.wgsl"


@pytest.fixture
def evaluate(tmp_path):
    return Evaluator(tmp_path)


def sky(height=12, width=24, seed=0):
    """A picture of a dim, uneven sky with a bright sun."""
    image = np.random.default_rng(seed).uniform(0.1, 1, (height, width, 3)).astype(np.float32)
    image[height // 3, width // 4] = (90, 80, 70)
    image[height // 2, :4] = 0
    return image


def scene_under(image=None, rotation=0.0, lights=(), lamps=(), color=(1.0, 1.0, 1.0)):
    """A small square floor in the environment `image`."""
    environment = None if image is None else Environment(color, image, rotation)
    floor = quad((-1, 0, 1), (2, 0, 0), (0, 0, -2), matte(0.5))
    return Scene([Instance(floor), *(Instance(lamp) for lamp in lamps)], list(lights), environment)


def sphere_grid(rows, columns):
    """Directions of the centres of cells in latitude and longitude, (n, 3), and their solid angles."""
    theta = ((np.arange(rows) + 0.5) / rows * np.pi)[:, None] * np.ones(columns)
    phi = ((np.arange(columns) + 0.5) / columns * 2 * np.pi)[None] * np.ones((rows, 1))
    d = np.stack([np.sin(theta) * np.sin(phi), np.cos(theta), -np.sin(theta) * np.cos(phi)], -1).reshape(-1, 3)
    edges = np.cos(np.linspace(0, np.pi, rows + 1))
    return d, np.repeat((edges[:-1] - edges[1:]) * 2 * np.pi / columns, columns)


@pytest.mark.parametrize("rotation", [0.0, 1.0, -7.0])
def test_environment_coordinates_round_trip(evaluate, rotation):
    """u = atan2(x, -z)/2pi + rotation/2pi, v = acos(y)/pi, there and back; -Z left, +X at 1/4, +Y on top."""
    scene = scene_under(sky(), rotation)
    d = np.random.default_rng(0).normal(size=(20_000, 3))
    # Also close to the poles, where acos has no digits.
    d[:2000, [0, 2]] *= 1e-3
    d[:2000, 1] = np.where(np.arange(2000) < 1000, 1, -1)
    d = (d / np.linalg.norm(d, axis=1, keepdims=True)).astype(np.float32)
    uv = evaluate(LIGHTS, "environment_uv(d(i))", "vec2f", scene=scene, d=d)
    exact = d.astype(np.float64)
    u = (np.arctan2(exact[:, 0], -exact[:, 2]) + rotation) / (2 * np.pi)
    v = np.arctan2(np.hypot(exact[:, 0], exact[:, 2]), exact[:, 1]) / np.pi
    wrapped = np.abs(uv[:, 0] - u)
    assert np.abs(wrapped - np.round(wrapped)).max() < 3e-6 and (uv >= 0).all() and (uv <= 1).all()
    assert np.abs(uv[:, 1] - v).max() < 3e-6
    back = evaluate(LIGHTS, "environment_direction(environment_uv(d(i)))", "vec3f", scene=scene, d=d)
    assert np.linalg.norm(back - d, axis=1).max() < 2e-5


def test_axes_have_their_environment_coordinates(evaluate):
    axes = np.array([(0, 0, -1), (1, 0, 0), (0, 0, 1), (-1, 0, 0)], np.float32)
    uv = evaluate(LIGHTS, "environment_uv(d(i))", "vec2f", scene=scene_under(sky()), d=axes)
    assert np.allclose(uv, [(0, 0.5), (0.25, 0.5), (0.5, 0.5), (0.75, 0.5)], atol=1e-6)
    poles = np.array([(0, 1, 0), (0, -1, 0)], np.float32)
    v = evaluate(LIGHTS, "environment_uv(d(i)).y", "f32", scene=scene_under(sky()), d=poles)
    assert np.allclose(v, [0, 1], atol=1e-6)


@pytest.mark.parametrize("lights", [[], [PointLight((0, 1, 0), 5.0), DirectionalLight((0, -1, 0), 1.0)]])
def test_environment_density_integrates_to_its_probability(evaluate, lights):
    scene = scene_under(sky(), 0.3, lights)
    d, solid_angle = sphere_grid(360, 720)
    pdf = evaluate(LIGHTS, "environment_pdf(d(i))", "f32", scene=scene, d=d).astype(np.float64)
    assert (pdf > 0).all()
    probability = evaluate(LIGHTS, "scene.environment_pdf", "f32", scene=scene, count=1)[0]
    assert (probability == 1) if not lights else (0.1 < probability < 1)
    assert (pdf * solid_angle).sum() == pytest.approx(probability, rel=2e-3)


DRAWN = """
fn drawn(choice: f32, u: vec2f) -> vec4f {
    let s = sample_light(vec3f(0.0), choice, u);
    return vec4f(s.direction, s.pdf);
}
fn weighed(from_position: vec3f, choice: f32, u: vec2f) -> vec4f {
    let s = sample_light(from_position, choice, u);
    return vec4f(select(vec3f(0.0), s.weighted, s.limit > 0.0), s.pdf);
}
"""


def uniform(count, columns=3, seed=0):
    return np.random.default_rng(seed).random((count, columns)).astype(np.float32).clip(0, 1 - 2**-24)


def test_environment_samples_follow_their_density(evaluate):
    scene = scene_under(sky(), 0.3)
    u = uniform(200_000)
    call = "drawn(u(i).z, u(i).xy)"
    got = evaluate(LIGHTS, call, "vec4f", functions=DRAWN, scene=scene, u=u).astype(np.float64)
    w, pdf = got[:, :3], got[:, 3]
    assert np.allclose(np.linalg.norm(w, axis=1), 1, atol=1e-5) and (pdf > 0).all()
    d, solid_angle = sphere_grid(12 * 8, 24 * 8)

    # Cells of the picture, turned back by the rotation; and the same integrals of the density.
    def cell(directions):
        column = ((np.arctan2(directions[:, 0], -directions[:, 2]) + 0.3) / (2 * np.pi) % 1 * 24).astype(int) % 24
        row = np.minimum(np.arccos(np.clip(directions[:, 1], -1, 1)) / np.pi * 12, 11).astype(int)
        return row * 24 + column

    turn = np.array([[np.cos(0.3), 0, np.sin(0.3)], [0, 1, 0], [-np.sin(0.3), 0, np.cos(0.3)]])
    d = d @ turn.T
    density = evaluate(LIGHTS, "environment_pdf(d(i))", "f32", scene=scene, d=d).astype(np.float64)
    expected = np.bincount(cell(d), density * solid_angle, minlength=288)
    observed = np.bincount(cell(w), minlength=288)
    assert chi_square_z(observed, expected / expected.sum() * len(u)) < 5


def test_sample_density_equals_the_evaluated_density(evaluate):
    """Both strategies must agree on densities, or their weights do not add up to one."""
    scene = scene_under(sky(), 0.3, [PointLight((0, 1, 0), 5.0)])
    u = uniform(50_000)
    u[:, 2] = 1 - 2**-24  # the environment comes last
    got = evaluate(LIGHTS, "drawn(u(i).z, u(i).xy)", "vec4f", functions=DRAWN, scene=scene, u=u)
    again = evaluate(LIGHTS, "environment_pdf(d(i))", "f32", scene=scene, d=np.ascontiguousarray(got[:, :3]))
    differs = np.abs(again / got[:, 3] - 1) > 1e-3
    assert differs.mean() < 2e-4  # rounding may take a direction over the edge of its cell


def test_weights_of_the_environment_average_to_its_integral(evaluate):
    """Mean of radiance over density is the integral of radiance over the sphere, for a tinted picture."""
    image = sky()
    scene = scene_under(image, 0.3, color=(1.0, 0.5, 2.0))
    u = uniform(2**17)
    got = evaluate(
        LIGHTS, "weighed(vec3f(0.0), u(i).z, u(i).xy).xyz", "vec3f", functions=DRAWN, scene=scene, u=u
    ).astype(np.float64)
    d, solid_angle = sphere_grid(360, 720)
    radiance = evaluate(LIGHTS, "environment_radiance(d(i))", "vec3f", scene=scene, d=d).astype(np.float64)
    expected = (radiance * solid_angle[:, None]).sum(0)
    noise = got.std(0) / np.sqrt(len(u))
    assert (np.abs(got.mean(0) - expected) < 4 * noise + 1e-3 * expected).all() and (noise < 0.02 * expected).all()


def test_environment_radiance_is_bilinear(evaluate):
    image = sky()
    d = np.random.default_rng(0).normal(size=(5000, 3))
    d = (d / np.linalg.norm(d, axis=1, keepdims=True)).astype(np.float32)
    got = evaluate(LIGHTS, "environment_radiance(d(i))", "vec3f", scene=scene_under(image, 0.3), d=d)
    exact = d.astype(np.float64)
    x = ((np.arctan2(exact[:, 0], -exact[:, 2]) + 0.3) / (2 * np.pi) % 1) * 24 - 0.5
    y = np.arccos(exact[:, 1]) / np.pi * 12 - 0.5
    x0, y0 = np.floor(x).astype(int), np.floor(y).astype(int)
    fx, fy = (x - x0)[:, None], (y - y0)[:, None]
    rows, columns = [np.clip(y0 + k, 0, 11) for k in (0, 1)], [(x0 + k) % 24 for k in (0, 1)]
    top, low = (image[r, columns[0]] * (1 - fx) + image[r, columns[1]] * fx for r in rows)
    assert np.allclose(got, top * (1 - fy) + low * fy, rtol=1e-4, atol=1e-2)


def test_lights_are_drawn_with_their_probability(evaluate):
    """Every light gets its share of [0, 1), also at the ends, and the weights make up for it."""
    lights = [PointLight((0.0, 1.0, 0.0), i, (1.0, 0.5, 0.2)) for i in (1.0, 100.0, 1e-3)]
    choice = ((np.arange(10_000) + 0.5) / 10_000).astype(np.float32)
    choice = np.concatenate([choice, [0.0, 1 - 2**-24]])
    scene = scene_under(lights=[*lights, PointLight((0, 1, 0), 0.0)])
    got = evaluate(
        LIGHTS, "weighed(vec3f(0.0), choice(i), vec2f(0.5)).xyz", "vec3f", functions=DRAWN, scene=scene, choice=choice
    ).astype(np.float64)
    assert np.allclose(got[:10_000].mean(0), 101.001 * np.array([1.0, 0.5, 0.2]), rtol=1e-3)
    assert len(np.unique(got[:, 0].round(6))) == 3 and (got > 0).all()


def test_spot_and_sun_samples_have_their_closed_forms(evaluate):
    """A sun gives its lux, a spot its intensity over d2; neither has a density."""
    scene = scene_under(lights=[DirectionalLight((0.0, -2.0, 0.0), 3.0)])
    got = evaluate(LIGHTS, "weighed(p(i), 0.5, vec2f(0.5))", "vec4f", functions=DRAWN, scene=scene, p=np.eye(3))
    assert np.allclose(got, (3, 3, 3, 0), rtol=1e-6)
    scene = scene_under(lights=[SpotLight((0.0, 2.0, 0.0), (0.0, -1.0, 0.0), 0.1, 0.6, 8.0)])
    angles = np.array([0.0, 0.05, 0.3, 0.5, 0.7])
    p = np.stack([2 * np.tan(angles), 0 * angles, 0 * angles], 1)
    got = evaluate(LIGHTS, "weighed(p(i), 0.5, vec2f(0.5))", "vec4f", functions=DRAWN, scene=scene, p=p)
    falloff = np.clip((np.cos(angles) - np.cos(0.6)) / (np.cos(0.1) - np.cos(0.6)), 0, 1) ** 2
    expected = 8.0 * falloff / (4 + p[:, 0] ** 2)
    assert np.allclose(got[:, 0], expected, rtol=1e-4, atol=1e-6) and not got[:, 3].any()


def test_a_point_at_a_light_gets_no_light(evaluate):
    """No division by zero where the surface meets the light's place."""
    scene = scene_under(lights=[PointLight((0.0, 0.0, 0.0), 8.0)])
    got = evaluate(LIGHTS, "weighed(vec3f(0.0), 0.5, vec2f(0.5))", "vec4f", functions=DRAWN, scene=scene, count=1)
    assert np.isfinite(got).all() and not got.any()


def test_emitter_samples_integrate_to_its_solid_angle(evaluate):
    """Mean of Le over density is Le times the solid angle: of a square lamp, at several places."""
    lamp = quad((-1, 2, -1), (2, 0, 0), (0, 0, 2), matte(0.0, "lamp", 1.5, double_sided=False))
    scene = scene_under(lamps=[lamp])
    origin = scene.bounds().mean(0)
    u = uniform(2**16)
    for at in ((0.0, 0.0, 0.0), (2.0, 0.5, 0.3), (0.3, 1.2, 0.2)):
        p = np.broadcast_to(np.array(at) - origin, (len(u), 3)).astype(np.float32)
        got = evaluate(LIGHTS, "weighed(p(i), u(i).z, u(i).xy)", "vec4f", functions=DRAWN, scene=scene, u=u, p=p)
        height = 2 - at[1]
        x, z = ([-1 - c, 1 - c] for c in (at[0], at[2]))
        # Of a rectangle seen from a point, over its corners.
        corner = [
            (-1) ** (i + j) * np.arctan(x[i] * z[j] / (height * np.sqrt(x[i] ** 2 + z[j] ** 2 + height**2)))
            for i in (0, 1)
            for j in (0, 1)
        ]
        values = got[:, 0].astype(np.float64)
        noise = values.std() / np.sqrt(len(u))
        assert abs(values.mean() - 1.5 * sum(corner)) < 4 * noise and noise < 0.02 * sum(corner)


def test_emitter_density_is_by_area_and_power(evaluate):
    """One of two lamps, four times as bright, gets more samples; each density is probability d2 / (area cos)."""
    dim, bright = (matte(0.0, emission=le, double_sided=False) for le in (1.0, 4.0))
    lamps = [quad((x, 2, -1), (1, 0, 0), (0, 0, 2), lamp) for x, lamp in ((-1, dim), (0, bright))]
    scene = scene_under(lamps=lamps)
    origin = scene.bounds().mean(0)
    functions = (
        DRAWN
        + """
fn checked(p: vec3f, choice: f32, u: vec2f) -> vec4f {
    let s = sample_light(p, choice, u);
    let cosine = s.direction.y;
    return vec4f(s.pdf * cosine / dot(s.to_light, s.to_light), s.weighted.x * s.pdf, s.to_light.x + p.x, 0.0);
}
"""
    )
    u = uniform(20_000)
    p = np.broadcast_to(np.array((0.2, 0.1, 0.3)) - origin, (len(u), 3)).astype(np.float32)
    got = evaluate(LIGHTS, "checked(p(i), u(i).z, u(i).xy)", "vec4f", functions=functions, scene=scene, u=u, p=p)
    right = got[:, 2] + origin[0] > 0
    share = right.mean()
    assert 0.5 < share < 0.8
    assert np.allclose(got[right, 0], share / 2.0, rtol=0.03)
    assert np.allclose(got[~right, 0], (1 - share) / 2.0, rtol=0.03)
    assert np.allclose(got[right, 1], 4.0, rtol=1e-4) and np.allclose(got[~right, 1], 1.0, rtol=1e-4)


def test_density_of_an_emitter_hit_matches_that_of_its_samples(evaluate):
    """The density computed where a ray hits a lamp equals that of the light sample in its direction."""
    lamp = sphere((0, 3, 0), 0.5, 2, matte(0.0, "lamp", 2.0, double_sided=False))
    lamp.positions[:, 0] *= 1.7
    scene = scene_under(lamps=[lamp], lights=[PointLight((0, 1, 0), 3.0)])
    origin = scene.bounds().mean(0)
    functions = (
        DRAWN
        + """
#import "scene/trace.wgsl"
fn both(p: vec3f, choice: f32, u: vec2f) -> vec4f {
    let s = sample_light(p, choice, u);
    if (s.pdf <= 0.0) {
        return vec4f(0.0);
    }
    let hit = trace(Ray(p, s.direction), FLOAT_MAX);
    if (hit.triangle == NONE) {
        return vec4f(s.pdf, 0.0, 0.0, 2.0);
    }
    let surface = surface_at(hit, s.direction);
    let cosine = abs(dot(surface.geometric_normal, s.direction));
    let pdf = surface.emitter_pdf * hit.distance * hit.distance / cosine;
    return vec4f(s.pdf, pdf, length(s.to_light) - hit.distance, 1.0);
}
"""
    )
    u = uniform(20_000)
    p = np.broadcast_to(np.array((0.2, 0.1, 0.3)) - origin, (len(u), 3)).astype(np.float32)
    got = evaluate(LIGHTS, "both(p(i), u(i).z, u(i).xy)", "vec4f", functions=functions, scene=scene, u=u, p=p)
    drawn = got[:, 3] > 0
    assert 0.1 < drawn.mean() < 0.9
    same = (got[:, 3] == 1) & (np.abs(got[:, 2]) < 1e-4)
    # Near the silhouette a ray may slip past an edge, or meet the neighbouring triangle.
    assert same[drawn].mean() > 0.95
    relative = got[same, 1] / got[same, 0]
    assert np.quantile(np.abs(relative - 1), 0.99) < 0.01
