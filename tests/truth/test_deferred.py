"""Deferred direct light against references by Mitsuba 3, at each quality (`helpers/references.py` tells of them)."""

from __future__ import annotations

import pytest
from helpers.references import SIZE, layers_of, scene_of

from wgpu_gi.measure.metrics import bias, relmse
from wgpu_gi.renderer import Renderer, Settings
from wgpu_gi.settings import apply_quality

# The most bias and relMSE of the layer `direct` at low, medium and high quality: what was measured, and little more.
# Where rays decide what shadow maps leave open, no more than the packing of colours is left; a lamp's few samples make
# steps of its soft shadow. At low quality the maps alone decide: relMSE weighs a pixel that is lit but should be dark
# by the square of how much brighter than the mean it is, and in the corridor the mean is that of a few lit pixels.
BOUNDS = {
    "cornell_area": [(0.018, 0.019), (0.006, 0.0012), (0.0025, 0.0004)],
    "cornell_point": [(0.001, 0.009), (0.0002, 0.0002), (0.0002, 0.0002)],
    "cornell_spot": [(0.0004, 1e-6), (0.0004, 1e-6), (0.0004, 1e-6)],
    "leak_corridor_a": [(0.008, 65.0), (0.0002, 1e-5), (0.0002, 1e-5)],
    "courtyard_sun": [(0.001, 0.9), (0.0003, 0.0002), (0.0003, 0.0002)],
}


def drawn(name, quality):
    settings = Settings(gi="none", diffuse=True)
    apply_quality(settings, quality)
    settings.camera.jitter = False
    renderer = Renderer(scene_of(name), size=SIZE, settings=settings)
    renderer.run(show=("direct", "emission", "radiance"), check=True)
    return renderer


@pytest.mark.parametrize("quality", ["low", "medium", "high"])
@pytest.mark.parametrize("name", BOUNDS)
def test_direct_light(name, quality):
    truth, renderer = layers_of(name), drawn(name, quality)
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
    """It is as if nothing occluded the sky: too bright by 18 % in the courtyard, nowhere too dark."""
    truth, renderer = layers_of("courtyard_sky"), drawn("courtyard_sky", "medium")
    direct = renderer.read_back("direct")
    assert 0.1 < bias(direct, truth["direct"]) < 0.18
    assert (direct < 0.98 * truth["direct"] - 0.01 * truth["direct"].mean()).mean() < 2e-3
