"""Blended surfaces and thin glass against closed forms: what is seen through them, and the light that passes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers.marks import slow_but
from helpers.panes import (
    BEHIND,
    F0,
    GLASS_COLORS,
    PASSED,
    blended,
    blended_radiance,
    floor_under,
    glass,
    glass_tint,
    stack_before,
)
from helpers.pictures import shoot

from wgpu_gi.options import TECHNIQUES
from wgpu_gi.renderer import Renderer, Settings
from wgpu_gi.scene.built_in.scenes import cornell_point
from wgpu_gi.scene.built_in.shapes import box, quad
from wgpu_gi.scene.scene import DirectionalLight, Environment, Image, Material, PointLight, SpotLight, Texture

DEFERRED = [name for name in TECHNIQUES if name != "path"]
LUMINANCE = np.array((0.2126, 0.7152, 0.0722))
SUN = DirectionalLight((0.3, -1.0, 0.2), 3.0)
LIGHTS = {
    "sun": SUN,
    "point": PointLight((0.1, 3.0, 0.05), 30.0),
    "spot": SpotLight((0.1, 3.0, 0.05), (0.0, -1.0, 0.0), 0.3, 0.6, 30.0),
}
# Relative error of the mean of 1024 pixels of 24 frames: 4 standard errors of independent choices of 3 surfaces.
SEEN = 0.02


def seen(scene, technique, **settings):
    """Return the means over a picture of radiance, emission and alpha."""
    found = shoot(
        scene, (32, 32), show=("radiance", "emission", "alpha"), gi=technique, spp=32, jitter=True, **settings
    )
    return {name: picture.mean((0, 1)) for name, picture in found.items()}


def passed_share(scene, technique, size=(12, 12), **settings):
    """Return the direct light of a picture over that without panes."""
    arguments = {"show": ("direct",), "gi": technique, "bounces": 0, **settings}
    under = shoot(scene, size, **arguments)["direct"]
    scene.instances = [i for i in scene.instances if i.mesh.materials[0].alpha_mode == "opaque"]
    scene.instances = [i for i in scene.instances if i.mesh.materials[0].transmission == 0]
    return under / shoot(scene, size, **arguments)["direct"]


@pytest.mark.parametrize("wall", slow_but((False,), (True, False)))
@pytest.mark.parametrize("technique", slow_but(("path", "none"), TECHNIQUES))
def test_blended_panes_show_what_lies_behind(technique, wall):
    """L = sum_i c_i a_i prod_j<i (1 - a_j) + prod (1 - a) L_behind; alpha is 1 - prod (1 - a) before the sky."""
    found = seen(stack_before(blended(), wall), technique)
    np.testing.assert_allclose(found["radiance"], blended_radiance(), rtol=SEEN)
    assert found["alpha"] == pytest.approx(1.0 if wall else 1 - PASSED, rel=0.01)


@pytest.mark.parametrize("technique", slow_but(("none",), TECHNIQUES))
def test_glass_tints_what_lies_behind(technique):
    """L = prod_i c_i (1 - F) L_behind; alpha is 1 minus the luminance of the tint."""
    found = seen(stack_before(glass(), False), technique, diffuse=False)
    np.testing.assert_allclose(found["emission"], np.array(BEHIND) * glass_tint(1.0), rtol=SEEN)
    assert found["alpha"] == pytest.approx(1 - glass_tint(1.0) @ LUMINANCE, rel=0.01)


@pytest.mark.parametrize("light", slow_but(("point",), LIGHTS))
@pytest.mark.parametrize("technique", slow_but(("path", "none"), TECHNIQUES))
def test_the_shadow_of_blended_panes_has_no_noise(technique, light):
    """V = prod (1 - a) in every pixel of every frame."""
    share = passed_share(floor_under(blended(), [LIGHTS[light]]), technique, spp=2)
    np.testing.assert_allclose(share, PASSED, rtol=2e-6)


@pytest.mark.parametrize("technique", slow_but(("path",), TECHNIQUES))
def test_the_shadow_of_coloured_glass_is_the_product_of_tints(technique):
    share = passed_share(floor_under(glass(), [SUN]), technique, spp=2, diffuse=False)
    cosine = 1 / math.hypot(0.3, 1.0, 0.2)
    np.testing.assert_allclose(share, np.broadcast_to(glass_tint(cosine), share.shape), rtol=2e-6)


@pytest.mark.parametrize("technique", slow_but(("none",), DEFERRED))
def test_deferred_shadows_pass_solid_glass_straight(technique):
    """V = (c (1 - F))^2 exp(-sigma d) of a slab 0.5 m thick, for both of its sides."""
    sigma, color = np.array((0.5, 1.0, 2.0)), (0.9, 0.8, 0.7)
    solid = Material(base_color=(*color, 1.0), transmission=1.0, roughness=0.3, thickness=0.5)
    solid.attenuation_distance, solid.attenuation_color = 1.0, tuple(np.exp(-sigma))
    scene = floor_under([], [SUN], lamps=[box((-20, 1, -20), (20, 1.5, 20), solid)])
    share = passed_share(scene, technique, diffuse=False)
    stretch = math.hypot(0.3, 1.0, 0.2)
    wall = np.array(color) * (1 - F0 - (1 - F0) * (1 - 1 / stretch) ** 5)
    np.testing.assert_allclose(share, np.broadcast_to(wall**2 * np.exp(-sigma * 0.5 * stretch), share.shape), rtol=2e-6)


@pytest.mark.slow
@pytest.mark.parametrize("technique", TECHNIQUES)
def test_panes_dim_lamps_and_the_sky(technique):
    lamp = quad((-1, 3, 1), (0, 0, -2), (2, 0, 0), Material(emission=(5.0, 4.0, 3.0), double_sided=True))
    share = passed_share(floor_under(blended(), [], lamps=[lamp]), technique, spp=64)
    np.testing.assert_allclose(share.mean((0, 1)), PASSED, rtol=0.02)
    if technique != "none":  # which has the environment's light unoccluded
        # Rays of a hemisphere pass by chance; SSDO sends two from a quarter of the pixels: 2 % of standard error.
        share = passed_share(floor_under(blended(), [], Environment((1.0, 0.8, 0.6))), technique, (32, 32), spp=64)
        np.testing.assert_allclose(share.mean((0, 1)), PASSED, rtol=0.08)


@pytest.mark.slow
def test_a_blended_lamp_shines_by_its_alpha():
    """Light samples and hits of the lamp agree: the picture of a lamp of alpha a is a times that of an opaque one."""
    pictures = []
    for alpha in (1.0, 0.4):
        material = Material(base_color=(1, 1, 1, alpha), emission=(5.0, 4.0, 3.0), double_sided=True)
        material.alpha_mode = "blend" if alpha < 1 else "opaque"
        scene = floor_under([], [], lamps=[quad((-1, 3, 1), (0, 0, -2), (2, 0, 0), material)])
        for technique in ("path", "none"):
            pictures.append(shoot(scene, (12, 12), show=("direct",), gi=technique, bounces=0, spp=64)["direct"].mean())
    opaque, opaque_rays, dim, dim_rays = pictures
    assert dim / opaque == pytest.approx(0.4, rel=0.02)
    assert dim_rays / opaque_rays == pytest.approx(0.4, rel=0.02)


@pytest.mark.parametrize("technique", slow_but(("none",), ("path", "none")))
def test_a_textured_sheet_blends_by_its_texture(technique):
    """The left half of the picture shows a sheet of alpha 0.2, the right half one of 0.7."""
    pixels = np.full((8, 8, 4), 255, np.uint8)
    pixels[..., 3] = np.where(np.arange(8) < 4, round(0.2 * 255), round(0.7 * 255))
    texture = Texture(Image(pixels), filter="nearest", mip_filter="none")
    scene = stack_before([Material(base_color_texture=texture, alpha_mode="blend", unlit=True)], True)
    scene.instances[0].mesh.texcoords0 = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32)
    scene.instances[0].mesh.positions[:, 0] += 0.1  # centre it
    found = shoot(scene, (32, 16), show=("radiance",), gi=technique, spp=32, jitter=True)["radiance"]
    for half, alpha in ((found[:, :15], 0.2), (found[:, 17:], 0.7)):
        np.testing.assert_allclose(half.mean((0, 1)), alpha + (1 - alpha) * np.array(BEHIND), rtol=SEEN)


@pytest.mark.parametrize("technique", slow_but(("none",), ("path", "none")))
def test_a_mask_cuts_holes_into_glass(technique):
    """The left half of the picture shows a hole, the right half the glass; so does light on a floor below a hole."""
    pixels = np.full((8, 8, 4), 255, np.uint8)
    pixels[:, :4, 3] = 0
    texture = Texture(Image(pixels), filter="nearest", mip_filter="none")
    (material, *_) = glass()
    material.base_color_texture, material.alpha_mode = texture, "mask"
    scene = stack_before([material], True)
    scene.instances[0].mesh.texcoords0 = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32)
    scene.instances[0].mesh.positions[:, 0] += 0.1  # centre it
    found = shoot(scene, (32, 16), show=("radiance",), gi=technique, spp=32, jitter=True, diffuse=False)["radiance"]
    tint = (1 - F0) * np.array(GLASS_COLORS[0])
    for half, share in ((found[:, :15], np.ones(3)), (found[:, 17:], tint)):
        np.testing.assert_allclose(half.mean((0, 1)), share * np.array(BEHIND), rtol=SEEN)
    hole = Material(base_color=(0.2, 0.3, 0.9, 0.1), alpha_mode="mask", transmission=1.0, roughness=0.0)
    share = passed_share(floor_under([hole], [SUN]), technique, spp=2, diffuse=False)
    np.testing.assert_allclose(share, 1.0, rtol=2e-6)


@pytest.mark.parametrize("technique", slow_but(("none",), ("path", "none")))
def test_bumps_do_not_hide_what_lies_behind_glass(technique):
    """Smooth glass whose normal map spreads reflections over a pixel passes light once: L = c (1 - F) L_behind."""
    rng = np.random.default_rng(0)
    pixels = np.full((64, 64, 4), 255, np.uint8)
    pixels[..., :2] = 128 + rng.integers(-60, 60, (64, 64, 2))
    (material, *_) = glass()
    material.normal_texture = Texture(Image(pixels), scale=(40.0, 40.0))
    scene = stack_before([material], True)
    scene.instances[0].mesh.texcoords0 = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32)
    found = seen(scene, technique, diffuse=False)["radiance"]
    np.testing.assert_allclose(found, np.array(BEHIND) * (1 - F0) * GLASS_COLORS[0], rtol=SEEN)


def test_buffers_show_what_stops_at_least_half_of_the_light():
    for alpha, distance in ((0.4, 8.0), (0.6, 3.0)):
        scene = stack_before([Material(base_color=(1, 1, 1, alpha), alpha_mode="blend")], True)
        depth = shoot(scene, (8, 8), show=("depth",), gi="none")["depth"]
        np.testing.assert_allclose(depth, distance, rtol=1e-6)


def test_the_error_of_frames_falls_as_that_of_stratified_samples():
    """One pane of alpha 0.5: 0.5 in one frame, below half of independent choices' after 8 and 24 frames."""
    scene = stack_before([Material(base_color=(0, 0, 0, 0.5), alpha_mode="blend", unlit=True)], True)
    for frames in (1, 8, 24):
        settings = Settings(gi="none")
        settings.camera.frames = frames
        renderer = Renderer(scene, size=(32, 32), settings=settings)
        renderer.run()
        share = renderer.read_back()[..., 1]
        assert share.mean() == pytest.approx(0.5, abs=0.01)
        assert share.std() < (0.51 if frames == 1 else 0.5 * 0.5 / math.sqrt(frames))


@pytest.mark.parametrize("technique", slow_but(("path",), ("path", "none")))
@pytest.mark.parametrize("layer", slow_but(("sheen",), ("sheen", "clearcoat")))
def test_layered_clear_panes_vanish_in_a_sky_of_the_same_light(technique, layer):
    """Reflected and passed shares are 1 together; what the layers' fits lose is at most 2 %."""
    pane = Material(transmission=1.0, roughness=0.0)
    if layer == "sheen":
        pane.sheen_color, pane.sheen_roughness = (1.0, 1.0, 1.0), 1.0
    else:
        pane.clearcoat = 1.0
    found = seen(stack_before([pane], False), technique, diffuse=False)["radiance"]
    assert (found < 1.01 * np.array(BEHIND)).all()
    assert (found > 0.97 * np.array(BEHIND)).all()


@pytest.mark.parametrize("pane", slow_but((0,), (0, 1)))
def test_first_frames_of_other_seeds_are_independent(pane):
    """The mean of n first frames is that of n frames, and its deviation that of independent choices: s / sqrt(n)."""
    blend = Material(base_color=(0, 0, 0, 0.5), alpha_mode="blend", unlit=True)
    scene = stack_before([(blend, glass()[0])[pane]], True)
    settings = Settings(gi="none", diffuse=False)
    settings.camera.frames, settings.camera.jitter = 1, False
    renderer = Renderer(scene, size=(32, 32), settings=settings)
    found = []
    for seed in range(16):
        settings.seed = seed
        renderer.run()
        found.append(renderer.read_back()[..., 1])
    settings.camera.frames = 16
    renderer.run()
    frames = renderer.read_back()[..., 1]
    deviation = float(np.std(found))
    assert np.mean(found) == pytest.approx(float(frames.mean()), abs=4 * deviation / math.sqrt(np.size(found)))
    assert np.mean(found, 0).std() < 1.2 * deviation / math.sqrt(len(found))


def test_scenes_without_see_through_surfaces_have_no_passes_for_them():
    renderer = Renderer(cornell_point(), size=(16, 9), settings=Settings(gi="none"))
    renderer.run()
    plan = renderer.plan()
    assert "no see-through material" in plan and "no thin, smooth glass" in plan
