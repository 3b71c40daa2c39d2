"""The error measures against hand-computed values, and their independence of exposure."""

import numpy as np
import pytest

from wgpu_gi.errors import GiError
from wgpu_gi.measure.metrics import (
    Errors,
    bias,
    display_scale,
    flip,
    flip_map,
    measure,
    noise_floor,
    percentile_error,
    regions,
    relative_error,
    relmse,
)
from wgpu_gi.pictures.color import REC709_LUMINANCE, srgb_from_linear

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
    for error in (relmse, bias, percentile_error):
        assert error(image * 1e4, TRUTH * 1e4) == pytest.approx(error(image, TRUTH))


def test_mask_selects_pixels():
    image = TRUTH.copy()
    image[0] = 100
    mask = np.ones(TRUTH.shape[:2], bool)
    mask[0] = False
    for error in (relmse, bias, percentile_error):
        assert error(image, TRUTH, mask=mask) == 0 and error(image, TRUTH) > 0


def test_noise_of_the_truth_is_subtracted():
    rng = np.random.default_rng(3)
    truth = np.full((200, 200, 3), 2.0)
    noise = np.full(truth.shape, 0.1)
    noisy_truth = truth + rng.normal(0, 0.1, truth.shape)
    floor = noise_floor(noise, noisy_truth)
    assert floor == pytest.approx(0.01 / 4.04, rel=0.02)
    assert relmse(truth, noisy_truth) == pytest.approx(floor, rel=0.05)
    assert abs(relmse(truth, noisy_truth, noise)) < 0.05 * floor


@pytest.mark.parametrize("error", [relmse, bias, percentile_error, measure, flip, relative_error])
def test_what_cannot_be_measured(error):
    with pytest.raises(GiError, match="same size"):
        error(TRUTH[:4], TRUTH)
    with pytest.raises(GiError, match="NaN"):
        error(np.full_like(TRUTH, np.nan), TRUTH)
    with pytest.raises(GiError, match="black"):
        error(TRUTH, np.zeros_like(TRUTH))


@pytest.mark.parametrize("error", [relmse, bias, percentile_error, measure])
def test_mask_without_pixels(error):
    with pytest.raises(GiError, match="mask"):
        error(TRUTH, TRUTH, mask=np.zeros(TRUTH.shape[:2], bool))


def test_flip_needs_its_package(monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "flip_evaluator", None)
    with pytest.raises(GiError, match="pip install flip-evaluator"):
        flip(TRUTH, TRUTH)


def test_flip():
    pytest.importorskip("flip_evaluator")
    assert flip(TRUTH, TRUTH) == pytest.approx(0, abs=1e-6)
    assert 0 < flip(TRUTH * 0.5, TRUTH) < 1


def test_flip_lies_where_the_error_is_and_is_independent_of_exposure():
    pytest.importorskip("flip_evaluator")
    truth = np.repeat(np.linspace(0.2, 0.8, 40)[None], 30, axis=0)[..., None] * [1.0, 0.8, 0.5]
    image = truth.copy()
    image[:5, :7] = 0  # the upper left corner, wrong
    error = flip_map(image, truth)
    assert error.shape == (30, 40) and error[:5, :7].mean() > 0.3
    assert error[-5:].max() < 1e-3 and error[:, -7:].max() < 1e-3
    assert flip(image * 1e5, truth * 1e5) == pytest.approx(flip(image, truth), rel=1e-4)
    corner = np.zeros((30, 40), bool)
    corner[:5, :7] = True
    assert flip(image, truth, corner) == pytest.approx(error[:5, :7].mean())
    assert flip(image[..., 0], truth[..., 0]) > 0


def test_flip_takes_linear_values_and_its_own_extremes():
    evaluator = pytest.importorskip("flip_evaluator")
    truth = np.full((20, 20, 3), 0.18, np.float32)  # so that nothing is scaled
    image = truth * 0.5
    _, encoded, _ = evaluator.evaluate(srgb_from_linear(truth), srgb_from_linear(image), "LDR", inputsRGB=True)
    assert flip(image, truth) == pytest.approx(encoded, abs=1e-4)
    assert flip(np.full_like(truth, 1e9), truth) > flip(truth * 2, truth) > flip(truth * 1.1, truth) > 0


def test_mean_luminance_is_displayed_as_middle_grey():
    assert (TRUTH * display_scale(TRUTH) @ REC709_LUMINANCE).mean() == pytest.approx(0.18)
    assert display_scale(np.full((2, 3), 4.0)) == pytest.approx(0.18 / 4)
    with pytest.raises(GiError, match="black"):
        display_scale(np.zeros((2, 3)))


def test_percentile_is_of_the_relative_error():
    image = TRUTH[..., 0] * np.random.default_rng(4).uniform(0.5, 2, TRUTH.shape[:2])
    error = relative_error(image, TRUTH[..., 0])
    assert error.shape == TRUTH.shape[:2]
    assert np.percentile(error, 99.9) == pytest.approx(percentile_error(image, TRUTH[..., 0]))
    assert relative_error(TRUTH * 2, TRUTH).shape == TRUTH.shape[:2]
    assert np.isfinite(relative_error(TRUTH, np.where(TRUTH > 0.5, TRUTH, -0.1 * TRUTH.mean()))).all()


def test_everything_at_once():
    image, noise = TRUTH * 1.1, np.full_like(TRUTH, 0.01)
    mask = np.zeros(TRUTH.shape[:2], bool)
    mask[2:4] = True
    found = measure(image, TRUTH, noise, mask, flip_error=np.arange(72).reshape(8, 9))
    assert found == Errors(
        pixels=18,
        relmse=relmse(image, TRUTH, noise, mask),
        floor=noise_floor(noise, TRUTH, mask),
        bias=bias(image, TRUTH, mask),
        percentile=percentile_error(image, TRUTH, mask=mask),
        flip=float(np.arange(18, 36).mean()),
    )
    bare = measure(image, TRUTH)
    assert (bare.pixels, bare.floor, bare.flip) == (72, None, None)


def test_regions():
    labels = np.array([[0, 0, 5], [5, 16777215, 0]])
    found = regions(labels)
    assert list(found) == ["0", "5", "16777215"]
    assert np.array_equal(found["5"], labels == 5)
    assert list(regions(np.repeat(labels[..., None], 3, -1))) == ["0", "5", "16777215"]
    colors = np.array([[[255, 0, 0], [0, 0, 0]], [[255, 0, 0], [1, 1, 1]]])
    found = regions(colors)
    assert list(found) == ["0,0,0", "1,1,1", "255,0,0"]
    assert np.array_equal(found["255,0,0"], [[True, False], [True, False]])
    with pytest.raises(GiError, match="72 distinct values"):
        regions(np.arange(72).reshape(8, 9))
