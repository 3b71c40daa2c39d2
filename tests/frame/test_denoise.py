"""The path tracer's features for the denoiser, and a denoised picture."""

from __future__ import annotations

import numpy as np
import pytest

import wgpu_gi as gi
from wgpu_gi.__main__ import main
from wgpu_gi.measure.metrics import relmse
from wgpu_gi.options import Settings
from wgpu_gi.pictures.image import load_image
from wgpu_gi.renderer import Renderer
from wgpu_gi.techniques.reference import FEATURE_SIDE, FEATURES

SIZE = (16, 9)


def features(size, jitter, names):
    settings = Settings(gi="path", spp=1)
    settings.camera.jitter = jitter
    with Renderer("cornell-point", size=size, settings=settings) as renderer:
        renderer.run(show=names)
        return [renderer.read_back(name) for name in names]


def test_features_are_box_filtered_surfaces():
    """The mean over the points of a pixel is that of the pixel centres in a picture with as many pixels."""
    got = features(SIZE, True, FEATURES)
    n = FEATURE_SIDE
    for feature, fine in zip(got, features((n * SIZE[0], n * SIZE[1]), False, ("albedo", "normal")), strict=True):
        expected = fine.reshape(SIZE[1], n, SIZE[0], n, 3).mean((1, 3))
        off = np.abs(feature - expected).max(-1)
        assert (off > 1e-5).mean() < 0.02  # rays through edges may see either surface
        assert off.max() < 2.0 / n**2 * 2.0


def test_features_without_jitter_are_those_of_the_centres():
    got = features(SIZE, False, FEATURES)
    for feature, centre in zip(got, features(SIZE, False, ("albedo", "normal")), strict=True):
        assert np.allclose(feature, centre, atol=1e-6)


def test_denoised_picture_is_nearer_to_the_truth():
    pytest.importorskip("pyoidn", reason="the extra denoise is not installed")
    truth = gi.render("cornell-point", size=(64, 36), gi="path", spp=128)
    noisy, smooth = (
        gi.render("cornell-point", size=(64, 36), gi="path", spp=4, denoise=denoise) for denoise in (False, True)
    )
    assert relmse(smooth, truth) < 0.15 * relmse(noisy, truth)
    assert smooth.name == "radiance"


def test_sequence_is_denoised(tmp_path, monkeypatch):
    pytest.importorskip("pyoidn", reason="the extra denoise is not installed")
    monkeypatch.chdir(tmp_path)
    command = ["--gi=path", "--spp=2", "--size=32x18", "--denoise"]
    assert main(["render", "cornell-point", *command, "-o", "one.npy"]) == 0
    assert main(["render", "cornell-point", *command, "-o", "{frame}.npy", "--frames", "0:1", "-q"]) == 0
    assert np.array_equal(load_image("one.npy"), load_image("0.npy"))
