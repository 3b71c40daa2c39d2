"""Shows points without faces: a small shape for each, discs along the normals if there are any, else spheres.

All shapes are one mesh. Instances of one shape would not have colours of their own, and were slower: 100,000 octahedra
took 12.9 s of CPU time as instances and 7.3 s as one mesh, from the scene to the first picture of 96x72 (llvmpipe).

Departures: spheres and discs are polygons with the area of the round shape, finer for fewer points. A cloud of more
than MAX_POINTS is thinned. Without a given size, the diameter is taken from the distance between neighbours.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...errors import GiError
from ...float_limits import MAX_COORDINATE
from ..scene import Scene
from .memory import MemoryBudget
from .notes import Notes
from .polygons import Floats
from .raw_mesh import RawMesh, RawPoints, scene_from_raw

MAX_POINTS = 500_000  # four million triangles: their hierarchy takes about half a minute
_MOST_TRIANGLES = 400_000  # of a finer shape than the coarsest one
_SAMPLES = 256  # points whose neighbours tell the spacing: its mean is then right to 5 %
_NEIGHBOURS = 4  # on a square grid, all of these lie at the distance of the grid
# The radius over the mean distance to the fourth neighbour. Discs on a square grid leave no hole above 0.71. Points at
# random places of a surface, n per area, have a mean distance of 1.09 / sqrt(n): exp(-pi 1.09^2) = 2 % stays bare.
_COVERING = 1.0


class _Shape(NamedTuple):
    """A polyhedron or polygon about the origin with the area of a sphere or disc of radius 1."""

    positions: Floats
    triangles: NDArray[np.int64]


def points_scene(
    points: RawPoints,
    size: float | None,
    name: str,
    source: str,
    notes: Notes,
    budget: MemoryBudget,
    unit: float = 1.0,
) -> Scene:
    """Return a scene of one mesh with a disc or a sphere of diameter `size` (metres) for each point.

    Without a size, it is twice the mean distance to the fourth neighbour, and a note says so. Points that are NaN
    or infinite are left out with a note. Raises GiError if no point is left, if the size is not above 0, and for memory
    beyond the budget. Messages begin with `source`; lengths in them are in metres if `unit` is that of the positions.
    """
    positions, colors, normals = _finite(points, source, notes)
    if len(positions) > MAX_POINTS:
        notes.add(f"{source}: of {len(positions)} points, {MAX_POINTS} are shown, evenly from the whole file")
        kept = np.arange(MAX_POINTS) * len(positions) // MAX_POINTS
        positions = positions[kept]
        colors, normals = (None if rows is None else rows[kept] for rows in (colors, normals))
    # Choose a shape and its size.
    if size is None:
        size = default_size(positions)
        given = "twice their spacing (--point-size, gi.load(point_size=) set another)"
    elif not 0 < size <= MAX_COORDINATE:
        raise GiError(f"the size of points must be a number of metres above 0, not {size}")
    else:
        given = "as given"
    shape = _disc(len(positions)) if normals is not None else _sphere(len(positions))
    kind = "discs" if normals is not None else "spheres"
    notes.add(f"{source}: {len(positions)} points without faces are shown as {kind} of {size * unit:.3g} m, {given}")
    # Copy it to every point: positions, normals and colours of its vertices in float64, triangles.
    count, corners, triangles = len(positions), len(shape.positions), len(shape.triangles)
    budget.take(count * (corners * 10 + triangles * 3) * 8, f"{source} as {kind}")
    local = np.broadcast_to(shape.positions, (count, corners, 3))
    if normals is not None:
        right, up = _axes(normals)
        local = local[..., :1] * right[:, None] + local[..., 1:2] * up[:, None]
    corner_normals = shape.positions / np.linalg.norm(shape.positions, axis=1, keepdims=True)
    raw = RawMesh(
        positions=(positions[:, None] + size / 2 * local).reshape(-1, 3),
        triangles=(shape.triangles + corners * np.arange(count)[:, None, None]).reshape(-1, 3),
        normals=np.repeat(normals, corners, axis=0) if normals is not None else np.tile(corner_normals, (count, 1)),
        colors=None if colors is None else np.repeat(colors, corners, axis=0),
    )
    return scene_from_raw(raw, name, source, notes)


def default_size(positions: Floats) -> float:
    """Return the diameter that lets points on a surface cover it: twice the mean distance to the fourth neighbour.

    The mean is that of every n-th point, about `_SAMPLES` of them. Points at one place count as one.
    """
    extent = float((positions.max(0) - positions.min(0)).max())
    if extent == 0.0:
        return 1.0
    unit = ((positions - positions.min(0)) / extent).astype(np.float32)
    distances = []
    for place in unit[:: max(len(unit) // _SAMPLES, 1)][:_SAMPLES]:
        squares = ((unit - place) ** 2).sum(1)
        squares = squares[squares > 0]
        if len(squares):
            nth = min(_NEIGHBOURS, len(squares)) - 1
            distances.append(math.sqrt(float(np.partition(squares, nth)[nth])))
    return 2.0 * _COVERING * extent * float(np.mean(distances))


def _finite(points: RawPoints, source: str, notes: Notes) -> tuple[Floats, Floats | None, Floats | None]:
    """Return the points that are finite; normals of unit length, or None unless all have a direction."""
    finite = np.isfinite(points.positions).all(1)
    if not finite.any():
        raise GiError(f"{source}: there are no faces and no finite points to show")
    if not finite.all():
        notes.damage(f"{source}: points left out, because they are NaN or infinite: {np.count_nonzero(~finite)}")
    normals = None if points.normals is None else points.normals[finite]
    if normals is not None:
        with np.errstate(over="ignore", invalid="ignore"):
            lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        usable = (np.isfinite(lengths) & (lengths > 0)).all()
        if not usable:
            notes.damage(f"{source}: some points have no normal, so all are shown as spheres")
        normals = normals / lengths if usable else None
    return points.positions[finite], None if points.colors is None else points.colors[finite], normals


def _axes(normals: Floats) -> tuple[Floats, Floats]:
    """Return two axes for each normal, (n, 3), that make a right-handed frame with it (Duff et al. 2017)."""
    x, y, z = normals.T
    sign = np.where(z < 0, -1.0, 1.0)
    a = -1.0 / (sign + z)
    b = x * y * a
    return np.stack([1 + sign * x * x * a, sign * b, -sign * x], 1), np.stack([b, sign + y * y * a, -y], 1)


def _disc(count: int) -> _Shape:
    """Return a regular polygon in the plane z = 0, of 16 corners for few points and of 4 for many."""
    corners = next((n for n in (16, 8, 6) if count * (n - 2) <= _MOST_TRIANGLES), 4)
    angle = 2 * math.pi / corners * np.arange(corners)
    radius = math.sqrt(2 * math.pi / (corners * math.sin(2 * math.pi / corners)))
    positions = radius * np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1)
    return _Shape(positions, np.array([(0, k, k + 1) for k in range(1, corners - 1)]))


def _sphere(count: int) -> _Shape:
    """Return an octahedron, each side cut into 16 or 4 for few points, with the surface of a unit sphere.

    The mean shadow of a convex body is a quarter of its surface, so such a shape hides as much as the sphere.
    """
    corner = np.concatenate([np.eye(3), -np.eye(3)])
    sides = [(0, 1, 2), (1, 3, 2), (3, 4, 2), (4, 0, 2), (1, 0, 5), (3, 1, 5), (4, 3, 5), (0, 4, 5)]
    triangles = [tuple(corner[k] for k in side) for side in sides]
    while count * len(triangles) * 4 <= _MOST_TRIANGLES and len(triangles) < 128:
        halves = [(a, b, c, _unit(a + b), _unit(b + c), _unit(c + a)) for a, b, c in triangles]
        triangles = [t for a, b, c, ab, bc, ca in halves for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
    flat = np.array(triangles)
    surface = float(np.linalg.norm(np.cross(flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]), axis=1).sum()) / 2
    positions, index = np.unique(flat.reshape(-1, 3).round(12), axis=0, return_inverse=True)
    return _Shape(positions * math.sqrt(4 * math.pi / surface), index.reshape(-1, 3))


def _unit(vector: Floats) -> Floats:
    unit: Floats = vector / np.linalg.norm(vector)
    return unit
