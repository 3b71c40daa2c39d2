"""Environment light in the path tracer: white furnaces, irradiance of a picture, and its orientation."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers.pictures import assert_mean, looking, shoot

from wgpu_gi.scene.built_in import scenes as builtin
from wgpu_gi.scene.built_in.scenes import matte
from wgpu_gi.scene.built_in.shapes import box, quad
from wgpu_gi.scene.scene import Environment, Instance, Material, Scene

AXES = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]


def pictured(height=8, width=16, value=1.0):
    return Environment(image=np.full((height, width, 3), value, np.float32))


@pytest.mark.parametrize("albedo", [0.2, 0.8])
def test_furnace_with_constant_sky_shows_the_albedo(albedo):
    """A convex body of albedo rho in a sky of radiance 1 shows rho, without noise."""
    got = shoot(builtin.furnace(albedo), (24, 24), spp=4, show=("radiance", "depth"))
    seen = got["depth"] > 0
    assert np.allclose(got["radiance"][seen], albedo, rtol=1e-5)
    assert np.all(got["radiance"][~seen] == 1.0) and seen.any() and not seen.all()


def test_furnace_with_pictured_sky_shows_the_tinted_albedo():
    """A tinted picture of constant 1, found by light sampling, has the same closed form."""
    scene = builtin.furnace(0.5)
    scene.environment = pictured()
    scene.environment.color, scene.environment.rotation = (1.0, 2.0, 0.25), 0.7
    got = shoot(scene, (24, 24), spp=128, show=("radiance", "standard_error", "depth"))
    assert_mean(got, np.array([0.5, 1.0, 0.125]), where=got["depth"] > 0)
    assert np.allclose(got["radiance"][got["depth"] == 0], (1.0, 2.0, 0.25), rtol=1e-5)


def test_white_room_in_a_white_sky_is_white():
    """A room of albedo 1 with one open side, lit by the sky alone: after many bounces L = 1 everywhere."""
    room = box((-1, -1, -1), (1, 1, 1), matte(1.0), inward=True)
    room.triangles = room.triangles[:10]  # without the side towards +Z
    scene = Scene([Instance(room)], environment=Environment())
    got = shoot(scene, (16, 16), spp=256, camera=looking((0.3, 0.2, -1), (0, 0, 0.5)))
    assert_mean(got, 1.0)


@pytest.mark.parametrize(("metallic", "roughness", "bound"), [(1.0, 0.3, 0.005), (0.5, 0.5, 0.01), (0.0, 0.3, 0.02)])
def test_white_room_of_coated_walls_is_white(metallic, roughness, bound):
    """The same room of metal, of a dielectric and of a mixture: the BRDF conserves energy over many bounces."""
    room = box((-1, -1, -1), (1, 1, 1), Material("white", metallic=metallic, roughness=roughness), inward=True)
    room.triangles = room.triangles[:10]
    scene = Scene([Instance(room)], environment=Environment())
    camera = looking((0.3, 0.2, -1), (0, 0, 0.5))
    assert_mean(shoot(scene, (16, 16), spp=512, camera=camera, diffuse=False), 1.0, bound)


def sky_gradient(height=16, width=32):
    """A picture whose light differs in every direction, with a sun of a few pixels."""
    y, x = np.mgrid[:height, :width]
    image = 0.3 + 0.2 * np.stack([np.sin(2 * np.pi * x / width), np.cos(2 * np.pi * x / width), y / height], -1)
    image[height // 3 : height // 3 + 2, width // 5] = (5.0, 4.0, 3.0)
    return image.astype(np.float32)


def environment_radiance(image, directions, rotation=0.0):
    """Bilinear look-up by the convention: u = atan2(x, -z)/2pi + rotation/2pi, v = acos(y)/pi, row 0 on top."""
    d = np.asarray(directions, np.float64)
    height, width = image.shape[:2]
    u = np.arctan2(d[..., 0], -d[..., 2]) / (2 * np.pi) + rotation / (2 * np.pi)
    x, y = (u % 1) * width - 0.5, np.arccos(np.clip(d[..., 1], -1, 1)) / np.pi * height - 0.5
    x0, y0 = np.floor(x).astype(int), np.floor(y).astype(int)
    fx, fy = (x - x0)[..., None], (y - y0)[..., None]
    rows, columns = [np.clip(y0 + k, 0, height - 1) for k in (0, 1)], [(x0 + k) % width for k in (0, 1)]
    top, low = (image[r, columns[0]] * (1 - fx) + image[r, columns[1]] * fx for r in rows)
    return top * (1 - fy) + low * fy


def irradiance(image, normal, rotation=0.0):
    """Integrate radiance times cosine over the sphere by the midpoint rule, (3,)."""
    theta, phi = (np.arange(720) + 0.5) / 720 * np.pi, (np.arange(1440) + 0.5) / 1440 * 2 * np.pi
    theta, phi = np.meshgrid(theta, phi, indexing="ij")
    d = np.stack([np.sin(theta) * np.sin(phi), np.cos(theta), -np.sin(theta) * np.cos(phi)], -1)
    weight = np.maximum(d @ np.asarray(normal, np.float64), 0) * np.sin(theta) * (np.pi / 720) * (2 * np.pi / 1440)
    return (environment_radiance(image, d, rotation) * weight[..., None]).sum((0, 1))


@pytest.mark.parametrize("normal", AXES)
def test_irradiance_of_a_picture_equals_quadrature(normal):
    """L = rho E / pi on the six sides of a cube, E by quadrature; the sun is found by light sampling."""
    image, rotation = sky_gradient(), 0.4
    cube = Instance(box((-1, -1, -1), (1, 1, 1), matte(0.5)))
    scene = Scene([cube], environment=Environment(image=image, rotation=rotation))
    towards = -np.array(normal, np.float64)
    got = shoot(scene, (21, 21), spp=512, camera=looking(towards, -2 * towards, height=1.0))
    assert_mean(got, 0.5 / math.pi * irradiance(image, normal, rotation))


def directions():
    rng = np.random.default_rng(1)
    near_poles = [(1e-3, 1, 0), (0, -1, 1e-3)]  # at the poles themselves u is any
    d = np.concatenate([[a for a in AXES if not a[1]], near_poles, rng.normal(size=(10, 3))])
    return d / np.linalg.norm(d, axis=1, keepdims=True)


@pytest.mark.parametrize("rotation", [0.0, 2.0])
def test_camera_sees_the_picture_in_the_right_place(rotation):
    """-Z at the left edge, +X at a quarter, +Y on top."""
    image = np.random.default_rng(0).uniform(0.1, 1, (8, 16, 3)).astype(np.float32)
    far_away = Instance(quad((1e3, -1e4, 0), (1, 0, 0), (0, 0, 1)))
    scene = Scene([far_away], environment=Environment(image=image, rotation=rotation))
    for direction in directions():
        got = shoot(scene, (3, 3), spp=1, camera=looking(direction), show=("radiance",))["radiance"]
        assert np.allclose(got[1, 1], environment_radiance(image, direction, rotation), atol=2e-5)


def test_quadrants_of_the_picture_face_their_axes():
    """Four colours in a row, seen along -Z, +X, +Z and -X; each is centred on its axis after an eighth of a turn."""
    colours = np.eye(4, 3) + np.array([[0.0], [0.0], [0.0], [0.5]])
    image = np.repeat(colours[None], 2, 0).astype(np.float32)
    scene = Scene([], environment=Environment(image=image, rotation=2 * np.pi / 8))
    for axis, colour in zip([(0, 0, -1), (1, 0, 0), (0, 0, 1), (-1, 0, 0)], colours, strict=True):
        assert np.allclose(shoot(scene, (1, 1), spp=1, camera=looking(axis))["radiance"][0, 0], colour, atol=1e-5)


def test_gold_mirror_in_a_furnace_reflects_by_schlicks_formula():
    """A smooth metal reflects f0 + (1 - f0)(1 - cos)^5 of a sky of 1; at normal incidence, its base colour."""
    gold = Material("gold", (1.0, 0.71, 0.29, 1.0), metallic=1.0, roughness=0.0)
    scene = Scene([Instance(quad((-2, -2, 0), (4, 0, 0), (0, 4, 0), gold))], environment=pictured())
    f0 = np.array(gold.base_color[:3])
    for degrees in (0, 60, 80):
        sine, cosine = math.sin(math.radians(degrees)), math.cos(math.radians(degrees))
        camera = looking((-sine, 0, -cosine), (2 * sine, 0, 2 * cosine), height=0.1)
        got = shoot(scene, (8, 8), spp=64, camera=camera, diffuse=False)
        assert_mean(got, f0 + (1 - f0) * (1 - cosine) ** 5)


def test_mirror_shows_the_picture():
    """A smooth silver mirror at 45 degrees shows the picture in the mirrored direction."""
    silver = Material("silver", metallic=1.0, roughness=0.0)
    image = sky_gradient(32, 64)
    mirror = quad((-2, -2, 2), (4, 0, -4), (0, 4, 0), silver)  # normal (-1, 0, -1) / sqrt 2
    scene = Scene([Instance(mirror)], environment=Environment(image=image))
    camera = looking((0, 0.2, 1), (0, 0, -3))
    got = shoot(scene, (5, 5), spp=64, camera=camera, diffuse=False)
    d = np.array([0, 0.2, 1]) / np.linalg.norm([0, 0.2, 1])
    n = np.array([-1, 0, -1]) / math.sqrt(2)
    expected = environment_radiance(image, d - 2 * (d @ n) * n)
    assert np.allclose(got["radiance"][2, 2], expected, rtol=0.01)


def test_mirror_shows_an_emitter():
    """L = f0 Le: only BRDF samples find this light, and it counts once."""
    silver = Material("silver", (0.9, 0.8, 0.7, 1.0), metallic=1.0, roughness=0.0)
    mirror = quad((-2, 0, 2), (4, 0, 0), (0, 0, -4), silver)
    lamp = quad((-5, 3, -5), (10, 0, 0), (0, 0, 10), matte(0.0, "lamp", 2.0, double_sided=False))
    scene = Scene([Instance(mirror), Instance(lamp)])
    got = shoot(scene, (8, 8), spp=64, camera=looking((0, -1, 0), (0, 1, 0), height=0.5), diffuse=False)
    assert_mean(got, 2.0 * np.array([0.9, 0.8, 0.7]))
