"""No NaN, infinity or negative radiance in any buffer of any pass of any technique, whatever scene and settings."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.marks import slow_but
from helpers.medley import medley
from helpers.techniques import ball_on_a_floor, make_settings, picture, thousand_lights

from wgpu_gi.camera import Camera
from wgpu_gi.options import TECHNIQUES
from wgpu_gi.renderer import Renderer, Settings
from wgpu_gi.scene.built_in import scenes as builtin
from wgpu_gi.scene.built_in.scenes import matte
from wgpu_gi.scene.built_in.shapes import box, grid, quad, sphere
from wgpu_gi.scene.scene import (
    DirectionalLight,
    Environment,
    Image,
    Instance,
    Material,
    Mesh,
    PointLight,
    Scene,
    SpotLight,
    Texture,
)
from wgpu_gi.settings import QUALITIES, apply_quality, assign, describe
from wgpu_gi.techniques.deferred.shadow_views import ShadowSettings

pytestmark = pytest.mark.parametrize("technique", slow_but(("path", "none"), TECHNIQUES))

ABOVE = Camera.look_at((0.3, 1.5, 1.5), (0, 0, 0))


def with_floor(*meshes, lights=(), environment=None):
    return Scene([Instance(m) for m in (grid(4.0), *meshes)], list(lights), environment, [ABOVE])


def degenerate():
    """Points, needles, repeated corners and an emitter without area among ordinary triangles."""
    lamp = matte(0.5, "lamp", 1.0)
    points = np.array([(0, 0.5, 0), (1, 0.5, 0), (0, 0.5, 1), (2, 0.5, 0), (0, 0.5, 0), (1, 0.5, 1e-30)], np.float32)
    triangles = np.array([(0, 1, 2), (0, 1, 3), (0, 4, 0), (5, 5, 5), (0, 1, 5)], np.uint32)
    material = np.array([0, 0, 1, 1, 1], np.uint32)
    return with_floor(Mesh(points, triangles, [matte(0.5), lamp], material), lights=[PointLight((0, 1, 0))])


def bad_attributes():
    """Degenerate normals, tangents and texture coordinates; a normal map of zero vectors."""
    grey = Texture(Image(np.full((2, 2, 4), 128, np.uint8)))
    mesh = quad(
        (-1, 0.2, 1), (2, 0, 0), (0, 0, -2), Material(normal_texture=grey, base_color_texture=grey, roughness=0.2)
    )
    mesh.normals = np.array([(0, 1, 0), (0, -1, 0), (0, 1, 0), (1e-30, 0, 0)], np.float32)
    mesh.tangents = np.array([(0, 1, 0, 1), (0, 0, 0, 1), (1e-30, 0, 0, -1), (0, -1, 0, 0)], np.float32)
    mesh.texcoords0 = np.array([(0, 0), (0, 0), (1e30, -1e30), (5e9, 3)], np.float32)
    return with_floor(mesh, lights=[PointLight((0, 1, 0))], environment=Environment())


def lights_on_surfaces():
    spot = SpotLight((0.5, 0, 0.5), (0, -1, 0), 0.3, 0.3, 5.0)
    lights = [PointLight((0, 0, 0)), PointLight((0.3, 1e-6, 0), 1e6), spot, DirectionalLight((1, 0, 0), 2.0)]
    return with_floor(box((-0.3, 0, -0.3), (0.3, 0.3, 0.3), matte(0.9, emission=1.0)), lights=lights)


def mirrors():
    """Smooth metal facing itself, with a light in its focus."""
    mirror = Material("mirror", metallic=1.0, roughness=0.0)
    plates = [quad((-1, y, 1), (2, 0, 0), (0, 0, -2), mirror) for y in (0.1, 0.2, 2.0)]
    ball = sphere((0, 1, 0), 0.3, 3, mirror)
    ball.normals = ball.positions - np.float32((0, 1, 0))
    return with_floor(*plates, ball, lights=[PointLight((0, 1.5, 0)), DirectionalLight((0.1, -1, 0))])


def extremes():
    """Very bright and very dim lights on white surfaces, a sky with a sun of one pixel."""
    image = np.full((8, 16, 3), 1e-6, np.float32)
    image[2, 3] = 1e7
    white = Material("white", roughness=0.0)
    lights = [PointLight((0, 1, 0), 1e9), PointLight((1, 1, 0), 1e-9), SpotLight((0, 2, 0), (0, -1, 0), 0.0, 1e-3, 1e8)]
    return with_floor(box((-0.3, 0, -0.3), (0.3, 0.3, 0.3), white), lights=lights, environment=Environment(image=image))


def inside():
    """The camera lies exactly on a wall of a glowing room."""
    scene = builtin.closed_box(albedo=1.0)
    scene.cameras = [Camera.look_at((2.0, 0, 0), (0, 0, 0.1))]
    return scene


def grazing():
    """Suns parallel to the floor, within float32 rounding of that, and from below; a camera at a grazing angle."""
    lights = [DirectionalLight((1.0, y, 0.3)) for y in (0.0, -1e-7, 1e-7, -1e-3, 0.5)]
    scene = with_floor(box((-0.3, 0, -0.3), (0.3, 0.3, 0.3)), lights=lights)
    scene.cameras = [Camera.look_at((0, 1e-5, 2), (0, 0, -2))]
    return scene


def every_light():
    """Two thousand lights, and an emitter of thousands of triangles."""
    lights = [*thousand_lights(), *thousand_lights(SpotLight), DirectionalLight((0.3, -1, 0.1))]
    scene = ball_on_a_floor(lights, Environment((0.1, 0.2, 0.3)))
    scene.instances.append(Instance(sphere((0, 1.5, 0), 0.2, 4, matte(0.5, "bulb", 3.0))))
    return scene


SCENES = {
    "degenerate triangles": degenerate,
    "bad attributes": bad_attributes,
    "lights on surfaces": lights_on_surfaces,
    "mirrors": mirrors,
    "extremes": extremes,
    "camera on a wall": inside,
    "grazing": grazing,
    "every light": every_light,
    "medley": medley,
    "nothing": lambda: Scene(environment=Environment(image=np.zeros((2, 4, 3), np.float32))),
    "black lights": lambda: with_floor(lights=[PointLight((0, 1, 0), 0.0)], environment=Environment((0.0, 0.0, 0.0))),
}


@pytest.mark.parametrize("name", SCENES)
def test_buffers_are_finite(technique, name):
    """`picture` checks every buffer of every pass, and every shown buffer."""
    picture(technique, SCENES[name](), (24, 16), spp=32)


@pytest.mark.parametrize("name", ["lights on surfaces", "mirrors", "grazing", "medley"])
def test_jittered_frames_are_finite(technique, name):
    picture(technique, SCENES[name](), (24, 16), frames=8, shadow=ShadowSettings())


# ------------------------------------------------------------------------------------------------ Settings


def limits_of(settings):
    """Return `section.name=value` of every setting at both ends of its range, or at each of its choices."""
    texts = []
    for row in describe(settings):
        if row.name == "gi":
            continue
        values = [*(row.range or ()), *row.choices, *((True, False) if isinstance(row.default, bool) else ())]
        assert values, f"{row.name} has no range"
        texts += [f"{row.name}={value}" for value in values]
    return texts


def step(renderer):
    """Render two frames with checks: settings that only add frames or samples cost no time."""
    for _ in range(2):
        renderer.step(check=True)
    picture = renderer.read_back()
    assert np.isfinite(picture).all() and (picture >= 0).all()


def scene_for_settings():
    """A scene with every feature that a setting concerns."""
    lights = [PointLight((1, 1, 1), range=1.5), DirectionalLight((0.3, -1, 0.1)), SpotLight((0, 2, 1), (0, -2, -1))]
    image = np.random.default_rng(0).uniform(0, 1, (4, 8, 3)).astype(np.float32)
    return ball_on_a_floor(lights, Environment(image=image), 5.0)


@pytest.mark.slow
def test_every_setting_at_its_limits_is_finite(technique):
    """One setting at a time, the others at their defaults, at 7x5 pixels in one renderer."""
    renderer = Renderer(scene_for_settings(), size=(7, 5), settings=make_settings(technique))
    for text in limits_of(renderer.settings):
        renderer.settings = make_settings(technique, frames=2)
        assign(renderer.settings, text)
        step(renderer)


@pytest.mark.slow
@pytest.mark.parametrize("end", [0, 1])
def test_all_settings_at_one_limit_are_finite(technique, end):
    """All at their minimum or all at their maximum: 4,096 sample lights, shadow maps and an atlas of 8,192 texels.

    Imperfect shadow maps stay below their maximum: no texture holds the maximum number of them at the maximum size, and
    points are splatted into each of them.
    """
    settings = make_settings(technique)
    for row in describe(settings):
        if row.range is not None:
            assign(settings, f"{row.name}={row.range[end]}")
    if end == 1:
        settings.ism.resolution, settings.ism.points = 32, 64
    step(Renderer(scene_for_settings(), size=(7, 5), settings=settings))


@pytest.mark.parametrize("quality", QUALITIES)
def test_every_quality_is_finite(technique, quality):
    settings = Settings(gi=technique, spp=16)
    apply_quality(settings, quality)
    step(Renderer(scene_for_settings(), size=(7, 5), settings=settings))
