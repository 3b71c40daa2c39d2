"""The buffer `standard_error` of techniques whose still picture is a mean over frames."""

from __future__ import annotations

import numpy as np
import pytest

from wgpu_gi.measure.scenes import make_scene
from wgpu_gi.options import TECHNIQUES, Settings
from wgpu_gi.pictures.noise import expected_relmse
from wgpu_gi.renderer import Renderer
from wgpu_gi.scene.built_in import scenes as builtin

SIZE = 16, 9
SHOW = ("radiance", "standard_error")


def renderer(gi, frames, jitter=True):
    settings = Settings(gi=gi, spp=4)
    settings.camera.frames, settings.camera.jitter = frames, jitter
    return Renderer(builtin.cornell(), size=SIZE, settings=settings)


@pytest.mark.parametrize("gi", TECHNIQUES)
def test_the_picture_is_the_same_with_and_without_it(gi):
    shown = renderer(gi, 3)
    shown.run(show=("radiance",))
    alone = shown.read_back()
    assert not any("standard_error" in p.name for p in shown.graph.order) or gi == "path"
    shown.run(show=SHOW)
    assert np.array_equal(shown.read_back(), alone)
    assert shown.read_back("standard_error").any()


def test_of_a_single_frame_it_is_the_radiance():
    shown = renderer("many-light", 1)
    shown.run(show=SHOW)
    assert np.array_equal(shown.read_back("standard_error"), shown.read_back())


def test_of_a_picture_without_random_numbers_it_is_zero():
    shown = renderer("none", 4, jitter=False)
    shown.settings.direct.emitters = "maps"
    shown.run(show=SHOW)
    assert shown.read_back().any() and not shown.read_back("standard_error").any()


def test_it_is_the_spread_over_seeds():
    """As a share of relMSE, within a factor of 1.5; in a room of 32x18 pixels, with 8 frames."""
    shown = Renderer(make_scene("room", 4), size=(32, 18), settings=Settings(gi="ssdo"))
    shown.settings.camera.frames = 8
    pictures, variances = [], []
    for seed in range(8):
        shown.settings.seed = seed
        shown.run(show=SHOW)
        pictures.append(shown.read_back())
        variances.append(shown.read_back("standard_error").astype(np.float64) ** 2)
    mean, spread = np.mean(pictures, axis=0), np.std(pictures, axis=0, ddof=1)
    estimated = expected_relmse(mean, np.sqrt(np.mean(variances, axis=0)))
    assert 1 / 1.5 < np.sqrt(estimated / expected_relmse(mean, spread)) < 1.5
