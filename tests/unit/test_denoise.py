"""The denoiser of finished pictures: what it needs, and what it keeps."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from wgpu_gi.errors import GiError
from wgpu_gi.options import Settings
from wgpu_gi.pictures.denoise import denoised, require_denoiser
from wgpu_gi.rendering import check_denoise, with_alpha
from wgpu_gi.techniques.reference import FEATURES

SHAPE = (48, 64, 3)


def test_missing_package_is_one_sentence(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    with pytest.raises(GiError, match=r"pip install pyoidn"):
        require_denoiser()


@pytest.mark.parametrize(
    ("denoise", "names", "gi", "words"),
    [
        (True, ["radiance"], "many-light", "many-light filters its own light"),
        (True, ["depth"], "path", "radiance, which is not among the buffers depth"),
        ("yes", ["radiance"], "path", "True or False"),
    ],
)
def test_what_cannot_be_denoised_is_refused(denoise, names, gi, words):
    with pytest.raises(GiError, match=words):
        check_denoise(denoise, names, gi)


def test_features_are_rendered_only_for_the_denoiser():
    settings = Settings(gi="path", transparent=True)
    assert with_alpha(("radiance",), settings) == ("radiance", "alpha")
    assert with_alpha(("radiance",), settings, denoise=True) == ("radiance", "alpha", *FEATURES)


@pytest.fixture
def noisy():
    """Return a plane with two colours under a smooth light: noisy radiance, truth, albedo, normal."""
    pytest.importorskip("pyoidn", reason="the extra denoise is not installed")
    rng = np.random.default_rng(1)
    albedo = np.full(SHAPE, 0.8, np.float32)
    albedo[:, :32] = (0.6, 0.1, 0.1)
    truth = albedo * np.linspace(0.5, 2.0, SHAPE[0], dtype=np.float32)[:, None, None]
    radiance = truth * rng.gamma(4.0, 0.25, (*SHAPE[:2], 1)).astype(np.float32)
    return radiance, truth, albedo, np.broadcast_to(np.float32([0, 0, 1]), SHAPE)


def test_noise_vanishes_and_light_stays(noisy):
    radiance, truth, albedo, normal = noisy
    smooth = denoised(radiance, albedo, normal)
    assert ((smooth - truth) ** 2).mean() < 0.05 * ((radiance - truth) ** 2).mean()
    assert abs(smooth.mean() / radiance.mean() - 1) < 0.02


@pytest.mark.parametrize("exponent", [-100, 1, 100])
def test_pictures_scale_with_their_light(noisy, exponent):
    radiance, _, albedo, normal = noisy
    scaled = denoised(np.ldexp(radiance, exponent), albedo, normal)
    assert np.array_equal(scaled, np.ldexp(denoised(radiance, albedo, normal), exponent))


def test_black_stays_black(noisy):
    _, _, albedo, normal = noisy
    assert not denoised(np.zeros(SHAPE, np.float32), albedo, normal).any()
