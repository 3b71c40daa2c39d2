"""Direct light of an occluded environment against the path tracer."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.pictures import shoot, translation
from helpers.skies import gradient_sky

from wgpu_gi.camera import Camera
from wgpu_gi.measure.metrics import bias, relmse
from wgpu_gi.renderer import CameraSettings, Renderer, Settings
from wgpu_gi.scene.built_in.scenes import courtyard
from wgpu_gi.scene.built_in.shapes import grid, quad, sphere
from wgpu_gi.scene.scene import Environment, Image, Instance, Material, Scene, Texture

SIZE = (96, 54)
# Environments, and the most bias and relMSE of the default preset.
SKIES = {
    "constant": (Environment((0.15, 0.2, 0.28)), 0.01, 0.02),
    "gradient": (Environment(image=gradient_sky(64)), 0.03, 0.02),
    "sun": (Environment(image=gradient_sky(64, 2000.0)), 0.03, 0.03),
}


def courtyard_under(environment):
    scene = courtyard()
    scene.lights, scene.environment = [], environment
    return scene


@pytest.mark.parametrize("name", SKIES)
def test_occluded_environment_agrees_with_the_path_tracer(name):
    environment, most_bias, most_error = SKIES[name]
    scene = courtyard_under(environment)
    truth = shoot(scene, SIZE, show=("direct", "depth"), bounces=0, spp=256)
    settings = Settings(gi="many-light", bounces=0, diffuse=True, camera=CameraSettings(jitter=False))
    renderer = Renderer(scene, size=SIZE, settings=settings)
    renderer.run(show=("direct",), check=True)
    seen = truth["depth"] > 0
    got, wanted = renderer.read_back("direct")[seen], truth["direct"][seen]
    assert abs(bias(got, wanted)) <= most_bias
    assert relmse(got, wanted) <= most_error


def test_an_unoccluded_sky_has_visibility_one():
    """A floor without occluders: sampled visibility is 1 without noise, for any picture."""
    scene = courtyard_under(Environment(image=gradient_sky(16, 50.0)))
    scene.instances = scene.instances[-1:]
    pictures = []
    for rays in (0, 1):
        settings = Settings(gi="many-light", bounces=0, diffuse=True, camera=CameraSettings(jitter=False, frames=2))
        settings.environment.rays = rays
        renderer = Renderer(scene, size=SIZE, settings=settings)
        renderer.run(show=("direct",))
        pictures.append(renderer.read_back("direct"))
    assert pictures[0].any()
    assert np.allclose(pictures[0], pictures[1], rtol=1e-4)


def white_balls(roughness, metallic):
    """Three white balls side by side, a tenth of a radius apart, in a white sky."""
    scene = Scene(environment=Environment(), cameras=[Camera.look_at((0, 0, 6.5), (0, 0, 0), yfov_deg=36.0)])
    for k in (-1, 0, 1):
        ball = sphere(subdivisions=4, material=Material(roughness=roughness, metallic=metallic))
        ball.normals = (ball.positions / np.linalg.norm(ball.positions, axis=1, keepdims=True)).astype(np.float32)
        scene.instances.append(Instance(ball, translation(2.1 * k, 0, 0)))
    return scene


@pytest.mark.parametrize("roughness, metallic", [(0.1, 1.0), (0.5, 1.0), (0.3, 0.0)])
def test_balls_side_by_side_reflect_the_sky_that_their_lobes_see(roughness, metallic):
    """Direct light of the sky equals the path tracer's within 1 %: the lobes see less sky than the hemispheres."""
    scene = white_balls(roughness, metallic)
    got = [
        shoot(scene, (48, 27), show=("direct", "depth"), gi=gi, bounces=0, diffuse=False, spp=128)
        for gi in ("path", "many-light")
    ]
    wanted, light = (picture["direct"][picture["depth"] > 0] for picture in got)
    assert abs(bias(light, wanted)) <= 0.01


@pytest.mark.parametrize("roughness", [0.1, 0.5])
def test_a_glossy_floor_beside_a_wall_reflects_the_sky_beyond_it(roughness):
    """A metal floor before a black wall, still picture: single pixels agree with the path tracer, too."""
    floor = quad((-4, 0, 2), (8, 0, 0), (0, 0, -6), Material(roughness=roughness, metallic=1.0))
    wall = quad((-1, 0, -2), (2, 0, 0), (0, 1.5, 0), Material(base_color=(0, 0, 0, 1), metallic=1.0))
    camera = Camera.look_at((0, 1.5, 4), (0, 0.3, -1), yfov_deg=40)
    scene = Scene([Instance(floor), Instance(wall)], environment=Environment(), cameras=[camera])
    truth = shoot(scene, (32, 18), show=("direct", "depth"), bounces=0, diffuse=False, spp=256)
    settings = Settings(gi="many-light", bounces=0, camera=CameraSettings(jitter=False, frames=16))
    renderer = Renderer(scene, size=(32, 18), settings=settings)
    renderer.run(show=("direct",))
    seen = truth["depth"] > 0
    got, wanted = renderer.read_back("direct")[seen], truth["direct"][seen]
    assert abs(bias(got, wanted)) <= 0.02
    assert relmse(got, wanted) <= 0.02


def test_a_floor_with_a_tilted_normal_map_reflects_the_sky_as_in_the_path_tracer():
    """A sheet seen at grazing angles, where tilted normals are turned to the viewer: directions below it count, too."""
    sheet = grid(8.0, 1, Material(), (0.0, 0.0, -3.0))
    sheet.texcoords0 = (0.25 * sheet.positions[:, [0, 2]]).astype(np.float32)
    tilts = np.array([[[0.6, 0.5, 0.62], [-0.6, 0.2, 0.77]], [[0.0, 0.8, 0.6], [0.3, -0.7, 0.65]]])
    pixels = np.round(np.concatenate([tilts * 0.5 + 0.5, np.ones((2, 2, 1))], -1) * 255).astype(np.uint8)
    sheet.materials[0].normal_texture = Texture(Image(pixels), filter="nearest")
    camera = Camera.look_at((0, 0.8, 2), (0, 0, -2), yfov_deg=40)
    scene = Scene([Instance(sheet)], environment=Environment(), cameras=[camera])
    path, light = (
        shoot(scene, (48, 27), show=("direct", "depth"), gi=gi, bounces=0, diffuse=False, spp=128)
        for gi in ("path", "many-light")
    )
    assert abs(bias(light["direct"][path["depth"] > 0], path["direct"][path["depth"] > 0])) <= 0.01
