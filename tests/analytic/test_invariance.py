"""Relations of the path tracer, pixel by pixel: doubling, scaling, moving, swapped channels, adding lights, bounces."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from helpers.pictures import moved, scaling, shoot, translation

from wgpu_gi.camera import Camera
from wgpu_gi.measure.metrics import relmse
from wgpu_gi.renderer import CameraSettings, Renderer, Settings
from wgpu_gi.scene.built_in import scenes as builtin
from wgpu_gi.scene.built_in.scenes import matte
from wgpu_gi.scene.built_in.shapes import grid, quad, sphere
from wgpu_gi.scene.scene import DirectionalLight, Environment, Instance, PointLight, Scene, SpotLight

SIZE = (32, 18)


def lit(light=None, environment=None, emission=0.0):
    """The Cornell room under one source."""
    scene = builtin.cornell() if emission else builtin.cornell_point()
    scene.lights = [light] if light else []
    scene.environment = environment
    for material in scene.materials:
        material.emission = tuple(emission * np.array(material.emission))
    return scene


def sky(factor):
    image = np.random.default_rng(0).uniform(0, 1, (8, 16, 3)).astype(np.float32)
    return Environment((factor,) * 3, image)


SOURCES = {
    "point": lambda f: lit(PointLight((2.78, 5.2, 2.795), 30.0 * f)),
    "spot": lambda f: lit(SpotLight((1.0, 4.2, 1.0), (4.5, -1.8, 0.5), 0.2, 0.5, 400.0 * f)),
    "sun": lambda f: lit(DirectionalLight((0.1, -0.3, 1.0), 3.0 * f)),
    "emitter": lambda f: lit(emission=f),
    "constant sky": lambda f: lit(environment=Environment((f, f, f))),
    "pictured sky": lambda f: lit(environment=sky(f)),
}


@pytest.mark.parametrize("name", SOURCES)
def test_twice_the_light_is_exactly_twice_the_picture(name):
    once, twice = (shoot(SOURCES[name](f), SIZE, spp=8, jitter=True)["radiance"] for f in (1.0, 2.0))
    assert np.array_equal(2 * once, twice) and once.any()


@pytest.mark.parametrize("name", ["cornell", "cornell-point"])
def test_swapped_channels_give_a_swapped_picture(name):
    scene, swapped = builtin.builtin_scene(name), builtin.builtin_scene(name)
    for material in swapped.materials:
        r, g, b, a = material.base_color
        material.base_color, material.emission = (g, b, r, a), (*material.emission[1:], material.emission[0])
    for light in swapped.lights:
        light.color = (*light.color[1:], light.color[0])
    a, b = (shoot(s, SIZE, spp=16, jitter=True)["radiance"] for s in (scene, swapped))
    # Light probabilities follow luminance; their rounding changes a rare path.
    assert relmse(b, np.roll(a, -1, axis=-1)) < 1e-5


@pytest.mark.parametrize("factor", [1e-3, 1e3, 1024.0])
@pytest.mark.parametrize("name", ["cornell", "cornell-spot"])
def test_scale_does_not_matter(name, factor):
    """A scene s times as large with intensities s2 times as high looks the same."""
    scene = builtin.builtin_scene(name)
    large = moved(scene, scaling(factor))
    for light in large.lights:
        light.intensity *= factor**2
    assert_equivalent(scene, large)


def test_translation_does_not_matter():
    """A scene a thousand kilometres away looks the same."""
    for name in ("cornell", "cornell-spot"):
        scene = builtin.builtin_scene(name)
        assert_equivalent(scene, moved(scene, translation(1e6, -2e6, 3e6)))


def assert_equivalent(scene, other):
    """Assert that most pixels are equal, and the means: rounding changes a few paths."""
    a, b = (shoot(s, SIZE, spp=64, jitter=True)["radiance"] for s in (scene, other))
    off = np.abs(a - b).max(-1) / a.mean()
    assert np.median(off) < 1e-4
    assert b.mean() == pytest.approx(a.mean(), rel=2e-3)
    assert relmse(b, a) < 2e-3


def test_positions_far_from_the_origin_are_in_the_world():
    scene = builtin.plane_point()
    shift = (1e6, 2e5, -3e6)
    here, there = (
        shoot(s, (5, 5), spp=1, show=("position",))["position"] for s in (scene, moved(scene, translation(*shift)))
    )
    assert np.allclose(there - shift, here, atol=0.25)  # float32 at 3e6 m has steps of 0.25 m


def ball_on_a_floor(lights=(), environment=None, emission=0.0):
    """A scene of mostly direct light, which takes few samples, with shadows and all kinds of sources."""
    ball = sphere((0.0, 0.5, 0.0), 0.5, material=matte((0.8, 0.6, 0.4)))
    lamp = quad((-1, 1.5, -1), (0.6, 0, 0), (0, 0, 0.6), matte(0.0, "lamp", emission, double_sided=False))
    scene = Scene([Instance(grid(4.0, material=matte(0.5))), Instance(ball), Instance(lamp)], list(lights), environment)
    scene.cameras = [Camera.look_at((0, 2, 3), (0, 0.3, 0))]
    return scene


def test_lights_add_up():
    """Each light alone and all of them together, in the mean: choosing among lights is unbiased."""
    lamp = PointLight((1.0, 1.0, 1.0), 0.5, (1.0, 0.5, 0.2))
    sun = DirectionalLight((0.3, -1.0, 0.2), 0.5)
    parts = [{"lights": [lamp]}, {"lights": [sun]}, {"emission": 20.0}, {"environment": sky(0.2)}]
    together = {"lights": [lamp, sun], "emission": 20.0, "environment": sky(0.2)}
    samples = [256] * len(parts) + [3072]
    pictures = [
        shoot(ball_on_a_floor(**sources), (16, 12), spp=spp, bounces=0)
        for sources, spp in zip([*parts, together], samples, strict=True)
    ]
    sums = sum(p["radiance"] for p in pictures[:-1])
    noise = np.sqrt(sum((p["standard_error"] ** 2).sum((0, 1)) for p in pictures)) / sums[..., 0].size
    assert (3 * noise < 0.005 * sums.mean((0, 1))).all()
    assert np.allclose(pictures[-1]["radiance"].mean((0, 1)), sums.mean((0, 1)), rtol=0.005)


def test_layers_add_up():
    show = ("radiance", "emission", "direct", "indirect")
    got = shoot(builtin.cornell(), SIZE, spp=16, jitter=True, show=show)
    assert np.allclose(got["emission"] + got["direct"] + got["indirect"], got["radiance"], rtol=1e-6)
    assert got["emission"].max() > 5 and got["direct"].mean() > 0.01 and got["indirect"].mean() > 0.01


def test_bounces_only_add():
    """With one seed, each further bounce only adds indirect light; emission and direct light stay the same."""
    show = ("radiance", "emission", "direct", "indirect")
    pictures = [shoot(builtin.cornell(), SIZE, spp=16, bounces=n, show=show) for n in (0, 1, 2, 30, None)]
    for picture in pictures[1:]:
        assert np.array_equal(picture["emission"], pictures[0]["emission"])
        assert np.allclose(picture["direct"], pictures[0]["direct"], rtol=1e-6)
    assert not pictures[0]["indirect"].any()
    indirect = [p["indirect"] for p in pictures]
    for fewer, more in pairwise(indirect):
        assert (more >= fewer * (1 - 1e-6)).all() and more.mean() >= fewer.mean()
    assert indirect[2].mean() > 1.1 * indirect[1].mean()
    assert np.allclose(indirect[4].mean(), indirect[3].mean(), rtol=1e-3)


def test_picture_without_bounces_is_the_direct_layer():
    scene = builtin.cornell()
    alone = shoot(scene, SIZE, spp=16, bounces=0, show=("radiance", "emission", "direct", "indirect"))
    full = shoot(scene, SIZE, spp=16, show=("emission", "direct"))
    assert np.allclose(alone["radiance"], full["emission"] + full["direct"], rtol=1e-6)
    assert not alone["indirect"].any()


def test_same_seed_same_picture_other_seed_other_noise():
    a, b, c = (shoot(builtin.cornell(), SIZE, spp=8, seed=seed, jitter=True)["radiance"] for seed in (3, 3, 4))
    assert np.array_equal(a, b) and not np.array_equal(a, c)
    assert a.mean() == pytest.approx(c.mean(), rel=0.1)


def test_samples_do_not_depend_on_the_size_of_a_run():
    """Sixty samples in one run of the pass, or in runs of 16 or 7 of them."""
    pictures = []
    for samples in (60, 16, 7):
        settings = Settings(gi="path", spp=60, camera=CameraSettings(jitter=True))
        settings.path.samples_per_run = samples
        renderer = Renderer(builtin.cornell(), size=SIZE, settings=settings)
        renderer.run(show=("radiance", "standard_error"))
        pictures.append([renderer.read_back(name) for name in ("radiance", "standard_error")])
    for radiance, error in pictures[1:]:
        assert np.allclose(radiance, pictures[0][0], rtol=1e-4, atol=1e-6)
        # The standard error is that of halves of whole runs; a single run has none, and its samples err high.
        assert 0.3 < np.median(error) / np.median(pictures[0][1]) < 1.5


def test_moving_back_restores_the_picture():
    """A moved mesh leaves the world-space hierarchy and becomes an instance; the picture equals a new renderer's."""
    scene = builtin.cornell()
    renderer = Renderer(scene, size=SIZE, settings=Settings(gi="path", spp=16))

    def picture():
        renderer.run(show=("radiance", "position"))
        return renderer.read_back("radiance"), renderer.read_back("position")

    block = next(i for i in scene.instances if i.name == "smallbox")
    light = next(i for i in scene.instances if i.name == "luminaire")
    before = picture()
    home = block.world_from_local, light.world_from_local
    block.world_from_local, light.world_from_local = translation(0.5, 0, 1.0), translation(-1.0, -0.2, 0)
    away = picture()
    fresh = Renderer(scene, size=SIZE, settings=Settings(gi="path", spp=16))
    fresh.run(show=("radiance", "position"))
    assert_same_picture(away, (fresh.read_back("radiance"), fresh.read_back("position")))
    assert not np.allclose(away[0], before[0], rtol=0.01)
    block.world_from_local, light.world_from_local = home
    assert_same_picture(picture(), before)


def assert_same_picture(got, expected):
    """Compare radiance and positions; rounding differs between triangles in the world and in their instance."""
    assert np.abs(got[1] - expected[1]).max() < 1e-4
    assert relmse(got[0], expected[0]) < 0.02 and got[0].mean() == pytest.approx(expected[0].mean(), rel=0.01)


def test_empty_scene_is_black():
    got = shoot(Scene(), (4, 4), spp=2, show=("radiance", "depth", "standard_error"))
    assert not any(buffer.any() for buffer in got.values())
