"""The error measures against hand-computed values, and their independence of exposure."""

import numpy as np
import pytest

from wgpu_gi.errors import GiError
from wgpu_gi.metrics import bias, flip, noise_floor, percentile_error, relmse

TRUTH = np.random.default_rng(1).random((8, 9, 3)) + 0.1


def test_perfect_image():
    assert relmse(TRUTH, TRUTH) == bias(TRUTH, TRUTH) == percentile_error(TRUTH, TRUTH) == 0


def test_values_by_hand():
    truth = np.array([[[0.0, 2.0, 4.0]]])
    image = np.array([[[0.2, 2.0, 3.0]]])
    # m = 2, floor 0.01 * 4 = 0.04
    assert relmse(image, truth) == pytest.approx((0.04 / 0.04 + 0 + 1 / 16.04) / 3)
    assert bias(image, truth) == pytest.approx(-0.8 / 6)
    assert percentile_error(image, truth, 100) == pytest.approx(0.2 / 0.2)
    assert percentile_error(image, truth, 50) == pytest.approx(1 / 4.2)


def test_independent_of_exposure():
    image = TRUTH * np.random.default_rng(2).uniform(0.8, 1.2, TRUTH.shape)
    for measure in (relmse, bias, percentile_error):
        assert measure(image * 1e4, TRUTH * 1e4) == pytest.approx(measure(image, TRUTH))


def test_mask_selects_pixels():
    image = TRUTH.copy()
    image[0] = 100
    mask = np.ones(TRUTH.shape[:2], bool)
    mask[0] = False
    for measure in (relmse, bias, percentile_error):
        assert measure(image, TRUTH, mask=mask) == 0 and measure(image, TRUTH) > 0


def test_noise_of_the_truth_is_taken_off():
    rng = np.random.default_rng(3)
    truth = np.full((200, 200, 3), 2.0)
    noise = np.full(truth.shape, 0.1)
    noisy_truth = truth + rng.normal(0, 0.1, truth.shape)
    floor = noise_floor(noise, noisy_truth)
    assert floor == pytest.approx(0.01 / 4.04, rel=0.02)
    assert relmse(truth, noisy_truth) == pytest.approx(floor, rel=0.05)
    assert abs(relmse(truth, noisy_truth, noise)) < 0.05 * floor


@pytest.mark.parametrize("measure", [relmse, bias, percentile_error])
def test_what_cannot_be_measured(measure):
    with pytest.raises(GiError, match="same size"):
        measure(TRUTH[:4], TRUTH)
    with pytest.raises(GiError, match="NaN"):
        measure(np.full_like(TRUTH, np.nan), TRUTH)
    with pytest.raises(GiError, match="black"):
        measure(TRUTH, np.zeros_like(TRUTH))
    with pytest.raises(GiError, match="mask"):
        measure(TRUTH, TRUTH, mask=np.zeros(TRUTH.shape[:2], bool))


def test_flip_needs_its_package(monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "flip_evaluator", None)
    with pytest.raises(GiError, match=r"\[bench\]"):
        flip(TRUTH, TRUTH)


def test_flip():
    pytest.importorskip("flip_evaluator")
    assert flip(TRUTH, TRUTH) == pytest.approx(0, abs=1e-6)
    assert 0 < flip(TRUTH * 0.5, TRUTH) < 1
