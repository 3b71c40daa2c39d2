"""common/sampling.wgsl: samples follow their densities, by chi-square."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.statistics import chi_square_z

from wgpu_gi.measure.wgsl_evaluator import Evaluator

SAMPLING = "common/sampling.wgsl"
COUNT = 100_000


@pytest.fixture
def evaluate(tmp_path):
    return Evaluator(tmp_path)


def uniform(count=COUNT, seed=0):
    return np.random.default_rng(seed).random((count, 2)).astype(np.float32).clip(0, 1 - 2**-24)


CORNERS = np.array([(0, 0), (0, 1 - 2**-24), (1 - 2**-24, 0), (1 - 2**-24, 1 - 2**-24), (0.5, 0.5)], np.float32)


def test_cosine_hemisphere_samples_follow_their_density(evaluate):
    """Equal shares in equal steps of cos2 and of the azimuth; unit length, never below the horizon."""
    w = evaluate(SAMPLING, "sample_cosine_hemisphere(u(i))", "vec3f", u=np.concatenate([CORNERS, uniform()]))
    assert np.isfinite(w).all() and (w[:, 2] >= 0).all()
    assert np.allclose(np.linalg.norm(w, axis=1), 1, atol=1e-6)
    rows = np.minimum((w[:, 2].astype(np.float64) ** 2 * 16).astype(int), 15)
    columns = ((np.arctan2(w[:, 1], w[:, 0]) / (2 * np.pi) % 1) * 32).astype(int) % 32
    observed = np.bincount(rows * 32 + columns, minlength=512)
    assert chi_square_z(observed, np.full(512, len(w) / 512)) < 4
    assert np.allclose(w.mean(0), (0, 0, 2 / 3), atol=0.01)


def test_triangle_samples_are_uniform(evaluate):
    """Uniform over the area: equal shares in the 256 similar triangles; weights never leave the triangle."""
    b = evaluate(SAMPLING, "sample_triangle(u(i))", "vec2f", u=np.concatenate([CORNERS, uniform()])).astype(np.float64)
    assert (b >= 0).all() and (b.sum(1) <= 1).all()
    x, y = (b * 16).T
    upper = ((x % 1) + (y % 1) > 1).astype(int)
    cell = (x.astype(int) * 16 + y.astype(int)) * 2 + upper
    inside = np.array([(k // 32) + (k // 2 % 16) + k % 2 <= 15 for k in range(512)])
    observed = np.bincount(cell, minlength=512)
    assert not observed[~inside].any() and inside.sum() == 256
    assert chi_square_z(observed[inside], np.full(256, len(b) / 256)) < 4


def test_triangle_keeps_neighbours_together(evaluate):
    """No fold: points of a small square of u stay close, which keeps samples stratified."""
    u = uniform(2000) * 0.99
    near = u + 0.005
    a, b = (evaluate(SAMPLING, "sample_triangle(u(i))", "vec2f", u=v) for v in (u, near))
    assert np.abs(a - b).max() < 0.011
