"""Estimates of a picture's errors from the truth of some of its pixels, with 95 % confidence intervals.

Pixels are drawn with probabilities of their own, two in each of many strata along a curve through the picture (Cochran
1977, "Sampling Techniques", sections 5.9 and 9A.2). The picture is known everywhere, so the mean of the truth is
estimated by regression on it (chapter 7). The truth at a pixel is the mean of independent replicates; jackknifing them
(Quenouille 1956) removes the noise's share of a squared error, to first order.

Few pixels may hold most of a squared error, so its interval is Hall's (1992, "On the removal of skewness by
transformation"), with the degrees of freedom that the fourth moment leaves (Satterthwaite 1946). Its upper end is too
low if the pixels that hold the error are missing from the draw; `tools/README.md` has the measured coverage.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Shares of the draws: of all pixels alike, by contrast, by its square and by brightness. The first bounds by 2.5 what a
# pixel weighs that is drawn too rarely; squares find single bright dots. Chosen by coverage and width on 60 pictures.
UNIFORM, CONTRAST, SQUARED_CONTRAST, BRIGHTNESS = 0.4, 0.2, 0.2, 0.2
STEP = 1e-3  # relative, of the mean of the truth, for a derivative
# Quantiles of Student's t, 97.5 %, by one over the degrees of freedom.
ONE_OVER_FREEDOM = (0.0, 1 / 60, 1 / 30, 1 / 20, 1 / 15, 1 / 10, 1 / 8, 1 / 6, 1 / 5, 1 / 4, 1 / 3, 1 / 2)
QUANTILES = (1.960, 2.000, 2.042, 2.086, 2.131, 2.228, 2.306, 2.447, 2.571, 2.776, 3.182, 4.303)
NEIGHBOURS = ((-1, 0), (1, 0), (0, -1), (0, 1))


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
    """A mean over the picture.

    `error`: its standard error; `noise`: the variance that the truth's noise causes; `quantile`: standard errors from
    the value to an end of a symmetric interval; `skewness` of the estimate's distribution.
    """

    value: float
    error: float
    noise: float
    quantile: float
    skewness: float


def draw_pixels(picture: Array, count: int, seed: int) -> Draw:
    """Draw `count` pixels, at most one less, of a picture (h, w, 3): more where it is bright or varies most.

    A picture of fewer pixels is taken whole.
    """
    height, width = picture.shape[:2]
    order = _curve(width, height)
    if count >= len(order):
        return Draw(order, np.ones(len(order)), True)
    # The chance of each pixel.
    contrast = _contrast(picture)
    hints = ((CONTRAST, contrast), (SQUARED_CONTRAST, contrast**2), (BRIGHTNESS, picture.mean(-1)))
    chance = np.full(len(order), UNIFORM / len(order))
    for share, hint in hints:
        values = np.maximum(hint[order[:, 1], order[:, 0]], 0.0)
        total = values.sum()
        chance += share * (values / total if total > 0 else 1.0 / len(order))
    # Two draws in each of count / 2 strata of equal probability.
    strata = max(count // 2, 1)
    rng = np.random.default_rng((0x6365_7274, seed))
    points = (np.repeat(np.arange(strata), 2) + rng.random(2 * strata)) / strata
    cumulative = np.cumsum(chance)
    chosen = np.searchsorted(cumulative, points * cumulative[-1], side="right").clip(0, len(order) - 1)
    return Draw(order[chosen], 1.0 / (chance[chosen] * len(order)))


def _contrast(picture: Array) -> Array:
    """Return how much each pixel differs from its neighbours, relative, (h, w): noise and edges stand out."""
    height, width = picture.shape[:2]
    padded = np.pad(picture, ((1, 1), (1, 1), (0, 0)), mode="edge")
    around = np.stack([padded[1 + y : 1 + y + height, 1 + x : 1 + x + width] for x, y in NEIGHBOURS])
    floor = 0.01 * max(float(picture.mean()), 1e-100) ** 2
    squared = ((around - picture) ** 2).mean(0) / (np.minimum(around.min(0), picture) ** 2 + floor)
    return np.sqrt(squared.mean(-1))


def _curve(width: int, height: int) -> NDArray[np.int64]:
    """Return all pixels (x, y) in the order of a Morton curve, along which neighbours stay close."""
    y, x = (axis.ravel() for axis in np.mgrid[:height, :width])
    code = np.zeros(len(x), np.int64)
    for bit in range(16):
        code |= ((x >> bit) & 1) << (2 * bit) | ((y >> bit) & 1) << (2 * bit + 1)
    order = np.argsort(code, kind="stable")
    return np.stack([x[order], y[order]], axis=-1)


def estimate(draw: Draw, values: Array, noise: Array, *, skewed: bool) -> Estimate:
    """Return the mean over the picture of a quantity: `values` (n,) at the drawn pixels, of variance `noise` (n,).

    It is their weighted mean (Hajek's ratio estimator), whose error is 0 for a constant.

    With `skewed`, few values may hold most of the mean: strata then lower the error in most draws by more than in the
    worst, so it is that without strata.
    """
    count, mean = len(values), float(np.average(values, weights=draw.weights))
    weights = draw.weights / draw.weights.mean()
    share = float(np.sum(weights**2 * noise)) / count**2
    if draw.is_census:
        return Estimate(mean, math.sqrt(share), share, QUANTILES[0], 0.0)
    deviations = weights * (values - mean)
    if not skewed:
        squares = (deviations[0::2] - deviations[1::2]) ** 2
        variance = float(squares.sum()) / count**2
        # Each difference has one degree of freedom; a normal one has a fourth moment of 3.
        freedom = 3 * _ratio(float(squares.sum()) ** 2, float(np.sum(squares**2)))
        return Estimate(mean, math.sqrt(variance), share, _quantile(freedom), 0.0)
    squares = deviations**2
    variance = float(squares.sum()) / (count - 1) / count
    kurtosis = _ratio(float(np.mean(squares**2)), float(squares.mean()) ** 2)
    skewness = _ratio(float(np.sum(deviations**3)) / count**3, variance**1.5)
    return Estimate(mean, math.sqrt(variance), share, _quantile(_ratio(2 * count, kurtosis - 1)), skewness)


def _ratio(above: float, below: float) -> float:
    return above / below if below > 0 else 0.0


def _quantile(freedom: float) -> float:
    return float(np.interp(1 / max(freedom, 2.0), ONE_OVER_FREEDOM, QUANTILES))


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


def truth_mean(draw: Draw, picture: Array, truth: Array, noise: Array, mean: float) -> tuple[Estimate, Array]:
    """Return the mean of the truth over a picture whose mean is `mean`, from both at the drawn pixels.

    `picture`, `truth` (n,); `noise` (n,) is the variance of the truth. The second result (n,) is what each pixel
    deviates by from the regression.
    """
    # The slope: 1 where picture and truth differ little, 0 where the picture tells nothing of the truth.
    x, t = (values - np.average(values, weights=draw.weights) for values in (picture, truth))
    slope = min(max(_ratio(float(np.sum(draw.weights * x * t)), float(np.sum(draw.weights * x * x))), 0.0), 1.0)
    rest = truth - slope * picture
    found = estimate(draw, rest, noise, skewed=False)
    return replace(found, value=found.value + slope * mean), rest - found.value


def error_mean(draw: Draw, picture: Array, replicates: Array, mean: float, deviations: Array) -> Estimate:
    """Return relMSE from the picture (n, 3) and replicates (n, R, 3) of the truth at the drawn pixels.

    The denominator's floor, 0.01 m^2, has the error of m: `mean` and `deviations` are those of `truth_mean`. To first
    order, a pixel's deviation moves relMSE by its derivative.
    """
    values, noise = jackknife(picture, replicates, 0.01 * mean**2)
    near, _ = jackknife(picture, replicates, 0.01 * (mean * (1 + STEP)) ** 2)
    slope = float(np.average(near - values, weights=draw.weights)) / (STEP * mean)
    return estimate(draw, values + slope * deviations, noise, skewed=True)


def bias_interval(mean: float, truth: Estimate) -> Interval:
    """Return the bias of a picture of this mean, mean(x - t) / mean(t): symmetric in the logarithm of mean(t)."""
    factor = math.exp(min(truth.quantile * truth.error / truth.value, 700.0))
    return Interval(mean / truth.value - 1, mean / truth.value / factor - 1, mean / truth.value * factor - 1)


def error_interval(error: Estimate) -> Interval:
    """Return Hall's interval of an error that is not negative."""
    low = error.value - error.error * _unskewed(error.quantile, error.skewness)
    high = error.value - error.error * _unskewed(-error.quantile, error.skewness)
    return Interval(max(error.value, 0.0), max(low, 0.0), max(high, 0.0))


def _unskewed(deviation: float, skewness: float) -> float:
    """Return the deviation, in standard errors, whose transform by Hall is `deviation`: equation 3 of Hall 1992."""
    if abs(skewness) < 1e-3:
        return deviation
    return 3 / skewness * (float(np.cbrt(1 + skewness * (deviation - skewness / 6))) - 1)
