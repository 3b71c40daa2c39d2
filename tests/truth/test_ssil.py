"""SSIL against path-traced light that comes from visible surfaces only (`path.visible_only`).

`visible/` holds one bounce of it for the scenes and cameras of `wgpu_gi.measure.references`, 128x72, 1024 samples per
pixel, diffuse, pixel centres. Where all lit surfaces are in view, the references by Mitsuba 3 hold the same light.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from wgpu_gi.measure.metrics import bias, relmse
from wgpu_gi.measure.references import SIZE, layers_of, scene_of
from wgpu_gi.renderer import Renderer, Settings
from wgpu_gi.settings import assign

FOLDER = Path(__file__).parent / "visible"
NAMES = ("cornell_point", "cornell_area", "cornell_spot")


@cache
def truth_of(name):
    if name == "cornell_spot":
        return layers_of(name)["one"]
    with np.load(FOLDER / f"{name}_{SIZE[0]}x{SIZE[1]}.npz") as file:
        return file["one"]


@cache
def rendered(name, *texts, gi="ssil", frames=16, spp=64):
    """Return one bounce of the pixel centres."""
    settings = Settings(gi=gi, diffuse=True, bounces=1, spp=spp)
    settings.camera.jitter, settings.camera.frames = False, frames
    for text in texts:
        assign(settings, text)
    renderer = Renderer(scene_of(name), size=SIZE, settings=settings)
    renderer.run(show=("indirect",), check=True)
    return renderer.read_back("indirect")


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_truth_lacks_only_light_from_outside_the_view(name):
    """The share of light from outside the view, by scene; the spot lights only surfaces in view."""
    got = rendered(name, "path.visible_only=true", gi="path")
    assert abs(bias(got, truth_of(name))) <= 0.02
    missing = 1 - truth_of(name).mean() / layers_of(name)["one"].mean()
    least, most = {"cornell_point": (0.15, 0.25), "cornell_area": (0.45, 0.55), "cornell_spot": (0, 0)}[name]
    assert least <= missing <= most


@pytest.mark.parametrize("name", NAMES)
def test_exact_visibility_agrees_with_the_truth(name):
    """The remaining error comes from the bound of near light and the blur of coarse levels."""
    got, truth = rendered(name, "ssil.visibility=exact", "ssil.start=full"), truth_of(name)
    assert abs(bias(got, truth)) <= 0.02
    assert relmse(got, truth) <= {"cornell_point": 0.015, "cornell_area": 0.0045, "cornell_spot": 0.01}[name]


@pytest.mark.parametrize("name", NAMES)
def test_voxel_visibility_agrees_with_the_truth(name):
    """At the defaults: the first level has 64x36 pixels."""
    got, truth = rendered(name), truth_of(name)
    assert abs(bias(got, truth)) <= {"cornell_point": 0.03, "cornell_area": 0.02, "cornell_spot": 0.025}[name]
    assert relmse(got, truth) <= {"cornell_point": 0.025, "cornell_area": 0.0125, "cornell_spot": 0.035}[name]


@pytest.mark.parametrize("name", NAMES)
def test_light_without_visibility_is_too_bright(name):
    free, truth = rendered(name, "ssil.visibility=none"), truth_of(name)
    assert bias(free, truth) >= bias(rendered(name), truth) + 0.06
    assert relmse(free, truth) >= 10 * relmse(rendered(name), truth)


def test_the_form_factor_of_a_disc_is_less_noisy():
    """A single frame of 64 samples with exact visibility."""
    name = "cornell_point"
    errors = [
        relmse(rendered(name, "ssil.visibility=exact", f"ssil.form_factor={form}", frames=1), truth_of(name))
        for form in ("disc", "differential")
    ]
    assert errors[0] < errors[1]
