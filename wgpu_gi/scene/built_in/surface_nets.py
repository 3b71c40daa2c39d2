"""Meshes of implicit surfaces by surface nets (Gibson 1998, "Constrained Elastic Surface Nets").

A cell of the grid whose corners differ in sign gets one vertex; an edge whose ends differ in sign gets a quad of the
vertices of its four cells. Departure: instead of relaxing the net, vertices move onto the surface along the gradient.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Field = Callable[[Array], Array]

STEPS = 4  # of Newton's method, from at most half a cell away
SLAB = 1 << 18  # points evaluated at a time


def surface_net(field: Field, low: Array, high: Array, cell: float) -> tuple[Array, Array, NDArray[np.int64]]:
    """Return positions (n, 3), unit normals (n, 3) and triangles (m, 3) of the surface field = 0.

    field: takes points (k, 3), returns (k,), negative inside, about a distance. The surface lies within the box from
    `low` to `high`; `cell` is the length of the edges of the grid.
    """
    # Evaluate the corners of the grid.
    counts = np.ceil((high - low) / cell).astype(int) + 2
    axes = [low[k] - cell / 2 + cell * np.arange(counts[k]) for k in range(3)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    values = np.concatenate([field(points[k : k + SLAB]) for k in range(0, len(points), SLAB)]).reshape(counts)
    # Number the cells that the surface crosses; their centres are the first guess of their vertices.
    inside = values < 0
    cells = [inside[x : counts[0] - 1 + x, y : counts[1] - 1 + y, z : counts[2] - 1 + z] for x, y, z in CORNERS]
    crossed = np.logical_or.reduce(cells) & ~np.logical_and.reduce(cells)
    number = np.full(crossed.shape, -1, np.int64)
    number[crossed] = np.arange(np.count_nonzero(crossed))
    vertices = np.stack([axes[k][where] + cell / 2 for k, where in enumerate(np.nonzero(crossed))], axis=1)
    triangles = np.concatenate([_triangles(inside, number, axis) for axis in range(3)])
    # Move the vertices onto the surface, each within its cell.
    centres = vertices.copy()
    for _ in range(STEPS):
        slopes = gradient(field, vertices, cell)
        vertices = vertices - slopes * (field(vertices) / np.maximum((slopes**2).sum(1), 0.1))[:, None]
        vertices = np.clip(vertices, centres - cell / 2, centres + cell / 2)
    slopes = gradient(field, vertices, cell)
    return vertices, slopes / np.linalg.norm(slopes, axis=1, keepdims=True), triangles


CORNERS = tuple(product((0, 1), repeat=3))


def gradient(field: Field, points: Array, cell: float) -> Array:
    """Return the gradient of a field at points (n, 3) by central differences over a quarter of a cell."""
    steps = np.eye(3) * cell / 8
    return np.stack([(field(points + step) - field(points - step)) / (cell / 4) for step in steps], axis=1)


def _triangles(inside: NDArray[np.bool_], number: NDArray[np.int64], axis: int) -> NDArray[np.int64]:
    """Return two triangles for each edge along `axis` whose ends differ, seen counter-clockwise from outside."""
    first, second = (np.take(inside, range(k, inside.shape[axis] - 1 + k), axis) for k in (0, 1))
    edges = np.argwhere(first != second)
    outward = first[tuple(edges.T)]  # the surface faces along the axis
    u, v = np.eye(3, dtype=int)[(axis + 1) % 3], np.eye(3, dtype=int)[(axis + 2) % 3]
    a, b, c, d = (number[tuple((edges - step).T)] for step in (u + v, v, 0 * u, u))
    b, d = np.where(outward, b, d), np.where(outward, d, b)
    return np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
