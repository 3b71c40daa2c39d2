"""Closed rooms, facing plates and a light in a sphere: interreflection, emitters and their sides."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers.pictures import assert_mean, shoot

from wgpu_gi.scene.built_in import scenes as builtin
from wgpu_gi.scene.built_in.scenes import matte, plates_form_factor
from wgpu_gi.scene.built_in.shapes import quad
from wgpu_gi.scene.scene import Instance, Mesh, PointLight, SpotLight


@pytest.mark.parametrize(("albedo", "spp"), [(0.2, 64), (0.5, 256), (0.8, 512)])
def test_closed_box_sums_all_bounces(albedo, spp):
    """L = Le / (1 - rho)."""
    got = shoot(builtin.closed_box(2.0, albedo), (32, 18), spp=spp)
    assert_mean(got, 2.0 / (1 - albedo))


@pytest.mark.parametrize("bounces", [0, 1, 2, 5])
def test_closed_box_after_n_bounces_has_the_partial_sum(bounces):
    """L = Le (1 + rho + ... + rho^(n + 1)): `bounces` counts indirect ones, direct light is one scattering."""
    got = shoot(builtin.closed_box(1.0, 0.5), (32, 18), spp=256, bounces=bounces)
    assert_mean(got, 2.0 - 0.5 ** (bounces + 1))


@pytest.mark.parametrize("distance", [0.5, 1.0, 2.0])
def test_two_plates_reflect_their_form_factor(distance):
    """Mean L = rho Le F with the form factor of two facing squares."""
    got = shoot(builtin.plates(distance, 3.0, 0.5), jitter=True, spp=1024)
    assert_mean(got, 0.5 * 3.0 * plates_form_factor(distance))


def plates_with(lamps):
    """Return `plates` with the lamp replaced by instances."""
    scene = builtin.plates()
    scene.instances[1:] = lamps
    return scene


def lamp_mesh(width=1.0, double_sided=False, up=False):
    """A lamp 1 m above the receiver, from x = -0.5 to width - 0.5, facing it or, with `up`, not."""
    edges = [(0, 0, 1), (width, 0, 0)] if up else [(width, 0, 0), (0, 0, 1)]
    return quad((-0.5, 1.0, -0.5), *edges, matte(0.0, "lamp", 1.0, double_sided))


def test_emitters_shine_from_their_front_only():
    away = shoot(plates_with([Instance(lamp_mesh(up=True))]), jitter=True, spp=16)
    assert not away["radiance"].any()


@pytest.mark.parametrize("up", [False, True])
def test_double_sided_emitters_shine_both_ways(up):
    got = shoot(plates_with([Instance(lamp_mesh(double_sided=True, up=up))]), jitter=True, spp=256)
    assert_mean(got, 0.5 * plates_form_factor())


def test_back_of_an_emitter_is_dark_to_the_camera():
    down, up = (
        shoot(plates_with([Instance(lamp_mesh(up=up))]), (1, 1), camera=camera, show=("emission",))["emission"]
        for up in (False, True)
        for camera in [builtin.Camera.look_at((0, 0.5, 0), (0, 1, 0))]
    )
    assert np.all(down == 1.0) and not up.any()


MIRROR_X = np.diag([-1.0, 1.0, 1.0, 1.0])


def test_mirrored_emitter_keeps_its_side():
    """A mirrored instance still shines from what was its counter-clockwise side (glTF 2.0, section 3.7.2.1)."""
    got = shoot(plates_with([Instance(lamp_mesh(), MIRROR_X)]), jitter=True, spp=256)
    assert_mean(got, 0.5 * plates_form_factor())
    away = shoot(plates_with([Instance(lamp_mesh(up=True), MIRROR_X)]), jitter=True, spp=16)
    assert not away["radiance"].any()


def test_two_mirrored_half_lamps_light_like_the_whole_lamp():
    """Two halves of the lamp, one the mirror image of the other, by instances of one mesh."""
    half = lamp_mesh(0.5)
    got = shoot(plates_with([Instance(half), Instance(half, MIRROR_X)]), jitter=True, spp=256)
    assert_mean(got, 0.5 * plates_form_factor())
    half = lamp_mesh(0.5, up=True)
    away = shoot(plates_with([Instance(half), Instance(half, MIRROR_X)]), jitter=True, spp=16)
    assert not away["radiance"].any()


def test_two_stretched_quarter_lamps_light_like_the_whole_lamp():
    """Areas and densities follow the transform: a quarter of the lamp, stretched to half of it, twice."""
    small = quad((-0.5, 1.0, -0.5), (0.25, 0, 0), (0, 0, 1), matte(0.0, "lamp", 1.0, double_sided=False))
    stretch = np.diag([2.0, 1.0, 1.0, 1.0])
    left, right = stretch.copy(), stretch.copy()
    left[0, 3], right[0, 3] = 0.5, 1.0
    got = shoot(plates_with([Instance(small, left), Instance(small, right)]), jitter=True, spp=256)
    assert_mean(got, 0.5 * plates_form_factor())


def test_emitters_of_different_power_light_by_their_mean():
    """Two lamps of one mesh, one three times as bright as the other, each half of the plate."""
    halves = lamp_mesh(0.5), lamp_mesh(0.5)
    dim, bright = (matte(0.0, name, le, double_sided=False) for name, le in (("dim", 0.5), ("bright", 1.5)))
    points = np.concatenate([m.positions for m in halves])
    points[4:, 0] *= -1
    triangles = np.concatenate([halves[0].triangles, halves[1].triangles[:, ::-1] + 4])
    lamp = Mesh(points, triangles, [dim, bright], np.array([0, 0, 1, 1], np.uint32))
    got = shoot(plates_with([Instance(lamp)]), jitter=True, spp=256)
    assert_mean(got, 0.5 * plates_form_factor())  # the mean of the receiver is symmetric in both


@pytest.mark.parametrize(("bounces", "factor"), [(0, 1.0), (1, 1.5), (None, 2.0)])
def test_point_light_in_a_sphere_has_its_closed_form(bounces, factor):
    """Direct L = rho I / (pi R2); bounces add rho, rho2 ... of it, uniformly."""
    got = shoot(builtin.sphere_light(2.0, 0.5, 10.0), (24, 24), spp=256, bounces=bounces)
    assert_mean(got, 0.5 * 10.0 / 4.0 / math.pi * factor)


@pytest.mark.parametrize("place", [(0.0, 0.0, 0.0), (1.2, 0.5, -0.3), (0.0, -1.95, 0.0)])
def test_interreflection_in_a_sphere_is_uniform_wherever_the_light_is(place):
    """Indirect L = rho2 / (1 - rho) I / (pi R2) in every pixel, even if most of it comes from one bright spot."""
    scene = builtin.sphere_light(2.0, 0.5, 10.0, subdivisions=5)
    scene.lights = [PointLight(place, 10.0)]
    got = shoot(scene, (16, 16), spp=256, show=("indirect",))
    expected = 0.5 * 0.5 / 0.5 * 10.0 / 4.0 / math.pi
    pixels = got["indirect"].reshape(-1, 3)
    assert pixels.mean(0) == pytest.approx(expected, rel=0.005)
    assert pixels.std() < 0.15 * expected


def test_spot_in_a_sphere_lights_by_its_flux():
    """Indirect light of a spot near the wall follows its flux: I times the integral of its fall-off over its cone."""
    scene = builtin.sphere_light(2.0, 0.5, subdivisions=5)
    inner, outer = math.radians(20), math.radians(50)
    scene.lights = [SpotLight((0.3, 1.5, 0.0), (0.2, 1.0, 0.1), inner, outer, 10.0)]
    a, b = math.cos(inner), math.cos(outer)
    flux = 10.0 * 2 * math.pi * ((1 - a) + (a - b) / 3)
    got = shoot(scene, (16, 16), spp=256, show=("indirect",))["indirect"]
    assert got.mean() == pytest.approx(0.5 * flux / (4 * math.pi * 4.0) / math.pi, rel=0.005)


@pytest.mark.parametrize("share", [1, 40])
def test_patch_of_a_sphere_lights_it_evenly(share):
    """Direct light of an emitting patch is E = Le A / (4 R2) everywhere on the sphere, all light E / (1 - rho)."""
    scene = builtin.sphere_light(2.0, 0.5, subdivisions=4)
    wall = scene.instances[0].mesh
    lamp = matte(0.5, "patch", 3.0, double_sided=False)
    corners = wall.positions[wall.triangles].astype(np.float64)
    # The triangles about +Z are behind the camera.
    patch = np.argsort(-corners.mean(1)[:, 2])[:share]
    wall.materials.append(lamp)
    wall.material_of_triangle = np.isin(np.arange(len(wall.triangles)), patch).astype(np.uint32)
    edges = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = 0.5 * np.linalg.norm(np.cross(*edges), axis=1)[patch].sum()
    scene.lights = []
    got = shoot(scene, (16, 16), spp=512, show=("direct", "radiance", "standard_error"))
    direct = 0.5 * 3.0 * area / (4 * math.pi * 4.0)
    assert got["direct"].mean() == pytest.approx(direct, rel=0.005)
    assert_mean(got, 2 * direct)


def test_no_light_leaves_a_sealed_chamber():
    """Without other lights the picture is exactly black."""
    scene = builtin.corridor(lamp=0.0)
    got = shoot(scene, (48, 27), spp=16)
    assert not got["radiance"].any()
