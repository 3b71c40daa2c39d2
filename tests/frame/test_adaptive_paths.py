"""`path.adaptive`: the number of paths of each pixel, unbiased means, progress, and less error."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.pictures import assert_mean, shoot

import wgpu_gi as gi
from wgpu_gi.options import Settings
from wgpu_gi.renderer import CameraSettings, Renderer
from wgpu_gi.resources import resource_dir
from wgpu_gi.scene.built_in import scenes as builtin
from wgpu_gi.techniques.reference import PathSettings
from wgpu_gi.techniques.reference.adaptive import adaptive_runs, mean_paths

ADAPTIVE = PathSettings(adaptive=True)
SHOW = ("radiance", "standard_error")


def corridor() -> gi.Scene:
    """Two lamps that light a corridor through doors: most of the light is indirect, and hard to find."""
    return gi.load(str(resource_dir("scenes") / "leak_corridor" / "leak_corridor.glb"))


def renderer_of(scene, size=(40, 24), **settings) -> Renderer:
    return Renderer(scene, size=size, settings=Settings(gi="path", diffuse=True, **settings))


def counts(renderer) -> np.ndarray:
    """Return the number of paths of each pixel."""
    width, height = renderer.size
    return renderer.graph.read_back("path/emission").reshape(height, width, 4)[..., 3]


@pytest.mark.parametrize(("spp", "runs"), [(1, 1), (4, 1), (5, 2), (8, 2), (9, 3), (16, 3), (17, 4), (32, 4), (33, 5)])
def test_runs_reach_the_number_of_paths(spp, runs):
    assert adaptive_runs(spp, 16) == runs
    assert mean_paths(runs - 1, 16) >= spp > (mean_paths(runs - 2, 16) if runs > 1 else 0)


@pytest.mark.parametrize(
    ("size", "spp"),
    [((37, 21), 96), *(pytest.param(*v, marks=pytest.mark.slow) for v in (((40, 24), 96), ((37, 21), 11)))],
)
def test_spp_is_the_mean_number_of_paths(size, spp):
    renderer = renderer_of(corridor(), size, spp=spp, path=ADAPTIVE)
    renderer.run(show=SHOW)
    n = counts(renderer)
    assert n.mean() == pytest.approx(spp, rel=0.01)
    # Pilot paths for all; then between a quarter and eight times the mean.
    pilot = min(spp, 16)
    assert n.min() >= pilot + 0.25 * (spp - pilot) - 1 and n.max() <= pilot + 8.1 * (spp - pilot) + 1
    assert spp <= pilot or n.max() > n.min() + 10


@pytest.mark.slow
def test_pixels_without_noise_have_equal_numbers_of_paths():
    renderer = renderer_of(builtin.furnace(0.5), spp=40, path=ADAPTIVE, camera=CameraSettings(jitter=False))
    renderer.run(show=SHOW)
    assert (counts(renderer) == 40).all()


@pytest.mark.slow
def test_every_pixel_gets_its_paths_however_long_they_are(monkeypatch):
    renderer = renderer_of(builtin.closed_box(2.0, 0.9), (16, 16), spp=48, path=ADAPTIVE)
    monkeypatch.setattr(renderer._device, "capabilities", replace(renderer._device.capabilities, path_steps=40))
    renderer.run(show=SHOW)
    assert counts(renderer).mean() == pytest.approx(48, rel=0.01)


@pytest.mark.slow
def test_closed_forms_hold():
    assert_mean(shoot(builtin.closed_box(2.0, 0.5), spp=256, path=ADAPTIVE), 4.0)
    ball = shoot(builtin.furnace(0.5), spp=32, path=ADAPTIVE, show=("radiance", "standard_error", "depth"))
    assert_mean(ball, 0.5, where=ball["depth"] > 0)


@pytest.mark.slow
def test_the_mean_over_seeds_is_that_of_even_paths():
    """In the whole picture and in each tile, within 4 standard deviations of the spread over seeds."""
    pictures = {}
    for adaptive in (False, True):
        renderer = renderer_of(corridor(), (32, 16), bounces=1, path=PathSettings(adaptive=adaptive))
        # Equal errors, about: adaptive pictures have fewer paths.
        renderer.settings.spp = 40 if adaptive else 64
        got = []
        for seed in range(40):
            renderer.settings.seed = seed
            renderer.run(show=("radiance",))
            got.append(renderer.read_back().astype(np.float64).mean(-1).reshape(2, 8, 4, 8).mean((1, 3)).ravel())
        pictures[adaptive] = np.array(got)
    for values in (lambda tiles: tiles, lambda tiles: tiles.mean(1, keepdims=True)):
        even, adaptive = (values(pictures[k]) for k in (False, True))
        noise = np.sqrt((even.var(0, ddof=1) + adaptive.var(0, ddof=1)) / len(even))
        assert (np.abs(adaptive.mean(0) - even.mean(0)) < 4 * noise).all()
        assert (noise < 0.06 * even.mean(0)).all()


def test_shares_follow_from_the_pilot_alone():
    """So the number of a pixel's paths is independent of its own radiance, and its mean unbiased."""
    renderer = renderer_of(corridor(), spp=64, path=ADAPTIVE)
    tiles, seen = 2 * 5 * 3, []
    while renderer.step(show=SHOW):
        seen.append(renderer.graph.read_back("path/learned")[-tiles:].view(np.float32))
    assert len(seen) == 6 and seen[3].std() > 0.01
    assert not np.array_equal(seen[2], seen[3])
    assert np.array_equal(seen[3], seen[4]) and np.array_equal(seen[3], seen[5])


def test_more_paths_continue_the_picture():
    """As in a new renderer, bit for bit: shares and guides do not depend on `spp`."""
    renderer = renderer_of(corridor(), spp=32, path=ADAPTIVE)
    renderer.run(show=SHOW)
    renderer.settings.spp = 64
    assert sum(1 for _ in iter(lambda: renderer.step(show=SHOW), False)) == 2
    fresh = renderer_of(corridor(), spp=64, path=ADAPTIVE)
    fresh.run(show=SHOW)
    assert all(np.array_equal(renderer.read_back(name), fresh.read_back(name)) for name in SHOW)


def test_a_changed_scene_forgets_what_was_learned():
    scene = corridor()
    renderer = renderer_of(scene, spp=48, path=ADAPTIVE)
    renderer.run(show=SHOW)
    scene.lights = [gi.PointLight((0.0, 1.0, 0.0), 20.0)]
    renderer.run(show=SHOW)
    fresh = renderer_of(scene, spp=48, path=ADAPTIVE)
    fresh.run(show=SHOW)
    assert np.array_equal(renderer.read_back(), fresh.read_back())
    # Forced frames repeat the work.
    assert renderer.step(show=SHOW, force=True)
    renderer.run(show=SHOW)
    assert np.array_equal(renderer.read_back(), fresh.read_back())


@pytest.mark.slow
def test_standard_error_is_the_spread_over_seeds():
    still = CameraSettings(jitter=False)
    renderer = renderer_of(builtin.cornell(), (32, 18), spp=64, path=ADAPTIVE, camera=still)
    got, reported = [], []
    for seed in range(12):
        renderer.settings.seed = seed
        renderer.run(show=SHOW)
        got.append(renderer.read_back().astype(np.float64))
        reported.append(renderer.read_back("standard_error").astype(np.float64) ** 2)
    spread = np.var(got, axis=0, ddof=1).mean()
    assert 1 / 1.5 < np.sqrt(np.mean(reported) / spread) < 1.5
