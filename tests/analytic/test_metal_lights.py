"""Virtual point lights on metals: what a metal throws on other surfaces, against the path tracer."""

from __future__ import annotations

import numpy as np
import pytest

from wgpu_gi.camera import Camera
from wgpu_gi.renderer import Settings
from wgpu_gi.rendering import render
from wgpu_gi.scene.built_in.scenes import matte
from wgpu_gi.scene.built_in.shapes import quad
from wgpu_gi.scene.scene import DirectionalLight, Environment, Instance, Material, PointLight, Scene

SUN = DirectionalLight((0.1, -1.0, -0.7), 3.0)
LAMP = PointLight((0.2, 1.5, 1.2), 5.0)


def plate_and_wall(roughness, lights=(), emission=0.0, sky=False, ceiling=False):
    """A metal plate of 2 x 2 m on the ground before a white wall, and perhaps a ceiling over both."""
    metal = Material(base_color=(0.9, 0.7, 0.4, 1.0), metallic=1.0, roughness=roughness)
    meshes = [quad((-1, 0, -1), (0, 0, 2), (2, 0, 0), metal), quad((-2, 0.2, -2.2), (4, 0, 0), (0, 4, 0), matte(0.7))]
    if ceiling:
        meshes.append(quad((-2, 3, -2), (4, 0, 0), (0, 0, 4), matte(0.6)))
    if emission:
        shining = matte(0.0, emission=emission, double_sided=True)
        meshes.append(quad((-0.4, 1.4, 1.2), (0.8, 0, 0), (0, 0.4, -0.4), shining))
    return Scene([Instance(mesh) for mesh in meshes], list(lights), Environment() if sky else None)


def wall_light(scene, gi, bounces, **fields):
    """Return the indirect light of the wall, (18, 32, 3)."""
    camera = Camera.look_at((0, 1.2, 1.8), (0, 1.2, -2.2), yfov_deg=57)
    chosen = {"gi": gi, "bounces": bounces, "size": (32, 18), "camera": camera, "show": "indirect", **fields}
    return np.asarray(render(scene, **chosen), np.float64)


@pytest.mark.parametrize(
    ("scene", "bounces"),
    [
        (plate_and_wall(0.2, [SUN]), 1),
        (plate_and_wall(0.4, [LAMP]), 1),
        (plate_and_wall(0.5, emission=8.0), 1),
        (plate_and_wall(0.5, sky=True), 1),
        (plate_and_wall(0.4, [SUN], ceiling=True), 2),
    ],
    ids=["sun, 0.2", "lamp, 0.4", "emitter, 0.5", "sky, 0.5", "two bounces, 0.4"],
)
def test_a_metal_throws_its_light_on_a_wall(scene, bounces):
    """The light has the direction of the lobe: the picture agrees, not only its mean."""
    truth = wall_light(scene, "path", bounces, spp=512)
    found = wall_light(scene, "many-light", bounces)
    assert abs(found.mean() / truth.mean() - 1) < 0.03
    # Averages over blocks of 4 x 3 pixels take away the truth's noise.
    blocks, true_blocks = (values.reshape(6, 3, 8, 4, 3).mean((1, 3)) for values in (found, truth))
    assert np.abs(blocks - true_blocks).max() < 0.15 * true_blocks.max()


def test_a_rough_metal_differs_from_a_matte_surface_by_its_lobe_only():
    """At roughness 1 what the coat scatters more than once leaves like diffuse light, which errs little."""
    scene = plate_and_wall(1.0, [SUN])
    assert abs(wall_light(scene, "many-light", 1).mean() / wall_light(scene, "path", 1, spp=512).mean() - 1) < 0.04


def test_exact_visibility_and_drawn_rays_find_the_same_light_of_a_metal():
    """The gathering of all lights and of drawn lights evaluate the same lobe."""
    scene = plate_and_wall(0.3, [SUN])
    exact = Settings()
    exact.gather.visibility = "exact"
    assert np.isclose(
        wall_light(scene, "many-light", 1, settings=exact).mean(), wall_light(scene, "many-light", 1).mean(), rtol=0.02
    )


@pytest.mark.parametrize(("metallic", "roughness"), [(1.0, 0.05), (1.0, 0.3), (1.0, 0.6), (0.0, 0.1)])
def test_a_coat_reflects_a_lit_wall(metallic, roughness):
    """By rays, without blur. The sun lights the wall behind the floor, not the floor."""
    color = (0.9, 0.7, 0.4, 1.0) if metallic else (0.0, 0.0, 0.0, 1.0)
    floor = Material(base_color=color, metallic=metallic, roughness=roughness)
    meshes = [quad((-3, 0, -2), (0, 0, 4), (6, 0, 0), floor), quad((-3, 0, -2), (6, 0, 0), (0, 3, 0), matte(0.7))]
    scene = Scene([Instance(mesh) for mesh in meshes], [DirectionalLight((0.1, 0.0, -1.0), 3.0)])
    camera = Camera.look_at((0, 1.5, 3.0), (0, 0.0, 0.0), yfov_deg=40)
    common = {"bounces": 1, "size": (32, 18), "camera": camera, "show": "indirect"}
    truth = np.asarray(render(scene, gi="path", spp=512, **common), np.float64)
    sharp = Settings()
    sharp.denoise.radius, sharp.camera.frames = 1, 96
    found = np.asarray(render(scene, gi="many-light", settings=sharp, **common), np.float64)
    assert abs(found.mean() / truth.mean() - 1) < 0.01
    blocks, true_blocks = (values.reshape(6, 3, 8, 4, 3).mean((1, 3)) for values in (found, truth))
    assert np.abs(blocks - true_blocks).max() < 0.06 * true_blocks.max()


def test_a_metal_lights_the_corner_that_it_makes_with_a_wall():
    """Photons have no bound, and their lobes are not widened: the lowest rows of the wall agree, too."""
    metal = Material(base_color=(0.9, 0.7, 0.4, 1.0), metallic=1.0, roughness=0.2)
    meshes = [quad((-1, 0, -2), (0, 0, 3), (2, 0, 0), metal), quad((-2, 0, -2), (4, 0, 0), (0, 4, 0), matte(0.7))]
    scene = Scene([Instance(mesh) for mesh in meshes], [SUN])
    camera = Camera.look_at((0, 0.4, 1.0), (0, 0.4, -2), yfov_deg=20)
    common = {"bounces": 1, "size": (32, 18), "camera": camera, "show": "indirect"}
    truth = np.asarray(render(scene, gi="path", spp=4096, **common), np.float64)
    found = np.asarray(render(scene, gi="many-light", **common), np.float64)
    for rows in (slice(0, 10), slice(10, 16)):  # the metal meets the wall in row 16
        assert abs(found[rows].mean() / truth[rows].mean() - 1) < 0.04


def test_reflections_have_the_bounces_that_are_asked_for():
    """A mirror-like floor in a white box: a third bounce would add a third."""
    floor = Material(base_color=(0.9, 0.9, 0.9, 1.0), metallic=1.0, roughness=0.1)
    sides = [
        quad((-1, 0, -1), (0, 0, 2), (2, 0, 0), floor),
        quad((-1, 2, -1), (2, 0, 0), (0, 0, 2), matte(0.8)),
        quad((-1, 0, -1), (2, 0, 0), (0, 2, 0), matte(0.8)),
        quad((-1, 0, 1), (0, 2, 0), (2, 0, 0), matte(0.8)),
        quad((-1, 0, -1), (0, 2, 0), (0, 0, 2), matte(0.8)),
        quad((1, 0, -1), (0, 0, 2), (0, 2, 0), matte(0.8)),
    ]
    scene = Scene([Instance(mesh) for mesh in sides], [PointLight((0.2, 1.2, 0.3), 5.0)])
    camera = Camera.look_at((0, 1.0, 0.9), (0, 0, -0.2), yfov_deg=40)
    common = {"bounces": 2, "size": (32, 18), "camera": camera, "show": "indirect"}
    truth = np.asarray(render(scene, gi="path", spp=512, **common), np.float64)
    found = np.asarray(render(scene, gi="many-light", **common), np.float64)
    assert abs(found.mean() / truth.mean() - 1) < 0.02
