#!/usr/bin/env python3
"""Fit the coefficients of `wgsl/common/anisotropy.wgsl` and print them: python tools/fit_anisotropy.py

Quadrature over visible normals gives the truth. Logarithms of the ratios to isotropic lobes are polynomials, reweighted
towards the smallest maximum error.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from fit_coat_albedo import MIN_ALPHA, Floats, coat_losses, hemisphere, wgsl

ROUGHNESS = (0.0, 0.1, 0.2, 0.35, 0.5, 0.7, 0.9)
ANISOTROPY = (0.15, 0.3, 0.5, 0.7, 0.85, 1.0)
TURNS = 7  # azimuths from the direction of stretch to that across


def stretched_losses(mu: Any, phi: Any, along: Any, across: Any, heights: int = 64, turns: int = 160) -> Any:
    """Return M and B, the integrals of 1 - D V cos and D V cos (1 - v.h)^5, of lobes of two widths; (n,) each."""
    mu, phi, a, b = (np.reshape(v, (-1, 1, 1)) for v in np.broadcast_arrays(mu, phi, along, across))
    u = (np.arange(heights) + 0.5) / heights
    step, slope = u**3 * (10 + u * (6 * u - 15)), 30 * (u * (1 - u)) ** 2
    turn = 2 * np.pi * (np.arange(turns) + 0.5) / turns
    sine = np.sqrt(1 - mu**2)
    o = np.stack([sine * np.cos(phi), sine * np.sin(phi), mu])
    axes = np.stack([a, b, np.ones_like(a)])
    length_o = np.sqrt(((axes * o) ** 2).sum(0))
    top = axes * o / length_o
    z = step[:, None] * (1 + top[2]) - top[2]
    ring = np.sqrt(np.maximum(1 - z * z, 0))
    x, y = a * (ring * np.cos(turn) + top[0]), b * (ring * np.sin(turn) + top[1])
    h = np.stack([x, y, np.broadcast_to(z + top[2], x.shape)])
    h /= np.sqrt((h**2).sum(0))
    o_h = (o * h).sum(0)
    i = 2 * o_h * h - o
    length_i = np.sqrt(((axes * i) ** 2).sum(0))
    below = i[2] <= 0
    weight = slope[:, None] * i[2] * (mu + length_o) / np.where(below, 1, i[2] * length_o + mu * length_i)
    weight = np.where(below, 0, weight)
    return 1 - weight.mean((1, 2)), (weight * np.clip(1 - o_h, 0, 1) ** 5).mean((1, 2))


def isotropic(mu: Floats, alpha: Floats) -> tuple[Floats, Floats]:
    """Return M and B of a lobe of one width."""
    missing, passed = coat_losses(mu, alpha, 64, 48)
    return missing, (1 - passed - 0.04 * (1 - missing)) / 0.96


def powers_of(degree: int, *variables: Floats) -> Floats:
    """Return the monomials up to a degree, (n, terms), by powers of the first variable, then the second and so on."""
    exponents = [e for e in itertools.product(range(degree + 1), repeat=len(variables)) if sum(e) <= degree]
    return np.stack([np.prod([v**i for v, i in zip(variables, e, strict=True)], 0) for e in exponents], 1)


def fit_ratio(truth: Floats, plain: Floats, basis: Floats, floor: float = 1e-3) -> tuple[Floats, Floats]:
    """Return coefficients of log(truth / plain), and the fitted values."""
    values = np.log(np.maximum(truth, 1e-7) / np.maximum(plain, 1e-7))
    share, best, least = np.ones(len(truth)), (np.zeros(basis.shape[1]), plain), np.inf
    for _ in range(60):
        rows = basis * (np.sqrt(share) * np.maximum(truth, floor))[:, None]
        matrix = rows.T @ rows
        matrix += 1e-10 * np.trace(matrix) / len(matrix) * np.eye(len(matrix))
        found = np.linalg.solve(matrix, rows.T @ (values * np.sqrt(share) * np.maximum(truth, floor)))
        fitted = plain * np.exp(np.clip(basis @ found, -20, 5))
        error = np.abs(fitted - truth)
        if error.max() < least:
            best, least = (found, fitted), error.max()
        share *= (error + 1e-6) ** 0.5
        share /= share.mean()
    return best


def main() -> None:
    """Fit and print the coefficients and the errors."""
    mus, weights = hemisphere(12)
    phis = (np.arange(TURNS) + 0.5) / TURNS * np.pi / 2
    pairs = [(max(r * r, MIN_ALPHA), a) for r in ROUGHNESS for a in ANISOTROPY]
    pairs = [(b + (1 - b) * a * a, b) for b, a in pairs]
    mu, phi = (v.ravel() for v in np.meshgrid(mus, phis, indexing="ij"))
    truth = np.array([stretched_losses(mu, phi, a, b) for a, b in pairs])
    missing, grazing = truth[:, 0].ravel(), truth[:, 1].ravel()
    along, across = (np.repeat(v, mu.size) for v in np.array(pairs).T)
    mu, phi = np.tile(mu, len(pairs)), np.tile(phi, len(pairs))
    mean = np.sqrt((along**2 + across**2) / 2)
    towards = np.hypot(along * np.cos(phi), across * np.sin(phi))
    stretch = 1 - across / along
    plain_missing, plain_grazing = isotropic(mu, mean)[0], isotropic(mu, towards)[1]

    def means(values: Floats) -> Floats:
        return np.einsum("amp,m->a", values.reshape(len(pairs), len(mus), TURNS), weights) / TURNS

    axis = np.cos(phi) ** 2
    m, fitted_m = fit_ratio(
        missing, plain_missing, stretch[:, None] * powers_of(2, np.sqrt(mean), mu / (mu + mean), axis, stretch)
    )
    b, fitted_b = fit_ratio(
        grazing, plain_grazing, stretch[:, None] * powers_of(2, np.sqrt(mean), np.cbrt(mu), axis, np.sqrt(towards))
    )
    print("M:", wgsl(m), "\nB:", wgsl(b))
    # M must not be too large, nor B too small, or surfaces gain light.
    over, under = (fitted_m - missing).max(), (grazing - fitted_b).max()
    over_stretch, under_stretch = ((fitted_m - missing) / stretch).max(), ((grazing - fitted_b) / stretch).max()
    lowered = np.maximum(fitted_m - np.minimum(over, over_stretch * stretch), 0)
    raised = fitted_b + np.minimum(under, under_stretch * stretch)
    print(f"M: subtract min({over:.4f}, {over_stretch:.4f} k); B: add min({under:.4f}, {under_stretch:.4f} k)")
    print(f"M too small by up to {(missing - lowered).max():.4f}, B too large by {(raised - grazing).max():.4f}")
    one = slice(None, None, mu.size // len(pairs))
    q, k = np.sqrt(mean[one]), stretch[one]
    for name, values, plain in (
        ("M", means(lowered), means(plain_missing)),
        ("B", means(raised), means(isotropic(mu, mean)[1])),
    ):
        values, plain = np.maximum(values, 0.004), np.maximum(plain, 0.004)
        found, fitted = fit_ratio(values, plain, k[:, None] * powers_of(3, q, k), 0.02)
        error = (values / fitted).max(), (fitted - values).max(), np.abs(fitted - values).max()
        print(f"mean of {name}:", wgsl(found), "at most {:.4f} times, {:.4f} below, {:.4f} off".format(*error))


if __name__ == "__main__":
    main()
