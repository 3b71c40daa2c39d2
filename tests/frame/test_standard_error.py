"""The buffer `standard_error` of techniques whose still picture is a mean over frames."""

from __future__ import annotations

import numpy as np
import pytest

from wgpu_gi.options import TECHNIQUES, Settings
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
