"""Indirect light of many-light against references by Mitsuba 3 (`wgpu_gi.measure.references`)."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.marks import slow_but
from mitsuba_scene import camera_rays, pixel_centres

from wgpu_gi.measure.metrics import bias, relmse
from wgpu_gi.measure.references import SIZE, layers_of, scene_of
from wgpu_gi.measure.scenes import make_scene
from wgpu_gi.renderer import Renderer, Settings
from wgpu_gi.scene.load import load
from wgpu_gi.settings import assign

# Rays to all VPLs, a small blur and long paths, so that errors of VPLs and their bound dominate.
FINE = (
    "gather.visibility=exact",
    "gather.interleave=2",
    "denoise.radius=2",
    "vpl.count=2048",
    "vpl.paths=32768",
    "vpl.max_bounces=128",
)
# Bounds of bias and relMSE for one bounce and for all, little above the measured values. The small blur leaves noise of
# the rays that compensate for the bound. All bounces err dark by up to 1 %: few VPLs estimate what the bound removes at
# a hit (512 candidates instead of 32: Cornell, point light, -1.0 to -0.6 %).
BOUNDS = {
    "cornell_area": [(0.005, 0.0035), (0.013, 0.004)],
    "cornell_point": [(0.004, 0.005), (0.014, 0.0065)],
    "cornell_spot": [(0.002, 0.0075), (0.0085, 0.0045)],
    "leak_corridor_a": [(0.012, 0.018), (0.006, 0.022)],
    "courtyard_sun": [(0.01, 0.0115), (0.015, 0.0175)],  # all bounces: 0.011 to 0.0164 over six seeds
    "courtyard_sky": [(0.008, 0.013), (0.012, 0.019)],
}
# Bounds of the default settings with 16 frames. The corridor gets all its light through doors, so few VPLs are visible.
DEFAULT_BOUNDS = {
    "cornell_area": [(0.004, 0.0048), (0.006, 0.0032)],
    "cornell_point": [(0.006, 0.0058), (0.0125, 0.0053)],
    "cornell_spot": [(0.0035, 0.0085), (0.007, 0.0044)],
    "leak_corridor_a": [(0.015, 0.075), (0.01, 0.026)],
    "curtain": [(0.02, 0.075), (0.015, 0.028)],
    "courtyard_sun": [(0.01, 0.0065), (0.01, 0.0065)],
    "courtyard_sky": [(0.012, 0.0076), (0.015, 0.0065)],
}

ROOMS = (100, 102, 104, 106)  # seeds of random rooms that no constant was tuned on


def rendered(name, bounces, *texts):
    """Return the indirect light of the pixel centres, the mean of four frames."""
    settings = Settings(gi="many-light", diffuse=True, bounces=bounces)
    settings.camera.jitter, settings.camera.frames = False, 4
    for text in texts:
        assign(settings, text)
    renderer = Renderer(scene_of(name), size=SIZE, settings=settings)
    renderer.run(show=("indirect",), check=True)
    return renderer.read_back("indirect")


def position_of(name):
    """Return the surface points at the pixel centres, (h, w, 3)."""
    camera = scene_of(name).cameras[0]
    starts, ways = (v.reshape(SIZE[1], SIZE[0], 3) for v in camera_rays(camera, SIZE, pixel_centres(SIZE)))
    return starts + ways * layers_of(name)["depth"][..., None]


def truth_of(name, bounces):
    layers = layers_of(name)
    return layers["one"] if bounces == 1 else layers["one"] + layers["multi"]


@pytest.mark.parametrize("bounces", [1, None])
@pytest.mark.parametrize("name", slow_but(("cornell_point",), BOUNDS))
def test_exact_visibility_agrees_with_mitsuba(name, bounces):
    got, truth = rendered(name, bounces, *FINE), truth_of(name, bounces)
    most_bias, most_error = BOUNDS[name][bounces is None]
    assert abs(bias(got, truth)) <= most_bias
    assert relmse(got, truth) <= most_error


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cornell_area", "cornell_point"])
def test_unclamped_light_is_unbiased(name):
    """Without the bound, its light becomes noise in corners; the median ratio shows that no factor is missing."""
    got, truth = rendered(name, None, *FINE, "gather.clamping=none"), truth_of(name, None)
    assert abs(bias(got, truth)) <= 0.015
    assert abs(np.median(got / np.maximum(truth, 1e-9)) - 1) <= 0.008


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cornell_area", "cornell_point", "cornell_spot"])
def test_compensation_restores_the_light_that_the_bound_takes(name):
    """Both use the same VPLs and share their noise; `test_defaults_agree_with_mitsuba` bounds the bias."""
    truth = truth_of(name, None)
    lost, found = (rendered(name, None, f"gather.compensation={on}") for on in ("false", "true"))
    assert 0.006 < bias(found, truth) - bias(lost, truth) < 0.03
    assert abs(bias(found, truth)) <= 0.018


@pytest.mark.parametrize("bounces", [1, None])
def test_imperfect_shadow_maps_agree_with_mitsuba(bounces):
    got, truth = rendered("cornell_point", bounces, "gather.visibility=ism"), truth_of("cornell_point", bounces)
    assert abs(bias(got, truth)) <= 0.05
    assert relmse(got, truth) <= 0.03


@pytest.mark.parametrize("bounces", [1, None])
@pytest.mark.parametrize("name", slow_but(("cornell_point", "courtyard_sun"), DEFAULT_BOUNDS))
def test_defaults_agree_with_mitsuba(name, bounces):
    truth = truth_of(name, bounces)
    got = rendered(name, bounces, "camera.frames=16")
    most_bias, most_error = DEFAULT_BOUNDS[name][bounces is None]
    assert abs(bias(got, truth)) <= most_bias
    assert relmse(got, truth) <= most_error


@pytest.mark.parametrize("bounces", [1, None])
@pytest.mark.parametrize("name", ["curtain", "leak_corridor_a"])
def test_the_dark_side_stays_dark(name, bounces):
    """Without direct light: all light comes around a curtain or through doors."""
    got, truth = rendered(name, bounces, "camera.frames=16"), truth_of(name, bounces)
    layers = layers_of(name)
    dark = (layers["depth"] > 0) & (layers["direct"].max(-1) <= 0)
    if name == "curtain":
        # The lit half is visible through the gap.
        dark &= position_of(name)[..., 0] > -0.05
    assert dark.mean() > 0.5
    assert abs(bias(got[dark], truth[dark])) <= 0.03


@pytest.mark.slow
def test_random_rooms_keep_their_light():
    """Lambert, all bounces, against the path tracer; the standard error of the truth's mean is 0.1 %."""
    errors = []
    for seed in ROOMS:
        scene = make_scene("room", seed)
        pictures = []
        for settings in (Settings(gi="path", spp=64), Settings(gi="many-light")):
            settings.diffuse, settings.camera.jitter = True, False
            renderer = Renderer(scene, size=(48, 27), settings=settings)
            renderer.run(show=("indirect",))
            pictures.append(renderer.read_back("indirect"))
            renderer.release()
        errors.append(bias(pictures[1], pictures[0]))
    assert abs(np.mean(errors)) <= 0.01, errors
    assert np.abs(errors).max() <= 0.03, errors


@pytest.mark.slow
@pytest.mark.parametrize("bounces", [1, None])
def test_coated_surfaces_agree_with_the_path_tracer(bounces):
    """A rough coat reflects far less than Fresnel's factor: most of the light that it does not transmit is lost."""
    settings = Settings(gi="path", bounces=bounces, spp=512)
    truth = Renderer(load("cornell-point"), size=(64, 48), settings=settings)
    truth.run(show=("indirect",))
    settings = Settings(gi="many-light", bounces=bounces)
    renderer = Renderer(load("cornell-point"), size=(64, 48), settings=settings)
    renderer.run(show=("indirect",), check=True)
    assert -0.04 < bias(renderer.read_back("indirect"), truth.read_back("indirect")) < 0.01
