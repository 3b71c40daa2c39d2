"""SSIL against light that leaves only what the picture shows: what the path tracer finds with `path.visible_only`.

`visible/` holds its one bounce for the scenes and cameras of `helpers/references.py`, 128x72, 1024 samples per pixel,
diffuse, pixel centres. Where all that is lit is in view, the references by Mitsuba 3 tell the same.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from helpers.references import SIZE, layers_of, scene_of

from wgpu_gi.measure.metrics import bias, relmse
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
def drawn(name, *texts, gi="ssil", frames=16, spp=64):
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
def test_the_truth_itself(name):
    """Light of what is out of view is missing, and nothing else."""
    got = drawn(name, "path.visible_only=true", gi="path")
    assert abs(bias(got, truth_of(name))) <= 0.02
    missing = 1 - truth_of(name).mean() / layers_of(name)["one"].mean()
    least, most = {"cornell_point": (0.15, 0.25), "cornell_area": (0.45, 0.55), "cornell_spot": (0, 0)}[name]
    assert least <= missing <= most


@pytest.mark.parametrize("name", NAMES)
def test_with_rays_for_visibility(name):
    """What is left is the bound of near light and the blur of coarse levels."""
    got, truth = drawn(name, "ssil.visibility=exact", "ssil.start=full"), truth_of(name)
    assert abs(bias(got, truth)) <= 0.035
    assert relmse(got, truth) <= {"cornell_point": 0.02, "cornell_area": 0.005, "cornell_spot": 0.03}[name]


@pytest.mark.parametrize("name", NAMES)
def test_with_voxels(name):
    """At the defaults: the first level has 64x36 pixels."""
    got, truth = drawn(name), truth_of(name)
    assert abs(bias(got, truth)) <= {"cornell_point": 0.02, "cornell_area": 0.03, "cornell_spot": 0.035}[name]
    assert relmse(got, truth) <= {"cornell_point": 0.04, "cornell_area": 0.015, "cornell_spot": 0.13}[name]


@pytest.mark.parametrize("name", NAMES)
def test_without_visibility_it_is_too_bright(name):
    free, truth = drawn(name, "ssil.visibility=none"), truth_of(name)
    assert bias(free, truth) >= bias(drawn(name), truth) + 0.06
    assert relmse(free, truth) >= 10 * relmse(drawn(name), truth)


def test_the_disc_is_less_noisy():
    """A single frame, 64 samples, rays."""
    name = "cornell_point"
    errors = [
        relmse(drawn(name, "ssil.visibility=exact", f"ssil.form_factor={form}", frames=1), truth_of(name))
        for form in ("disc", "differential")
    ]
    assert errors[0] < errors[1]
