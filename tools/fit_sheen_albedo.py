#!/usr/bin/env python3
"""Fit the coefficients of `wgsl/common/sheen.wgsl` and print them: python tools/fit_sheen_albedo.py

Quadrature gives the truth. The logarithm of the albedo is a polynomial of the square root of the roughness and the cube
root of the cosine, reweighted towards the smallest maximum error; errors of albedos above 1 are relative.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from fit_coat_albedo import Floats, hemisphere, wgsl

MIN_ROUGHNESS = 0.07
# Degrees in the roughness and the cosine. With (4, 4) the error is 0.009, with (6, 6) 0.006 instead of 0.007.
DEGREES = (5, 4)
MEAN_DEGREE = 5  # of the mean; with 4 it errs by 0.0006 instead of 0.0001


def shadowing(cosine: Any, alpha: Any) -> Floats:
    """Return Lambda of the Charlie sheen (Estevez and Kulla 2017, section 3; the coefficients are theirs)."""
    share = (1 - np.asarray(alpha, np.float64)) ** 2

    def exponent(x: Floats) -> Floats:
        a, b, c, d, e = (
            low + share * (high - low)
            for low, high in (
                (21.5473, 25.3245),
                (3.82987, 3.32435),
                (0.19823, 0.16801),
                (-1.97760, -1.27393),
                (-4.32054, -4.85967),
            )
        )
        return np.asarray(a / (1 + b * x**c) + d * x + e)

    x = np.abs(np.asarray(cosine, np.float64))
    half = np.full_like(x, 0.5)
    return np.exp(np.where(x < 0.5, exponent(x), 2 * exponent(half) - exponent(1 - x)))


def sheen_albedo(mu: float, roughness: Any, cosines: int = 300, turns: int = 300) -> Floats:
    """Return the integral of D V cos over the hemisphere at one cosine, for roughnesses (n,)."""
    alpha = np.asarray(roughness, np.float64) ** 2
    root = (np.arange(cosines) + 0.5) / cosines
    cos_i, weight = root**2, 2 * root**3 / cosines
    phi = np.pi * (np.arange(turns) + 0.5) / turns
    between = cos_i[:, None] * mu + np.sqrt(1 - cos_i**2)[:, None] * np.sqrt(1 - mu**2) * np.cos(phi)
    cos_h = (cos_i[:, None] + mu) / np.sqrt(2 + 2 * between)
    log_sine2 = np.log(np.maximum(1 - cos_h**2, 1e-30))
    found = []
    for a in alpha:
        distribution = (2 + 1 / a) * np.exp(log_sine2 * 0.5 / a) / (2 * np.pi)
        visibility = 1 / ((1 + shadowing(mu, a) + shadowing(cos_i, a)) * 4 * mu * cos_i)
        found.append(2 * np.pi * (distribution.mean(1) * visibility) @ weight)
    return np.array(found)


def main() -> None:
    """Fit, and print the coefficients, a row for each power of the cosine, by falling powers of the roughness."""
    roughness = np.linspace(MIN_ROUGHNESS, 1, 40)
    mu = (np.linspace(0, 1, 60) ** 2).clip(1e-4)
    truth = np.array([sheen_albedo(m, roughness) for m in mu])
    x, q = np.cbrt(mu)[:, None], np.sqrt(roughness)[None]
    basis = np.stack([(x**k * q**i).ravel() for k in range(DEGREES[1] + 1) for i in range(DEGREES[0] + 1)], 1)
    values = np.log(np.maximum(truth, 1e-8)).ravel()
    weight = np.maximum(truth.ravel(), 3e-4)
    share, best, least = np.ones(len(weight)), np.zeros(basis.shape[1]), np.inf
    for _ in range(100):
        scale = weight * np.sqrt(share)
        found = np.linalg.lstsq(basis * scale[:, None], values * scale, rcond=1e-12)[0]
        fitted = np.exp(np.clip(basis @ found, -40, 3))
        error = np.abs(fitted - truth.ravel()) / np.maximum(truth.ravel(), 1)
        if error.max() < least:
            best, least = found, error.max()
        share *= (error + 1e-7) ** 0.6
        share /= share.mean()
    for row in best.reshape(DEGREES[1] + 1, -1):
        print(wgsl(row[::-1]))
    print(f"largest error {least:.4f}")
    nodes, weights = hemisphere(40)
    means = weights @ np.array([np.minimum(sheen_albedo(m, roughness), 1) for m in nodes])
    print("mean of min(E, 1):", wgsl(np.polyfit(roughness, means, MEAN_DEGREE)))


if __name__ == "__main__":
    main()
