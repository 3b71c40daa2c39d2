"""Sets of triangles that are hard on hierarchies, (n, 3, 3) float32."""

from __future__ import annotations

import numpy as np

SIZES = [1, 2, 5, 33, 400]


def soup(count, seed=0, size=0.1):
    """Random triangles in the unit cube, (n, 3, 3) float32."""
    rng = np.random.default_rng(seed)
    return (rng.random((count, 1, 3)) + rng.normal(scale=size, size=(count, 3, 3))).astype(np.float32)


def thin(count):
    """Long overlapping needles, which no plane separates well."""
    corners = soup(count, 1, 1e-3)
    corners[:, 1, 0] += 30
    return corners


def flat(count):
    corners = soup(count, 2)
    corners[..., 1] = 0.25
    return corners


def exponential(count):
    """Triangles that shrink exponentially towards zero: each split by area cuts off only a few."""
    corners = soup(count, 3)
    return (corners * 2.0 ** -np.linspace(0, 100, count)[:, None, None]).astype(np.float32)


SOUPS = {
    "soup": soup,
    "thin": thin,
    "flat": flat,
    "exponential": exponential,
    "coincident": lambda count: np.repeat(soup(1), count, 0),
    "points": lambda count: np.zeros((count, 3, 3), np.float32),
    "huge": lambda count: soup(count) * np.float32(1e15),
    "tiny": lambda count: soup(count) * np.float32(1e-20),
    "far": lambda count: soup(count) + np.float32(1e6),
}


def boxes(corners):
    return corners.min(1), corners.max(1)
