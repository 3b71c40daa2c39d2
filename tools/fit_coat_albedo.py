#!/usr/bin/env python3
"""Fit the coefficients of `wgsl/common/coat_albedo.wgsl` and print them: python tools/fit_coat_albedo.py

Quadrature gives the truth: visible normals (Dupuy and Benyoub 2023), by the midpoint rule. M is fitted by
Levenberg-Marquardt, reweighted towards the smallest maximum error, with its mean over the hemisphere held at a smooth
function of alpha: that mean, and not M's own error, decides how far a white furnace is off where M is tiny.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

MIN_ALPHA, DIELECTRIC_F0 = 0.001, 0.04

# Degrees in the roughness of p0, p1, q1, q2, q3. With 5, 4, 5, 5, 5 M errs by 0.0031 instead of 0.0019.
DEGREES = (6, 5, 6, 6, 6)
COSINE_DEGREE = 4  # of g0 .. g3; 3 adds 0.0003 to the error of T, 5 subtracts nothing
MEAN_DEGREES = (3, 4)  # of the means of M (beside a logarithm) and T
# Errors of M count 1 + TAIL / M times: M is tiny far from grazing angles, and there its shape matters, too.
TAIL = 0.003
MEAN_WEIGHT = 33.0  # of the mean's relative error
STEPS = 1500


def coat_losses(mu: Any, alpha: Any, heights: int = 192, turns: int = 64) -> tuple[Floats, Floats]:
    """Return M and T of `coat_albedo.wgsl` by quadrature; `mu` in (0, 1) and `alpha` broadcast to a shape (n,)."""
    cosine, width = (a.reshape(-1, 1, 1) for a in np.broadcast_arrays(np.asarray(mu, np.float64), alpha))
    u = (np.arange(heights) + 0.5) / heights
    # The smoothest step and its slope: points are denser at both ends, where the shadowing term has kinks.
    step, slope = u**3 * (10 + u * (6 * u - 15)), 30 * (u * (1 - u)) ** 2
    phi = np.pi * (np.arange(turns) + 0.5) / turns
    sine = np.sqrt(1 - cosine**2)
    length = np.hypot(width * sine, cosine)
    across, up = width * sine / length, cosine / length
    height = step[:, None] * (1 + up)
    ring = np.sqrt(np.maximum(1 - (height - up) ** 2, 0))
    x, y = width * (ring * np.cos(phi) + across), width * ring * np.sin(phi)
    norm = np.sqrt(x**2 + y**2 + height**2)
    h_o = (sine * x + cosine * height) / norm
    cos_i = 2 * h_o * height / norm - cosine
    root_i, root_o = (np.sqrt(width**2 + (1 - width**2) * c**2) for c in (cos_i, cosine))
    below = cos_i <= 0
    weight = slope[:, None] * cos_i * (cosine + root_o) / np.where(below, 1, cos_i * root_o + cosine * root_i)
    weight = np.where(below, 0, weight)
    reflected = weight.mean((1, 2))
    by_fresnel = (weight * np.clip(1 - h_o, 0, 1) ** 5).mean((1, 2))
    return 1 - reflected, 1 - DIELECTRIC_F0 * reflected - (1 - DIELECTRIC_F0) * by_fresnel


def hemisphere(count: int) -> tuple[Floats, Floats]:
    """Return cosines in (0, 1), dense near 0, and weights of 2 integral f(mu) mu dmu, each (count,)."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    root = (nodes + 1) / 2
    return np.minimum(root**4, 0.99999), 4 * root**7 * weights


class Grid:
    """Truth on a grid of `widths` alphas, as flat arrays (widths * COSINES,)."""

    def __init__(self, widths: int = 49, cosines: int = 120) -> None:
        self.alphas = np.linspace(MIN_ALPHA**0.25, 1, widths) ** 4
        cosine, self.weights = hemisphere(cosines)
        missing, transmitted = np.array([coat_losses(cosine, a) for a in self.alphas]).transpose(1, 0, 2)
        self.missing, self.transmitted = np.maximum(missing, 0).ravel(), transmitted.ravel()
        self.mu, self.alpha = np.tile(cosine, widths), self.alphas.repeat(cosines)

    def means(self, values: Floats) -> Floats:
        """Return the mean over the hemisphere for each alpha; `values` are (n, ...)."""
        return np.einsum("am...,m->a...", values.reshape(len(self.alphas), -1, *values.shape[1:]), self.weights)


def powers(alpha: Floats, degree: int) -> Floats:
    """Return the powers of the roughness, (n, degree + 1)."""
    return np.sqrt(alpha)[:, None] ** np.arange(degree + 1)


def least_maximum(basis: Floats, values: Floats, weights: Floats | float = 1.0) -> Floats:
    """Return coefficients of a linear fit, reweighted towards the smallest maximum of the weighted error."""
    share: Floats = np.ones(len(values))
    best: Floats = np.zeros(basis.shape[1])
    least = np.inf
    for _ in range(80):
        scale = np.sqrt(share) * weights
        found: Floats = np.linalg.lstsq(basis * scale[:, None], values * scale, rcond=1e-13)[0].astype(np.float64)
        error = np.abs(basis @ found - values) * weights
        if error.max() < least:
            best, least = found, error.max()
        share *= (error + 1e-9) ** 0.7
        share /= share.mean()
    return best


def mean_of_missing(alpha: Floats, coefficients: Floats) -> Floats:
    """Return <M> = alpha^2 (a polynomial of r + c log2(r))."""
    return alpha**2 * (np.column_stack([powers(alpha, MEAN_DEGREES[0]), np.log2(np.sqrt(alpha))]) @ coefficients)


def fit_mean_of_missing(grid: Grid) -> Floats:
    """Return the coefficients of `mean_of_missing`."""
    basis = np.column_stack([powers(grid.alphas, MEAN_DEGREES[0]), np.log2(np.sqrt(grid.alphas))])
    values = grid.means(grid.missing) / grid.alphas**2
    return np.linalg.lstsq(basis / values[:, None], np.ones(len(values)), rcond=1e-13)[0]


class MissingFit:
    """M = above / below. Both are divided by (1 + t)^3, which keeps every term within 0 and 1."""

    def __init__(self, mu: Floats, alpha: Floats) -> None:
        x = mu / (mu + alpha)
        self.constant = (1 - x) ** 3
        factors = [x * (1 - x) ** 2, x * (1 - x) ** 2 * mu, x * (1 - x) ** 2, x**2 * (1 - x), x**3]
        terms = [f[:, None] * powers(alpha, degree) for f, degree in zip(factors, DEGREES, strict=True)]
        self.above, self.below = np.concatenate(terms[:2], 1), np.concatenate(terms[2:], 1)
        self.least = 1e-3 * (self.constant + x**3)  # keeps `below` away from zero

    def __call__(self, coefficients: Floats) -> tuple[Floats, Floats]:
        """Return M and the denominator."""
        count = self.above.shape[1]
        below = self.constant + self.below @ coefficients[count:]
        return self.above @ coefficients[:count] / below, below


def fit_missing(grid: Grid, means: Floats) -> Floats:
    """Return the coefficients of M, whose mean is held at `means`, for each alpha."""
    model, truth = MissingFit(grid.mu, grid.alpha), grid.missing
    weight = (1 + TAIL / (truth + 1e-5)) ** 2
    # Start with the linear problem: above - M below = 0, divided by the denominator of the step before.
    below, found = np.ones(len(truth)), np.zeros(0)
    basis = np.concatenate([model.above, -model.below * truth[:, None]], 1)
    for _ in range(20):
        scale = np.sqrt(weight) / below
        found = np.linalg.lstsq(basis * scale[:, None], truth * model.constant * scale, rcond=1e-10)[0]
        below = np.maximum(model(found)[1], 1e-3)
    # Improve by Levenberg-Marquardt, with more weight where the error is large.
    share, damping, best, least = np.ones(len(truth)), 1e-4, found, np.inf
    for step in range(STEPS):
        values, below = model(found)
        rows = np.concatenate([model.above, -model.below * values[:, None]], 1) / below[:, None]
        mean_rows = MEAN_WEIGHT * grid.means(rows) / means[:, None]
        weights = weight * share
        error, mean_error = values - truth, MEAN_WEIGHT * (grid.means(values) / means - 1)
        matrix = (rows * weights[:, None]).T @ rows + mean_rows.T @ mean_rows
        slope = rows.T @ (weights * error) + mean_rows.T @ mean_error
        cost, scale = weights @ error**2 + mean_error @ mean_error, np.sqrt(np.diag(matrix)) + 1e-15
        improved = False
        for _ in range(12):
            damped = matrix / scale / scale[:, None] + damping * np.eye(len(slope))
            moved = found + np.linalg.lstsq(damped, -slope / scale, rcond=None)[0] / scale
            new, new_below = model(moved)
            new_mean = MEAN_WEIGHT * (grid.means(new) / means - 1)
            improved = bool(
                (new_below > model.least).all() and weights @ (new - truth) ** 2 + new_mean @ new_mean < cost
            )
            damping = max(damping / 4, 1e-12) if improved else damping * 5
            if improved:
                found = moved
                break
        damping = damping if improved else 1e-4
        error = np.abs(model(found)[0] - truth) * np.sqrt(weight)
        if error.max() < least:
            best, least = found, error.max()
        if step % 3 == 2 or not improved:
            share *= np.sqrt(error / error.max() + 0.05)
            share /= share.mean()
    return best


def fresnel_cosine_basis(mu: Floats, alpha: Floats) -> Floats:
    """Return the terms of g, (n, 4 * (COSINE_DEGREE + 1))."""
    s = np.sqrt(alpha**2 + (1 - alpha**2) * mu**2)
    terms = [f[:, None] * powers(alpha, COSINE_DEGREE) for f in (np.ones_like(mu), mu, s, alpha / s)]
    return np.concatenate(terms, 1)


def transmitted(missing: Floats, fresnel_cosine: Floats) -> Floats:
    """Return T."""
    return 1 - (1 - missing) * (DIELECTRIC_F0 + (1 - DIELECTRIC_F0) * (1 - fresnel_cosine) ** 5)


def wgsl(values: Any) -> str:
    """Return numbers as in the shader, comma-separated."""
    return ", ".join(f"{v:.7g}" for v in values)


def main() -> None:
    """Fit, and print the coefficients by falling powers of the roughness and the errors."""
    grid = Grid()
    mean_missing = fit_mean_of_missing(grid)
    means = mean_of_missing(grid.alphas, mean_missing)
    found = fit_missing(grid, means)
    missing = np.maximum(MissingFit(grid.mu, grid.alpha)(found)[0], 0)
    # Fit g to the cosine that makes T exact with the fitted M; an error of g counts as much as it changes T.
    reflected = ((1 - grid.transmitted) / (1 - missing) - DIELECTRIC_F0) / (1 - DIELECTRIC_F0)
    cosine = 1 - np.maximum(reflected, 1e-12) ** 0.2
    basis = fresnel_cosine_basis(grid.mu, grid.alpha)
    g = least_maximum(basis, cosine, 5 * (1 - missing) * (1 - np.clip(cosine, 0, 1)) ** 4 + 1e-4)
    passed = transmitted(missing, basis @ g)
    passed_means = grid.means(passed)
    mean_passed = least_maximum(powers(grid.alphas, MEAN_DEGREES[1]), passed_means, 1 / passed_means)

    p0, p1, *q = np.split(found, np.cumsum([d + 1 for d in DEGREES])[:-1])
    print("p0, q1, q2, q3:", *(wgsl(c) for c in np.stack([p0, *q], 1)[::-1]), sep="\n    ")
    print("p1:", wgsl(p1[::-1]))
    print("g0 .. g3:", *(wgsl(c) for c in g.reshape(4, -1).T[::-1]), sep="\n    ")
    print("mean of M:", wgsl(mean_missing[-2::-1]), "and of the logarithm", wgsl(mean_missing[-1:]))
    print("mean of T:", wgsl(mean_passed[::-1]))
    errors = (np.abs(missing - grid.missing).max(), np.abs(passed - grid.transmitted).max())
    print(f"largest errors: M {errors[0]:.4f}, T {errors[1]:.4f}")


if __name__ == "__main__":
    main()
