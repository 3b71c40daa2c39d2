"""Tessellates the implicit shapes of a stage: cubes, spheres, cylinders, cones, capsules and planes.

Round shapes are surfaces of revolution about their axis with smooth normals. Departures: each is inscribed, so that 48
sides have 0.3 % less area than the round shape.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..files.polygons import Floats
from ..files.raw_mesh import RawMesh
from .stage import Stage, number

SEGMENTS = 48


def gprim_mesh(prim: Any, stage: Stage) -> RawMesh | None:
    """Return the triangles of a shape in its own frame; None if it is of another kind."""
    from pxr import UsdGeom

    kind = str(prim.GetTypeName()).removesuffix("_1")

    def size(name: str, default: float) -> float:
        return number(prim.GetAttribute(name), stage.time, default, low=0.0)

    axis = "Z"
    if prim.HasAttribute("axis"):
        axis = str(prim.GetAttribute("axis").Get(stage.time) or "Z")
    radius, height = size("radius", 1.0), size("height", 2.0)
    if prim.IsA(UsdGeom.Cube):
        return _cube(size("size", 2.0))
    if prim.IsA(UsdGeom.Plane):
        corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float64)
        corners *= size("width", 2.0) / 2, size("length", 2.0) / 2, 0.0
        return RawMesh(_turned(corners, axis), np.array([[0, 1, 2], [0, 2, 3]]))
    # Profiles as (radius, height, normal's radius, normal's height) from the bottom up; equal places make sharp edges.
    if kind == "Sphere":
        return revolved(_arc(radius, 0.0, -90, 90), axis)
    if kind == "Capsule":
        return revolved([*_arc(radius, -height / 2, -90, 0), *_arc(radius, height / 2, 0, 90)], axis)
    low, high = radius, 0.0 if kind == "Cone" else radius
    if prim.HasAttribute("radiusBottom"):
        low, high = size("radiusBottom", 1.0), size("radiusTop", 1.0)
    if kind not in ("Cylinder", "Cone"):
        return None
    bottom, top = -height / 2, height / 2
    side = np.array([height, low - high])
    side /= max(float(np.linalg.norm(side)), 1e-300)
    profile = [(0, bottom, 0, -1), (low, bottom, 0, -1), (low, bottom, *side), (high, top, *side)]
    return revolved(profile if high == 0 else [*profile, (high, top, 0, 1), (0, top, 0, 1)], axis)


def revolved(profile: list[tuple[float, ...]], axis: str, segments: int = SEGMENTS) -> RawMesh:
    """Return the surface that a profile sweeps about an axis; triangles without area are left to later checks."""
    r, h, nr, nh = np.array(profile, np.float64).T
    angle = np.linspace(0, 2 * np.pi, segments + 1)[:, None]
    cosine, sine = np.cos(angle), np.sin(angle)
    positions = np.stack([r * cosine, r * sine, h + 0 * angle], -1).reshape(-1, 3)
    normals = np.stack([nr * cosine, nr * sine, nh + 0 * angle], -1).reshape(-1, 3)
    # Join neighbours along the profile and around the axis, seen from outside counter-clockwise.
    rings = len(profile)
    first = (np.arange(segments)[:, None] * rings + np.arange(rings - 1)).ravel()
    quads = np.stack([first, first + rings, first + rings + 1, first + 1], 1)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    # Drop those at the poles, where two corners coincide.
    a, b, c = positions[triangles].transpose(1, 0, 2)
    scale = max(float(np.abs(positions).max()), 1e-300)
    triangles = triangles[np.linalg.norm(np.cross(b - a, c - a), axis=1) > 1e-12 * scale * scale]
    return RawMesh(_turned(positions, axis), triangles, normals=_turned(normals, axis))


def _arc(radius: float, centre: float, start: float, stop: float) -> list[tuple[float, ...]]:
    """Return the profile of a sphere's part between two latitudes in degrees."""
    steps = max(round((stop - start) / 180 * SEGMENTS / 2), 2)
    angles = np.radians(np.linspace(start, stop, steps + 1))
    return [(radius * c, centre + radius * s, c, s) for c, s in zip(np.cos(angles), np.sin(angles), strict=True)]


def _turned(vectors: Floats, axis: str) -> Floats:
    """Turn vectors so that +Z becomes another axis; a cyclic exchange, which keeps the winding."""
    return vectors[:, {"X": [2, 0, 1], "Y": [1, 2, 0]}.get(axis, [0, 1, 2])]


def _cube(size: float) -> RawMesh:
    """Return a cube about the origin without normals, so that it has sharp edges."""
    corners = np.array([[(-1, 1)[k >> a & 1] for a in range(3)] for k in range(8)], np.float64) * size / 2
    sides = [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]
    return RawMesh(corners, np.array([t for a, b, c, d in sides for t in ((a, b, c), (a, c, d))]))
