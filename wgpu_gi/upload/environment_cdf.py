"""Importance sampling of environment maps: the cumulative distribution of luminance over solid angle.

Pharr et al. 2023, "Physically Based Rendering", 4th ed., section 12.5. Departures: the table has at most CDF_WIDTH
entries a side, each the exact mean of the bilinearly filtered map over its texels' area; 1 % of the probability is
uniform, so that a dim texel inside a bright entry keeps a positive density.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..pictures.color import REC709_LUMINANCE
from ..scene.scene import Environment
from .light_values import environment_radiance

CDF_WIDTH = 512  # columns and rows of the table at most; an entry of a larger map covers several texels
UNIFORM_SHARE = 0.01  # share of the probability, spread evenly over the sphere


def environment_cdf(environment: Environment) -> NDArray[np.float32] | None:
    """Return the sampling table of an environment map, (rows, columns + 1) float32, or None without a map.

    Row r holds the conditional CDF of its columns; the last column holds the marginal CDF of the rows. Densities are
    proportional to luminance times solid angle, plus UNIFORM_SHARE.
    """
    if environment.image is None:
        return None
    luminance = environment.image @ (REC709_LUMINANCE * environment_radiance(environment))
    rows, columns = (min(n, CDF_WIDTH) for n in luminance.shape)
    # Average as the sampler filters: u wraps around, v is clamped.
    mean = _range_means(np.pad(luminance, ((1, 1), (0, 0)), "edge"), rows)
    mean = _range_means(np.pad(mean, ((0, 0), (1, 1)), "wrap").T, columns).T
    # Weight by solid angle, which is proportional to sin(theta).
    sine = np.sin((np.arange(rows) + 0.5) / rows * np.pi)[:, None] * np.ones(columns)
    weight, uniform = mean * sine, sine / sine.sum()
    total = weight.sum()
    weight = (1 - UNIFORM_SHARE) * weight / total + UNIFORM_SHARE * uniform if total > 0 else uniform
    # Sum up columns within each row, then rows.
    marginal = np.cumsum(weight.sum(1))
    table = np.zeros((rows, columns + 1), np.float32)
    table[:, :-1] = np.cumsum(weight, 1) / weight.sum(1, keepdims=True)
    table[:, -2] = 1.0
    table[:, -1] = marginal / marginal[-1]
    return table


def _range_means(values: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return the means of a piecewise linear function over `count` equal ranges, (count, m).

    `values` (n + 2, m) are its values at the centres of n texel rows and of one more row at either end; the ranges
    divide the n rows, from half a row before the first centre to half a row after the last.
    """
    inner = len(values) - 2
    edge = np.linspace(0.5, inner + 0.5, count + 1)
    row = np.minimum(edge.astype(np.int64), inner)
    f = (edge - row)[:, None]
    integral = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum((values[:-1] + values[1:]) / 2, 0)])
    at_edge = integral[row] + f * values[row] + f * f / 2 * (values[row + 1] - values[row])
    # Rounding of the sums must not make a range negative.
    return np.maximum(np.diff(at_edge, axis=0), 0) * (count / inner)


def environment_power(environment: Environment, radius: float) -> float:
    """Return the power of an environment map that reaches a sphere of `radius` metres, as luminance in W."""
    luminance = np.asarray(environment.image, np.float64) @ (REC709_LUMINANCE * environment_radiance(environment))
    sine = np.sin((np.arange(len(luminance)) + 0.5) / len(luminance) * np.pi)
    mean = float(luminance.mean(1) @ sine / sine.sum())
    return mean * 4 * np.pi * np.pi * radius**2
