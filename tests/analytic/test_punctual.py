"""Point lights, spots and suns on a plane: every pixel has its closed form, without noise."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers.pictures import shoot

from wgpu_gi.scene.built_in import scenes as builtin
from wgpu_gi.scene.scene import DirectionalLight, PointLight, SpotLight

EXACT = 1e-5  # relative: float32 rounding of a few operations


def assert_pixels(picture, expected):
    """Compare an (h, w, 3) picture with (h, w) values."""
    assert np.allclose(picture, expected[..., None], rtol=EXACT, atol=EXACT * expected.max())


def floor_points(size, height=4.0):
    """World points of the pixel centres of `plane_point`'s camera, (h, w, 3)."""
    x = (np.arange(size[0]) + 0.5) / size[0] * height * size[0] / size[1]
    z = (np.arange(size[1]) + 0.5) / size[1] * height
    x, z = np.meshgrid(x - height * size[0] / size[1] / 2, z - height / 2)
    return np.stack([x, np.zeros_like(x), z], -1)


@pytest.mark.parametrize("distance", [1.0, 2.0, 4.0])
def test_plane_under_a_point_light_has_its_closed_form(distance):
    """E = I cos/d2, L = rho E/pi at distance d, 2d and 4d, and all around the foot of the light."""
    size = (15, 9)
    got = shoot(builtin.plane_point(distance, intensity=10.0, albedo=0.5), size, spp=4)
    points = floor_points(size)
    squared = distance**2 + (points**2).sum(-1)
    assert_pixels(got["radiance"], 0.5 / math.pi * 10.0 * distance / squared**1.5)
    assert got["radiance"][4, 7, 0] == pytest.approx(0.5 / math.pi * 10.0 / distance**2, rel=EXACT)


def test_point_light_out_of_view_has_its_closed_form():
    """A tinted light out of view; a single plane has no indirect light."""
    scene, size = builtin.plane_point(), (9, 9)
    scene.lights = [PointLight((3.0, 0.5, -2.5), 7.0, (1.0, 0.5, 0.25))]
    got = shoot(scene, size, spp=4, show=("radiance", "direct", "indirect"))
    to_light = np.array([3.0, 0.5, -2.5]) - floor_points(size)
    squared = (to_light**2).sum(-1)
    expected = 0.5 / math.pi * 7.0 * 0.5 / squared**1.5
    assert np.allclose(got["radiance"], expected[..., None] * [1.0, 0.5, 0.25], rtol=EXACT)
    assert np.array_equal(got["radiance"], got["direct"]) and not got["indirect"].any()


@pytest.mark.parametrize("zenith", [0.0, 60.0, 89.0])
def test_plane_in_the_sun_has_its_closed_form(zenith):
    """E = lux cos."""
    got = shoot(builtin.plane_sun(3.0, zenith, 0.5), (8, 8), spp=4)
    expected = 0.5 * 3.0 * math.cos(math.radians(zenith)) / math.pi
    assert np.allclose(got["radiance"], expected, rtol=EXACT)


def test_lights_below_the_floor_do_not_shine_on_it():
    scene = builtin.plane_sun(3.0, 91.0)
    scene.lights += [DirectionalLight((0.0, 1.0, 0.0)), PointLight((0.5, -1.0, 0.0), 100.0)]
    assert not shoot(scene, (8, 8), spp=4)["radiance"].any()


def test_length_of_a_direction_does_not_matter():
    scene = builtin.plane_point()
    for length in (1e-3, 1e3):
        scene.lights = [DirectionalLight((0.0, -length, 0.0), math.pi)]
        assert np.allclose(shoot(scene, (4, 4), spp=1)["radiance"], 0.5, rtol=EXACT)


@pytest.mark.parametrize("direction", [(0.0, -1.0, 0.0), (0.6, -2.0, -0.3)])
def test_spot_follows_the_formula_of_gltf(direction):
    """Full inside the inner cone, saturate((cos - cos outer)/(cos inner - cos outer))^2 between, nothing outside."""
    scene, size = builtin.plane_point(), (33, 33)
    inner, outer = math.radians(15), math.radians(40)
    position = np.array([0.0, 2.0, 0.0])
    scene.lights = [SpotLight(position.tolist(), direction, inner, outer, 10.0)]
    picture = shoot(scene, size, spp=4)["radiance"]
    travel = floor_points(size) - position
    distance = np.linalg.norm(travel, axis=-1)
    cosine = travel @ (np.array(direction) / np.linalg.norm(direction)) / distance
    falloff = np.clip((cosine - math.cos(outer)) / (math.cos(inner) - math.cos(outer)), 0, 1) ** 2
    assert_pixels(picture, 0.5 / math.pi * 10.0 * 2.0 / distance**3 * falloff)
    assert (falloff == 1).any() and (falloff == 0).any()
    assert not picture[cosine < math.cos(outer) - 1e-6].any()


def test_spot_half_way_between_its_cones_has_the_fall_off():
    """Straight below a spot that is tilted to half-way between its cones."""
    scene = builtin.plane_point()
    inner, outer = math.radians(20), math.radians(40)
    tilt = math.radians(30)
    scene.lights = [SpotLight((0.0, 2.0, 0.0), (math.sin(tilt), -math.cos(tilt), 0.0), inner, outer, 10.0)]
    falloff = ((math.cos(tilt) - math.cos(outer)) / (math.cos(inner) - math.cos(outer))) ** 2
    got = shoot(scene, (5, 5), spp=1)["radiance"]
    assert got[2, 2, 0] == pytest.approx(0.5 / math.pi * 10.0 / 4.0 * falloff, rel=EXACT)


def test_spot_of_equal_cones_has_a_hard_edge():
    """Equal cones are a step (KHR_lights_punctual divides by at least 0.001)."""
    scene = builtin.plane_point()
    cone = math.radians(30)
    scene.lights = [SpotLight((0.0, 2.0, 0.0), (0.0, -1.0, 0.0), cone, cone, 10.0)]
    picture, points = shoot(scene, (21, 21), spp=1)["radiance"][..., 0], floor_points((21, 21))
    radius = np.hypot(points[..., 0], points[..., 2])
    inside = radius < 2.0 * math.tan(cone) - 0.02
    full = 0.5 / math.pi * 10.0 * 2.0 / (4 + radius**2) ** 1.5
    assert np.allclose(picture[inside], full[inside], rtol=EXACT)
    assert not picture[radius > 2.0 * math.tan(cone)].any()
