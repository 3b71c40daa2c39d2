"""The sampling table of an environment map: densities proportional to filtered luminance times solid angle."""

from __future__ import annotations

import math

import numpy as np
import pytest

from wgpu_gi.pictures.color import REC709_LUMINANCE
from wgpu_gi.scene.scene import Environment
from wgpu_gi.upload.environment_cdf import CDF_WIDTH, environment_cdf


def density(cdf):
    """Return the probability of each entry of a table, (rows, columns)."""
    rows = np.diff(cdf[:, -1].astype(np.float64), prepend=0)
    return rows[:, None] * np.diff(cdf[:, :-1].astype(np.float64), axis=1, prepend=0)


def sample_map(luminance, u, v):
    """Sample a map like wgsl/scene/lights.wgsl: bilinear, wrapping in u, clamped in v."""
    h, w = luminance.shape
    x, y = u * w - 0.5, v * h - 0.5
    x0, y0 = np.floor(x).astype(int), np.floor(y).astype(int)
    fx, fy = x - x0, y - y0
    rows = np.clip([y0, y0 + 1], 0, h - 1)
    columns = np.array([x0, x0 + 1]) % w
    top = luminance[rows[0], columns[0]] * (1 - fx) + luminance[rows[0], columns[1]] * fx
    bottom = luminance[rows[1], columns[0]] * (1 - fx) + luminance[rows[1], columns[1]] * fx
    return top * (1 - fy) + bottom * fy


@pytest.mark.parametrize("shape", [(1, 1), (2, 3), (16, 32), (5, 700), (60, CDF_WIDTH + 1), (600, 16)])
def test_density_is_proportional_to_filtered_luminance(shape):
    rng = np.random.default_rng(0)
    image = rng.random((*shape, 3)).astype(np.float32) ** 4
    cdf = environment_cdf(Environment((2.0, 0.5, 1.0), image))
    rows, columns = min(shape[0], CDF_WIDTH), min(shape[1], CDF_WIDTH)
    assert cdf.dtype == np.float32 and cdf.shape == (rows, columns + 1)
    assert (cdf[:, -2] == 1).all() and cdf[-1, -1] == 1
    assert (np.diff(cdf[:, :-1], axis=1) >= 0).all() and (np.diff(cdf[:, -1]) >= 0).all()
    probability = density(cdf)
    assert probability.sum() == pytest.approx(1)
    # The mean of the filtered map over each entry, by many samples.
    luminance = image @ (REC709_LUMINANCE * (2.0, 0.5, 1.0))
    n = 12
    v, u = np.meshgrid(
        (np.arange(rows * n) + 0.5) / (rows * n), (np.arange(columns * n) + 0.5) / (columns * n), indexing="ij"
    )
    seen = sample_map(luminance, u, v).reshape(rows, n, columns, n).mean((1, 3))
    sine = np.sin((np.arange(rows) + 0.5) / rows * math.pi)[:, None] * np.ones(columns)
    expected = 0.99 * seen * sine / (seen * sine).sum() + 0.01 * sine / sine.sum()
    assert np.abs(probability - expected).max() < 0.02 * expected.max()
    assert np.abs(probability / expected - 1).mean() < 0.01


def test_density_covers_the_filtered_sun_of_one_pixel():
    """Bilinear filtering spreads the sun over its neighbours; radiance over density stays bounded everywhere."""
    image = np.full((32, 64, 3), 0.1, np.float32)
    image[10, 0] = 1e5
    cdf = environment_cdf(Environment(image=image))
    v, u = np.meshgrid((np.arange(320) + 0.5) / 320, (np.arange(640) + 0.5) / 640, indexing="ij")
    seen = sample_map(image.astype(np.float64) @ REC709_LUMINANCE, u, v)
    sine = np.sin(v * math.pi)
    ratio = seen * sine / (seen * sine).mean() / np.repeat(np.repeat(density(cdf), 10, 0), 10, 1) / density(cdf).size
    assert ratio.max() < 20  # 16 at the corners, where a quarter of it reaches into cells that have a 64th


def test_environment_without_a_map_has_no_table():
    assert environment_cdf(Environment()) is None
