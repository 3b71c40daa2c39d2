"""Meshes for generated scenes: unit-sized shapes with texture coordinates, flat or smooth, of any tessellation.

Every shape fits the cube [-0.5, 0.5]^3, and its triangles are counter-clockwise seen from outside. A mesh without
normals is flat-shaded.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...scene.built_in.shapes import sphere
from ...scene.mesh_cleaning import has_area, unit_rows
from ...scene.scene import Material, Mesh
from .draws import Draws

Array = NDArray[np.float64]
# A part of a shape: positions (n, 3), normals (n, 3), texture coordinates (n, 2), triangles (m, 3).
Part = tuple[Array, Array, Array, NDArray[np.int64]]


def sheet(columns: int, rows: int, surface: Callable[[Array, Array], tuple[Array, Array]]) -> Part:
    """Return the grid of a surface: (u, v) in [0, 1]^2 to positions and normals (..., 3); dP/du x dP/dv is outward."""
    v, u = np.meshgrid(np.linspace(0, 1, rows + 1), np.linspace(0, 1, columns + 1), indexing="ij")
    points, normals = surface(u, v)
    first = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    right, above = first + 1, first + columns + 1
    triangles = np.concatenate([np.stack([first, right, above + 1], 1), np.stack([first, above + 1, above], 1)])
    uv = np.stack([u, 1 - v], axis=-1)
    return points.reshape(-1, 3), np.broadcast_to(normals, points.shape).reshape(-1, 3), uv.reshape(-1, 2), triangles


def joined(parts: list[Part], material: Material, smooth: bool, name: str) -> Mesh:
    """Return one mesh of all parts, without triangles that have no area."""
    starts = np.cumsum([0, *(len(part[0]) for part in parts[:-1])])
    positions, normals, uvs = (np.concatenate([part[k] for part in parts]) for k in (0, 1, 2))
    triangles = np.concatenate([part[3] + start for part, start in zip(parts, starts, strict=True)])
    points = positions.astype(np.float32)
    triangles = triangles[has_area(points, triangles)]
    used = np.zeros(len(points), np.bool_)
    used[triangles] = True
    return Mesh(
        positions=points[used],
        triangles=(np.cumsum(used) - 1)[triangles].astype(np.uint32),
        materials=[material],
        normals=settled_rows(normals[used]) if smooth else None,
        texcoords0=uvs[used].astype(np.float32),
        name=name,
    )


def settled_rows(vectors: NDArray[Any]) -> NDArray[np.float32]:
    """Return float32 rows of unit length that do not change if they are normalised again."""
    rows = unit_rows(vectors)
    for _ in range(4):
        rows = unit_rows(rows)
    return rows


def plane(material: Material, columns: int = 1, rows: int = 1, name: str = "plane") -> Mesh:
    """Return the unit square at y = 0 that faces +Y, its texture's top at -Z."""

    def flat(u: Array, v: Array) -> tuple[Array, Array]:
        return np.stack([u - 0.5, np.zeros_like(u), 0.5 - v], axis=-1), np.array([0.0, 1.0, 0.0])

    return joined([sheet(columns, rows, flat)], material, False, name)


def box(material: Material, cells: int = 1, inward: bool = False, name: str = "box") -> Mesh:
    """Return the unit cube, each side a grid of cells x cells."""
    sides = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            normal, across = np.eye(3)[axis] * sign, np.eye(3)[(axis + 1) % 3]
            up = np.cross(normal, across)

            def side(u: Array, v: Array, n: Array = normal, a: Array = across, b: Array = up) -> tuple[Array, Array]:
                return 0.5 * n + (u[..., None] - 0.5) * a + (v[..., None] - 0.5) * b, n

            sides.append(sheet(cells, cells, side))
    mesh = joined(sides, material, False, name)
    if inward:
        mesh.triangles = np.ascontiguousarray(mesh.triangles[:, ::-1])
    return mesh


def ball(material: Material, subdivisions: int = 2, smooth: bool = True, name: str = "ball") -> Mesh:
    """Return an icosphere of 20 * 4^subdivisions triangles, of radius 0.5, with longitude and latitude as texture."""
    mesh = sphere(radius=0.5, subdivisions=subdivisions, material=material, name=name)
    mesh.normals = settled_rows(mesh.positions) if smooth else None
    x, y, z = settled_rows(mesh.positions).astype(np.float64).T
    longitude = np.arctan2(x, -z) / (2 * np.pi) + 0.5
    mesh.texcoords0 = np.stack([longitude, np.arccos(np.clip(y, -1, 1)) / np.pi], axis=1).astype(np.float32)
    return mesh


def frustum(material: Material, segments: int, top: float, smooth: bool, name: str) -> Mesh:
    """Return an upright cylinder (top = 1), cone (top = 0) or frustum: radius 0.5 below and top / 2 above."""

    def circle(u: Array) -> tuple[Array, Array]:
        return np.cos(2 * np.pi * u), -np.sin(2 * np.pi * u)

    def side(u: Array, v: Array) -> tuple[Array, Array]:
        (x, z), radius = circle(u), 0.5 + (top - 1) / 2 * v
        return np.stack([radius * x, v - 0.5, radius * z], -1), np.stack([x, np.full_like(x, (1 - top) / 2), z], -1)

    def cap(height: float, radius: float) -> Callable[[Array, Array], tuple[Array, Array]]:
        sign = math.copysign(1.0, height)

        def disc(u: Array, v: Array) -> tuple[Array, Array]:
            x, z = circle(u * sign)
            r = radius * (1 - v)
            return np.stack([r * x, np.full_like(u, height), r * z], -1), np.array([0.0, sign, 0.0])

        return disc

    parts = [sheet(segments, 1, side), sheet(segments, 1, cap(-0.5, 0.5))]
    if top > 0:
        parts.append(sheet(segments, 1, cap(0.5, top / 2)))
    return joined(parts, material, smooth, name)


def torus(material: Material, segments: int, tube: float, smooth: bool, name: str = "torus") -> Mesh:
    """Return a ring in the plane y = 0 with an outer radius of 0.5 and a tube of radius `tube`."""

    def ring(u: Array, v: Array) -> tuple[Array, Array]:
        a, b = 2 * np.pi * u, 2 * np.pi * v
        normal = np.stack([np.cos(b) * np.cos(a), np.sin(b), -np.cos(b) * np.sin(a)], -1)
        centre = np.stack([np.cos(a), np.zeros_like(a), -np.sin(a)], -1) * (0.5 - tube)
        return centre + tube * normal, normal

    return joined([sheet(segments, max(segments // 2, 3), ring)], material, smooth, name)


def curtain(material: Material, segments: int, folds: int, smooth: bool, name: str = "curtain") -> Mesh:
    """Return a sheet that hangs in the plane z = 0 with `folds` sine waves."""

    def cloth(u: Array, v: Array) -> tuple[Array, Array]:
        phase, depth = 2 * np.pi * folds * u, 0.08
        slope = depth * 2 * np.pi * folds * np.cos(phase)
        points = np.stack([u - 0.5, v - 0.5, depth * np.sin(phase)], -1)
        return points, np.stack([-slope, np.zeros_like(slope), np.ones_like(slope)], -1)

    return joined([sheet(segments, 2, cloth)], material, smooth, name)


SHAPES = ("box", "ball", "cylinder", "cone", "frustum", "torus", "plane", "curtain")


def solid(draws: Draws, material: Material, shape: str | None = None) -> Mesh:
    """Return a shape of SHAPES (random if None) of random tessellation, flat or smooth."""
    shape = shape or draws.choice(SHAPES)
    smooth, segments = draws.chance(0.7), draws.integer(5, 32)
    if shape == "box":
        return box(material, draws.choice((1, 1, 2, 5)))
    if shape == "ball":
        return ball(material, draws.integer(1, 3), smooth)
    if shape == "torus":
        return torus(material, segments, draws.uniform(0.05, 0.24), smooth)
    if shape == "plane":
        return plane(material, draws.integer(1, 4), draws.integer(1, 4))
    if shape == "curtain":
        return curtain(material, 4 * segments, draws.integer(1, 5), smooth)
    top = {"cylinder": 1.0, "cone": 0.0}.get(shape, draws.uniform(0.2, 0.9))
    return frustum(material, segments, top, smooth, shape)
