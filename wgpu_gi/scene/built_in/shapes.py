"""Flat-shaded meshes of simple shapes for built-in scenes and tests: quads, box, prism, arch, sphere and grid.

Triangles are counter-clockwise seen from outside, or from the tip of a quad's normal, so that emitters emit outwards.
`inward` makes a closed shape a room.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..scene import Material, Mesh

Point3 = tuple[float, float, float]


def mesh(positions: object, triangles: object, material: Material | None = None, name: str = "") -> Mesh:
    """Make a flat-shaded mesh of one material from any (n, 3) positions and (m, 3) indices."""
    return Mesh(
        positions=np.array(positions, np.float32),
        triangles=np.array(triangles, np.uint32),
        materials=[material or Material()],
        name=name,
    )


def quad(
    corner: Sequence[float],
    edge_u: Sequence[float],
    edge_v: Sequence[float],
    material: Material | None = None,
    name: str = "",
) -> Mesh:
    """Make a parallelogram of two triangles; its normal is edge_u x edge_v."""
    c, u, v = (np.asarray(x, np.float64) for x in (corner, edge_u, edge_v))
    return mesh([c, c + u, c + u + v, c + v], [[0, 1, 2], [0, 2, 3]], material, name)


def box(
    low: Sequence[float], high: Sequence[float], material: Material | None = None, inward: bool = False, name: str = ""
) -> Mesh:
    """Make an axis-aligned box of 8 vertices and 12 triangles between two corners."""
    corners = [[(low, high)[i >> axis & 1][axis] for axis in range(3)] for i in range(8)]
    # Vertex i has bit 0 set on the +X side, bit 1 on +Y, bit 2 on +Z.
    sides = [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]
    triangles = [triangle for a, b, c, d in sides for triangle in ((a, b, c), (a, c, d))]
    return mesh(corners, _facing(triangles, inward), material, name)


def quads(corners: Sequence[Sequence[Point3]], material: Material, name: str) -> Mesh:
    """Make a mesh of quads, each given by its four corners."""
    triangles = [(4 * i + a, 4 * i + b, 4 * i + c) for i in range(len(corners)) for a, b, c in ((0, 1, 2), (0, 2, 3))]
    return mesh([corner for four in corners for corner in four], triangles, material, name)


def prism(footprint: Sequence[tuple[float, float]], height: float, material: Material, name: str) -> Mesh:
    """Make a block with top, sides and bottom from four (x, z) corners on the floor, `height` metres high."""
    low = [(x, 0.0, z) for x, z in footprint]
    top = [(x, height, z) for x, z in footprint]
    sides = [[low[i], top[i], top[(i + 1) % 4], low[(i + 1) % 4]] for i in range(4)]
    return quads([top[:1] + top[:0:-1], *sides, low[1:] + low[:1]], material, name)


def arch(low: Point3, high: Point3, material: Material, name: str, segments: int = 16) -> Mesh:
    """Make a block between two corners with a semicircular opening as wide as the block, cut from below along z."""
    (left, spring, back), (right, top, front) = low, high
    radius, angles = (right - left) / 2, [math.pi * i / segments for i in range(segments + 1)]
    curve = [(left + radius * (1 - math.cos(a)), spring + radius * math.sin(a)) for a in angles]
    # Front, back, underside and top of each segment, then the two ends.
    sides: list[list[Point3]] = []
    for (xa, ya), (xb, yb) in pairwise(curve):
        sides.append([(xa, ya, front), (xb, yb, front), (xb, top, front), (xa, top, front)])
        sides.append([(xb, yb, back), (xa, ya, back), (xa, top, back), (xb, top, back)])
        sides.append([(xa, ya, back), (xb, yb, back), (xb, yb, front), (xa, ya, front)])
        sides.append([(xa, top, front), (xb, top, front), (xb, top, back), (xa, top, back)])
    for end, near, far in ((left, back, front), (right, front, back)):
        sides.append([(end, spring, near), (end, spring, far), (end, top, far), (end, top, near)])
    return quads(sides, material, name)


def sphere(
    centre: Sequence[float] = (0.0, 0.0, 0.0),
    radius: float = 1.0,
    subdivisions: int = 3,
    material: Material | None = None,
    inward: bool = False,
    name: str = "",
) -> Mesh:
    """Make an icosphere of 20 * 4^subdivisions triangles, scaled to the surface area of the true sphere.

    Thus its flux, and the mean irradiance from a light at its centre, equal those of the sphere.
    """
    # Begin with an icosahedron.
    golden = (1 + 5**0.5) / 2
    points = np.array(
        [
            *[(-1, golden, 0), (1, golden, 0), (-1, -golden, 0), (1, -golden, 0)],
            *[(0, -1, golden), (0, 1, golden), (0, -1, -golden), (0, 1, -golden)],
            *[(golden, 0, -1), (golden, 0, 1), (-golden, 0, -1), (-golden, 0, 1)],
        ]
    )
    triangles = np.array(
        [
            *[(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11)],
            *[(1, 5, 9), (5, 11, 4), (11, 10, 2), (10, 7, 6), (7, 1, 8)],
            *[(3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9)],
            *[(4, 9, 5), (2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)],
        ]
    )
    # Subdivide it on the unit sphere.
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    for _ in range(subdivisions):
        points, triangles = _subdivided(points, triangles)
    # Scale it to the area of the sphere.
    a, b, c = (points[triangles[:, k]] for k in range(3))
    area = 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
    scale = radius * (4 * np.pi / area) ** 0.5
    return mesh(points * scale + np.asarray(centre, np.float64), _facing(triangles, inward), material, name)


def grid(
    size: float = 1.0,
    cells: int = 1,
    material: Material | None = None,
    centre: Sequence[float] = (0.0, 0.0, 0.0),
    name: str = "",
) -> Mesh:
    """Make a square floor of `cells` x `cells` quads around `centre`, `size` metres wide, facing +Y."""
    steps = np.linspace(-size / 2, size / 2, cells + 1)
    z, x = np.meshgrid(steps, steps, indexing="ij")
    positions = np.stack([x, np.zeros_like(x), z], axis=-1).reshape(-1, 3) + np.asarray(centre, np.float64)
    first = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    right, near = first + 1, first + cells + 1
    triangles = np.concatenate([np.stack([first, near, near + 1], 1), np.stack([first, near + 1, right], 1)])
    return mesh(positions, triangles, material, name)


def _facing(triangles: object, inward: bool) -> NDArray[np.int64]:
    """Return the triangles, with reversed winding if `inward`."""
    array = np.asarray(triangles, np.int64)
    return array[:, ::-1] if inward else array


def _subdivided(points: NDArray[np.float64], triangles: NDArray) -> tuple[NDArray[np.float64], NDArray]:
    """Divide each triangle of a unit sphere into four, with the new vertices on the sphere."""
    edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    unique, inverse = np.unique(edges, axis=0, return_inverse=True)
    middles = points[unique].sum(1)
    middles /= np.linalg.norm(middles, axis=1, keepdims=True)
    ab, bc, ca = inverse.reshape(3, -1) + len(points)
    a, b, c = triangles.T
    pieces = [np.stack(piece, axis=1) for piece in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
    return np.concatenate([points, middles]), np.concatenate(pieces)
