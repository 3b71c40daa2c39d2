"""The denoiser of finished pictures: what it needs, and what it keeps."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from wgpu_gi.errors import GiError
from wgpu_gi.options import Settings
from wgpu_gi.pictures.denoise import CAUTION, _mixed, denoised, require_denoiser
from wgpu_gi.rendering import check_denoise, with_alpha
from wgpu_gi.techniques.reference import DENOISER_INPUTS

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
    assert with_alpha(("radiance",), settings, denoise=True) == ("radiance", "alpha", *DENOISER_INPUTS)


@pytest.fixture
def noisy():
    """Return a plane of two colours under smooth light: noisy radiance, truth, albedo, normal, standard error."""
    pytest.importorskip("pyoidn", reason="the extra denoise is not installed")
    rng = np.random.default_rng(1)
    albedo = np.full(SHAPE, 0.8, np.float32)
    albedo[:, :32] = (0.6, 0.1, 0.1)
    truth = albedo * np.linspace(0.5, 2.0, SHAPE[0], dtype=np.float32)[:, None, None]
    radiance = truth * rng.gamma(4.0, 0.25, (*SHAPE[:2], 1)).astype(np.float32)
    return radiance, truth, albedo, np.broadcast_to(np.float32([0, 0, 1]), SHAPE), truth / 2


def test_noise_vanishes_and_light_stays(noisy):
    radiance, truth, *features = noisy
    smooth = denoised(radiance, *features)
    assert ((smooth - truth) ** 2).mean() < 0.05 * ((radiance - truth) ** 2).mean()
    assert abs(smooth.mean() / radiance.mean() - 1) < 0.02


@pytest.mark.parametrize("exponent", [-100, 1, 100])
def test_pictures_scale_with_their_light(noisy, exponent):
    radiance, _, albedo, normal, error = noisy
    scaled = denoised(np.ldexp(radiance, exponent), albedo, normal, np.ldexp(error, exponent))
    assert np.array_equal(scaled, np.ldexp(denoised(radiance, albedo, normal, error), exponent))


def test_black_stays_black(noisy):
    black = np.zeros(SHAPE, np.float32)
    assert not denoised(black, *noisy[2:4], black).any()


def test_a_picture_without_noise_stays(noisy):
    """What the network would blur, though nothing is uncertain, comes from the picture."""
    rng = np.random.default_rng(2)
    rough = rng.gamma(2.0, 0.5, SHAPE).astype(np.float32)
    assert np.allclose(denoised(rough, *noisy[2:4], np.zeros(SHAPE, np.float32)), rough, atol=1e-5)


def test_share_of_the_noisy_picture_minimises_the_error():
    """A smooth picture with bias b, noise of variance v: the share b^2 / (b^2 + v), less what CAUTION takes."""
    rng = np.random.default_rng(3)
    bias, deviation = 1.0, 0.5
    noisy = 5.0 + deviation * rng.standard_normal((200, 200, 3))
    smooth = np.full_like(noisy, 5.0 + bias)
    mixed = _mixed(noisy, smooth, np.full_like(noisy, deviation))
    squared = bias**2 + (1 - CAUTION) * deviation**2
    share = (mixed - smooth) / (noisy - smooth)
    assert np.median(share) == pytest.approx(squared / (squared + deviation**2), rel=0.02)
