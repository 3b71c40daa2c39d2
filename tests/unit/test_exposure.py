"""Automatic exposure: log-average luminance to 0.18, black left out, rounded, in files and in notebooks."""

from __future__ import annotations

import io
import math

import numpy as np
import pytest
from PIL import Image

from wgpu_gi.pictures.color import linear_from_srgb
from wgpu_gi.pictures.exposure import KEY, automatic_exposure, exposure_text, is_exposed
from wgpu_gi.pictures.image import save_image
from wgpu_gi.pictures.picture import Picture


def grey(*values):
    return np.repeat(np.array(values, np.float32).reshape(1, -1, 1), 3, axis=-1)


@pytest.mark.parametrize("radiance", [1e-6, 0.18, 1.0, 3e5])
def test_even_grey_becomes_the_key(radiance):
    assert radiance * 2 ** automatic_exposure(grey(radiance)) == pytest.approx(KEY, rel=0.04)


def test_the_mean_is_of_the_logarithm():
    assert automatic_exposure(grey(KEY / 8, KEY * 2)) == 1.0
    assert automatic_exposure(np.array([[KEY / 8, KEY * 2]])) == 1.0  # without colour, too


def test_luminance_weighs_the_colours():
    green = np.array([[[0.0, 1.0, 0.0]]])
    assert automatic_exposure(green) == pytest.approx(math.log2(KEY / 0.7152), abs=0.05)


def test_brightness_of_the_scene_cancels():
    picture = np.random.default_rng(1).lognormal(size=(9, 16, 3))
    assert automatic_exposure(picture * 2**-7) == pytest.approx(automatic_exposure(picture) + 7)


def test_what_stays_black_does_not_count():
    lit = grey(KEY / 2, KEY / 2)
    assert automatic_exposure(np.concatenate([lit, grey(0.0, 0.0), grey(1e-7, 1e-9)], axis=1)) == 1.0
    assert automatic_exposure(np.concatenate([lit, grey(np.nan, np.inf)], axis=1)) == 1.0


@pytest.mark.parametrize("nothing", [0.0, -1.0, np.nan])
def test_without_light_nothing_is_scaled(nothing):
    assert automatic_exposure(grey(nothing)) == 0.0


def test_limits_are_those_of_the_setting():
    assert automatic_exposure(grey(1e-30)) == 60.0
    assert automatic_exposure(grey(1e30)) == -60.0


def test_words():
    assert exposure_text(1.3, True) == "+1.3 EV (automatic)"
    assert exposure_text(-0.25, False) == "-0.25 EV"
    assert [name for name in ("radiance", "indirect", "normal", "depth") if is_exposed(name)] == [
        "radiance",
        "indirect",
    ]


def test_png_is_exposed_automatically_unless_told(tmp_path):
    def shown(**options):
        save_image(tmp_path / "p.png", {"radiance": grey(KEY / 4, KEY / 4)}, **options)
        with Image.open(tmp_path / "p.png") as picture:
            return float(linear_from_srgb(np.asarray(picture) / 255).mean()), picture.text["exposure"]

    value, text = shown()
    assert (value, text) == (pytest.approx(KEY, rel=0.02), "+2 EV (automatic)")
    value, text = shown(exposure=0.0)
    assert (value, text) == (pytest.approx(KEY / 4, rel=0.05), "+0 EV")


def test_notebook_picture_is_exposed_automatically_unless_told():
    def mean(**options):
        with Image.open(io.BytesIO(Picture(grey(KEY / 4), **options)._repr_png_())) as picture:
            return float(linear_from_srgb(np.asarray(picture) / 255).mean())

    assert mean() == pytest.approx(KEY, rel=0.02)
    assert mean(exposure=0.0) == pytest.approx(KEY / 4, rel=0.05)
