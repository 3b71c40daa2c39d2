"""Estimates of a picture's errors from the truth of some of its pixels, with confidence intervals.

Pixels are drawn with probabilities of their own, two in each of many strata along a curve through the picture (Cochran
1977, "Sampling Techniques", sections 5.9 and 9A.2). The picture is known everywhere, so its mean needs no sampling:
the mean of the truth is that of the picture less the mean difference (a difference estimator, section 7.6). The truth
at a pixel is the mean of independent replicates; jackknifing them (Quenouille 1956) removes the noise's share of a
squared error, to first order.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

UNIFORM_SHARE = 0.5  # of the draws: bounds by 2 what a pixel weighs that is drawn too rarely
NORMAL_975 = 1.959964  # 97.5 % of a normal distribution lie below


@dataclass(frozen=True)
class Interval:
    """An estimate, and the ends of its 95 % confidence interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Draw:
    """Pixels drawn from a picture: `pixels` (n, 2) as x, y, and `weights` (n,) whose mean is 1 on average.

    Consecutive pairs are of the same stratum. If `is_census`, all pixels of the picture are there, once each.
    """

    pixels: NDArray[np.int64]
    weights: Array
    is_census: bool = False


@dataclass(frozen=True)
class Estimate:
    """A mean over the picture, the variance of its estimate, and the share of it that the truth's noise causes."""

    value: float
    variance: float
    noise: float


def draw_pixels(picture: Array, count: int, seed: int) -> Draw:
    """Draw `count` pixels of a picture (h, w, 3), half of them where it varies most from pixel to pixel.

    A picture of fewer pixels is taken whole.
    """
    height, width = picture.shape[:2]
    order = _curve(width, height)
    if count >= len(order):
        return Draw(order, np.ones(len(order)), True)
    contrast = _contrast(picture)[order[:, 1], order[:, 0]]
    uniform = np.full(len(order), 1.0 / len(order))
    total = contrast.sum()
    chance = uniform if total <= 0 else UNIFORM_SHARE * uniform + (1 - UNIFORM_SHARE) * contrast / total
    # Two draws in each of count / 2 strata of equal probability.
    strata = max(count // 2, 1)
    rng = np.random.default_rng((0x6365_7274, seed))
    points = (np.repeat(np.arange(strata), 2) + rng.random(2 * strata)) / strata
    cumulative = np.cumsum(chance)
    chosen = np.searchsorted(cumulative, points * cumulative[-1], side="right").clip(0, len(order) - 1)
    return Draw(order[chosen], 1.0 / (chance[chosen] * len(order)))


def _contrast(picture: Array) -> Array:
    """Return how much each pixel differs from its neighbours, relative, (h, w): noise and edges stand out."""
    padded = np.pad(picture, ((1, 1), (1, 1), (0, 0)), mode="edge")
    around = np.stack(
        [padded[1 + dy : padded.shape[0] - 1 + dy, 1 + dx : padded.shape[1] - 1 + dx] for dx, dy in SIDES]
    )
    floor = 0.01 * max(float(picture.mean()), 1e-100) ** 2
    squared = ((around - picture) ** 2).mean(0) / (np.minimum(around.min(0), picture) ** 2 + floor)
    return np.sqrt(squared.mean(-1))


SIDES = ((-1, 0), (1, 0), (0, -1), (0, 1))


def _curve(width: int, height: int) -> NDArray[np.int64]:
    """Return all pixels (x, y) in the order of a Morton curve, along which neighbours stay close."""
    y, x = (axis.ravel() for axis in np.mgrid[:height, :width])
    code = np.zeros(len(x), np.int64)
    for bit in range(16):
        code |= ((x >> bit) & 1) << (2 * bit) | ((y >> bit) & 1) << (2 * bit + 1)
    order = np.argsort(code, kind="stable")
    return np.stack([x[order], y[order]], axis=-1)


def estimate(draw: Draw, values: Array, noise: Array) -> Estimate:
    """Return the mean over the picture of a quantity: `values` (n,) at the drawn pixels, of variance `noise` (n,)."""
    weighted = draw.weights * values
    share = float(np.sum(draw.weights**2 * noise)) / len(values) ** 2
    if draw.is_census:
        return Estimate(float(weighted.mean()), share, share)
    pairs = weighted[: len(weighted) // 2 * 2].reshape(-1, 2)
    spread = float(np.sum((pairs[:, 0] - pairs[:, 1]) ** 2)) / len(weighted) ** 2
    return Estimate(float(weighted.mean()), spread, share)


def jackknife(picture: Array, replicates: Array, floor: float) -> tuple[Array, Array]:
    """Return the relative squared error (n,) of pixels against their truth, and the variance (n,) that noise gives it.

    `picture` (n, 3); `replicates` (n, R, 3) of the truth; `floor` is added to its square in the denominator.
    """
    count = replicates.shape[1]

    def error(truth: Array) -> Array:
        return ((picture[:, None] - truth) ** 2 / (truth**2 + floor)).mean(-1)

    total = replicates.sum(1, keepdims=True)
    without_one = error((total - replicates) / (count - 1))
    pseudo = count * error(total / count) - (count - 1) * without_one
    return pseudo.mean(1), pseudo.var(1, ddof=1) / count


def bias_interval(mean: float, difference: Estimate) -> Interval:
    """Return the bias, mean(x - t) / mean(t), from the picture's mean and the estimate of mean(x - t)."""
    half = NORMAL_975 * math.sqrt(difference.variance)
    low, value, high = (_bias(mean, difference.value + step) for step in (-half, 0.0, half))
    return Interval(value, low, high)


def _bias(mean: float, difference: float) -> float:
    return difference / max(mean - difference, 1e-300)


def error_interval(error: Estimate) -> Interval:
    """Return the interval of an error that is not negative: symmetric in its logarithm where it is known well."""
    half = NORMAL_975 * math.sqrt(error.variance)
    if error.value > 1.5 * half:
        factor = math.exp(half / error.value)
        return Interval(error.value, error.value / factor, error.value * factor)
    return Interval(error.value, max(error.value - half, 0.0), max(error.value, 0.0) + half)
