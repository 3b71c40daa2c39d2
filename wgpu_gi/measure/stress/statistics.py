"""Tests of whether pictures with noise have the same mean: Student's t by region, and sign flips for clusters.

Both test differences d_i, i = 1 ... n, of independent pairs of pictures, whose mean is zero if a relation holds.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def student_p(t: float, freedom: int) -> float:
    """Return the probability of |T| > |t| for Student's T: the incomplete beta function I_x(freedom / 2, 1 / 2)."""
    if not math.isfinite(t):
        return 0.0
    x = freedom / (freedom + t * t)
    return _incomplete_beta(freedom / 2, 0.5, x)


def _incomplete_beta(a: float, b: float, x: float) -> float:
    """Return I_x(a, b) by its continued fraction (Press et al. 2007, Numerical Recipes, section 6.4)."""
    if x <= 0.0 or x >= 1.0:
        return min(max(x, 0.0), 1.0)
    if x > (a + 1) / (a + b + 2):
        return 1.0 - _incomplete_beta(b, a, 1.0 - x)
    front = math.exp(a * math.log(x) + b * math.log1p(-x) + math.lgamma(a + b) - math.lgamma(a) - math.lgamma(b)) / a
    # Lentz's method; `tiny` stands for zero in the denominators.
    tiny = 1e-300
    c, d = 1.0, 1.0 / max(1.0 - (a + b) * x / (a + 1), tiny)
    total = d
    for m in range(1, 500):
        for numerator in (
            m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m)),
            -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1)),
        ):
            d = 1.0 / (1.0 + numerator * d or tiny)
            c = 1.0 + numerator / c or tiny
            total *= c * d
        if abs(c * d - 1.0) < 1e-14:
            break
    return front * total


def mean_p(differences: Floats, margin: Floats | float = 0.0) -> Floats:
    """Return p-values (m,) that the means of `differences` (n, m) are within +-`margin` of zero; n is at least 2.

    Equal differences beyond the margin have p = 0, within it p = 1. A t-test of symmetric noise with heavy tails is
    conservative.
    """
    count = len(differences)
    mean = differences.mean(0)
    error = differences.std(0, ddof=1) / math.sqrt(count)
    excess = np.maximum(np.abs(mean) - margin, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.where(excess > 0, excess / error, 0.0)
    return np.array([student_p(float(value), count - 1) for value in t])


def family_p(p: Floats) -> float:
    """Return the p-value of the smallest of several p-values (Bonferroni): valid however they depend on another."""
    return min(1.0, float(len(p) * p.min(initial=1.0)))


def cluster_p(
    differences: Floats, margin: Floats | float = 0.0, limit: float = 3.0, flips: int = 4095, seed: int = 0
) -> tuple[float, float]:
    """Return the share of values whose mean is beyond `margin` and whose |t| is beyond `limit`, and its p-value.

    `differences` is (n, m). The signs of whole pictures are flipped at random: under symmetric noise each flip is as
    likely as the data, however the pixels depend on another. The smallest p-value is 1 / (`flips` + 1), or 2^(1 - n).
    """
    count = len(differences)
    sums = np.sqrt((differences**2).sum(0))
    used = sums > 0
    if not used.any():
        return 0.0, 1.0
    # With unit sums of squares, |t| > limit if the sum s exceeds a bound: t^2 = (n - 1) s^2 / (n - s^2).
    bound = limit * math.sqrt(count / (count - 1 + limit**2))
    needed = np.maximum(bound, count * np.broadcast_to(margin, sums.shape)[used] / sums[used])
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], (flips, count))
    found = np.abs(np.concatenate([np.ones((1, count)), signs]) @ (differences[:, used] / sums[used]))
    # The sum over the values beyond tells flips apart that have equally many.
    exceeding = found > needed
    mass = np.where(exceeding, found, 0.0).sum(1)
    return float(exceeding[0].sum() / len(sums)), float((mass >= mass[0] * (1 - 1e-12)).mean())
