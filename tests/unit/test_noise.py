"""The relMSE that a picture's noise causes."""

from __future__ import annotations

import numpy as np
import pytest

from wgpu_gi.errors import GiError
from wgpu_gi.measure.metrics import relmse
from wgpu_gi.pictures.noise import expected_relmse, without_noise


def test_expected_relmse_is_that_of_pictures_with_this_noise():
    random = np.random.default_rng(1)
    truth = random.uniform(1.0, 3.0, (64, 64, 3))
    error = random.uniform(0.0, 0.1, truth.shape)
    noisy = truth + error * random.standard_normal(truth.shape)
    assert expected_relmse(noisy, error) == pytest.approx(relmse(noisy, truth), rel=0.05)


def test_bright_dots_of_noise_do_not_hide_themselves():
    random = np.random.default_rng(2)
    truth = np.tile(np.where(np.arange(64) < 32, 1.0, 8.0)[None, :, None], (64, 1, 3))
    dots = random.random((64, 64, 1)) < 0.02
    noisy = truth + np.where(dots, 30.0, 0.0)
    error = np.where(dots, 30.0, 0.0) * np.ones(3)
    assert expected_relmse(without_noise(noisy, error), error) == pytest.approx(relmse(noisy, truth), rel=0.1)


@pytest.mark.parametrize("scale", [1e-30, 1.0, 1e30])
def test_expected_relmse_does_not_depend_on_exposure(scale):
    picture = np.full((4, 4, 3), scale, np.float32)
    assert expected_relmse(picture, 0.1 * picture) == pytest.approx(0.01 / 1.01)


def test_expected_relmse_without_noise_is_zero():
    assert expected_relmse(np.zeros((4, 4)), np.zeros((4, 4))) == 0.0


def test_expected_relmse_refuses_pictures_that_do_not_fit():
    with pytest.raises(GiError, match="do not fit"):
        expected_relmse(np.ones((4, 4, 3)), np.ones((4, 4)))
    with pytest.raises(GiError, match="NaN"):
        expected_relmse(np.full((4, 4), np.nan), np.ones((4, 4)))
