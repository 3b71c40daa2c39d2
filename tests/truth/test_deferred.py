"""Deferred direct light against references by Mitsuba 3, at each quality (`wgpu_gi.measure.references`)."""

from __future__ import annotations

import pytest

from wgpu_gi.measure.metrics import bias, relmse
from wgpu_gi.measure.references import SIZE, layers_of, scene_of
from wgpu_gi.renderer import Renderer, Settings
from wgpu_gi.settings import apply_quality

# Bounds of bias and relMSE of the layer `direct` at low, medium and high quality, just above the measured values. At
# medium and high quality rays decide where shadow maps leave visibility open: the error is the packing of colours, and
# steps in a lamp's soft shadow from its few samples. At low quality shadow maps decide alone: relMSE weighs a pixel
# that is lit but should be dark by the square of its ratio to the mean, and the corridor's mean is low.
BOUNDS = {
    "cornell_area": [(0.018, 0.019), (0.006, 0.0012), (0.0025, 0.0004)],
    "cornell_point": [(0.001, 0.009), (0.0002, 0.0002), (0.0002, 0.0002)],
    "cornell_spot": [(0.0004, 1e-6), (0.0004, 1e-6), (0.0004, 1e-6)],
    "leak_corridor_a": [(0.008, 65.0), (0.0002, 1e-5), (0.0002, 1e-5)],
    "courtyard_sun": [(0.001, 0.9), (0.0003, 0.0002), (0.0003, 0.0002)],
}


def rendered(name, quality):
    settings = Settings(gi="none", diffuse=True)
    apply_quality(settings, quality)
    settings.camera.jitter = False
    renderer = Renderer(scene_of(name), size=SIZE, settings=settings)
    renderer.run(show=("direct", "emission", "radiance"), check=True)
    return renderer


@pytest.mark.parametrize("quality", ["low", "medium", "high"])
@pytest.mark.parametrize("name", BOUNDS)
def test_direct_light_agrees_with_mitsuba(name, quality):
    truth, renderer = layers_of(name), rendered(name, quality)
    most_bias, most_error = BOUNDS[name][["low", "medium", "high"].index(quality)]
    direct = renderer.read_back("direct")
    assert abs(bias(direct, truth["direct"])) <= most_bias
    assert relmse(direct, truth["direct"]) <= most_error
    if quality != "low":
        full = truth["emit"] + truth["direct"]
        assert relmse(renderer.read_back("radiance"), full) <= most_error
    if truth["emit"].any():
        assert relmse(renderer.read_back("emission"), truth["emit"]) <= 1e-6


def test_sky_light_errs_bright():
    """The sky is not occluded: too bright by up to 18 % in the courtyard, nowhere too dark."""
    truth, renderer = layers_of("courtyard_sky"), rendered("courtyard_sky", "medium")
    direct = renderer.read_back("direct")
    assert 0.1 < bias(direct, truth["direct"]) < 0.18
    assert (direct < 0.98 * truth["direct"] - 0.01 * truth["direct"].mean()).mean() < 2e-3
