"""The statistics of certificates, on pictures whose truth is known."""

from __future__ import annotations

import numpy as np
import pytest

from wgpu_gi.budget.intervals import (
    Draw,
    Estimate,
    bias_interval,
    draw_pixels,
    error_interval,
    error_mean,
    estimate,
    jackknife,
    truth_mean,
)
from wgpu_gi.measure.metrics import bias, relmse

HEIGHT, WIDTH = 60, 80


def room(seed):
    """Return a picture and its truth: smooth light, a noisy quarter, a biased quarter, an edge, a few bright dots."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:HEIGHT, :WIDTH] / (HEIGHT, WIDTH)[0]
    truth = np.repeat((1 + np.cos(3 * x) * np.sin(2 * y))[..., None], 3, axis=-1) * (0.2, 0.3, 0.4)
    picture = truth.copy()
    picture[:30, :40] *= rng.gamma(20, 1 / 20, (30, 40, 1))
    picture[30:, :40] *= 1.2
    picture[:, 60] *= rng.uniform(0.3, 1.5, (HEIGHT, 1))
    picture[rng.integers(0, HEIGHT, 6), rng.integers(0, WIDTH, 6)] *= 3
    return picture, truth


def certified(picture, truth, count, seed):
    """Return the intervals of relMSE and bias, from pixels whose truth has no noise."""
    draw = draw_pixels(picture, count, seed)
    x, t = (values[draw.pixels[:, 1], draw.pixels[:, 0]] for values in (picture, truth))
    nothing = np.zeros(len(x))
    brightness, deviations = truth_mean(draw, x.mean(-1), t.mean(-1), nothing, picture.mean())
    error = error_mean(draw, x, np.repeat(t[:, None], 4, axis=1), brightness.value, deviations)
    return error_interval(error), bias_interval(picture.mean(), brightness)


def test_intervals_hold_the_truth_in_about_95_percent_of_draws():
    """200 draws: a coverage of 95 % has a standard deviation of 1.5 %."""
    held = np.zeros(2)
    for seed in range(200):
        picture, truth = room(seed % 10)
        known = relmse(picture, truth), bias(picture, truth)
        found = certified(picture, truth, 200, seed)
        held += [interval.low <= value <= interval.high for interval, value in zip(found, known, strict=True)]
    assert (held >= 180).all()
    assert (held <= 199).all()


def test_whole_picture_has_its_errors_without_doubt():
    picture, truth = room(1)
    error, brightness = certified(picture, truth, HEIGHT * WIDTH, 0)
    assert error.low == pytest.approx(error.high) == pytest.approx(relmse(picture, truth))
    assert brightness.low == pytest.approx(brightness.high) == pytest.approx(bias(picture, truth))


def test_weights_count_every_pixel_alike():
    """The weighted mean of a quantity is that of the picture: over many draws within 3 standard errors."""
    picture, _ = room(2)
    quantity = np.mgrid[:HEIGHT, :WIDTH][1] + 10.0 * picture[..., 0]
    draws = [draw_pixels(picture, 100, seed) for seed in range(200)]
    means = [np.mean(d.weights * quantity[d.pixels[:, 1], d.pixels[:, 0]]) for d in draws]
    assert abs(np.mean(means) - quantity.mean()) < 3 * np.std(means) / np.sqrt(len(means))
    assert max(d.weights.max() for d in draws) <= 2.5


def test_scale_of_the_light_does_not_matter():
    picture, truth = room(3)
    for scale in (1e-30, 1e30):
        error, brightness = certified(picture * scale, truth * scale, 200, 0)
        for found, expected in zip((error, brightness), certified(picture, truth, 200, 0), strict=True):
            assert (found.low, found.value, found.high) == pytest.approx((expected.low, expected.value, expected.high))


def test_jackknife_removes_the_noise_of_the_truth():
    """Of a perfect picture's error only terms of second order stay: 6 % here. Its variance is not stated too small."""
    rng = np.random.default_rng(0)
    values, noise = jackknife(np.ones((4000, 3)), 1 + 0.3 * rng.standard_normal((4000, 16, 3)), 0.01)
    assert abs(values.mean()) < 0.08 * 0.3**2 / 16
    # The square of a difference near zero has less noise than the pseudo-values say.
    assert values.var() < noise.mean() < 4 * values.var()


def test_constant_has_no_error_and_a_black_picture_is_drawn():
    draw = draw_pixels(np.zeros((30, 40, 3)), 50, 0)
    found = estimate(draw, np.full(50, 0.7), np.zeros(50), skewed=True)
    assert (found.value, found.error) == pytest.approx((0.7, 0.0))
    assert np.allclose(draw.weights, 1.0)


def test_skewed_estimates_reach_farther_up_than_down():
    plain = error_interval(Estimate(1.0, 0.1, 0.0, 1.96, 0.0))
    skewed = error_interval(Estimate(1.0, 0.1, 0.0, 1.96, 0.5))
    assert (plain.low, plain.high) == pytest.approx((0.804, 1.196))
    assert skewed.high - 1 > 0.196 > 1 - skewed.low > 0


def test_estimate_far_from_zero_is_no_error_below_zero():
    assert error_interval(Estimate(-0.1, 0.01, 0.0, 1.96, 0.0)).high == 0
    single = Draw(np.array([[0, 0]]), np.ones(1), True)
    assert bias_interval(2.0, estimate(single, np.ones(1), np.zeros(1), skewed=False)).value == 1.0
