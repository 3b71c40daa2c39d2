"""Cuts the polygons of mesh files into triangles: fans where they are right, ears elsewhere.

A polygon in space is judged on the plane of its area vector, the sum of the cross products of its edges (Newell's
method: Sutherland, Sproull and Schumacker 1974, "A Characterization of Ten Hidden-Surface Algorithms"). A polygon that
a fan about its first corner would leave is cut by `mapbox-earcut`.

Departures: a polygon need not be flat, it is projected. One that crosses itself has no inside that all readers agree
on: with four corners it is cut as a fan, as most readers do, else as earcut does, and left out if it has no area. A
note says so.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .notes import Notes

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]

# earcut takes half a second for 20,000 corners in random order, and four times as long for twice as many.
MAX_CORNERS = 1 << 16

_BLOCK = 1 << 16  # corners that are judged at a time, so that the intermediates stay small
# Areas below this share of all areas of a fan are rounding: corners on a line, in float32 files.
_FLAT = 1e-6
_AREA_ERROR = 1e-3  # of what earcut returns to the polygon's own area: above float32's rounding, below any crossing


def triangulate(positions: Floats, ids: Ints, corner_counts: Ints, source: str, notes: Notes) -> tuple[Ints, Ints]:
    """Return the triangles of polygons: the places of their corners in `ids`, (m, 3), and the polygon of each, (m,).

    `ids` holds the vertices of all polygons in sequence, `corner_counts` the number of corners of each. Polygons with
    a vertex that does not exist, or is not finite, are left out with a note; those of two corners are no polygons.
    Triangles keep the winding of their polygon. They come in the order of the polygons.
    """
    starts = np.cumsum(corner_counts) - corner_counts
    usable = usable_faces(positions, ids, corner_counts, starts, source, notes)
    corners, faces = [np.zeros((0, 3), np.int64)], [np.zeros(0, np.int64)]
    crossing = 0
    for count in np.unique(corner_counts[usable]).tolist():
        of_count = np.flatnonzero(usable & (corner_counts == count))
        if count == 3:
            corners.append(starts[of_count][:, None] + np.arange(3))
            faces.append(of_count)
            continue
        # Take fans, as most polygons are convex, and cut the others one by one.
        fan = np.stack([np.zeros(count - 2, np.int64), np.arange(1, count - 1), np.arange(2, count)], 1)
        per_block = max(_BLOCK // count, 1)
        for block in (of_count[k : k + per_block] for k in range(0, len(of_count), per_block)):
            points = _scaled(positions[ids[starts[block][:, None] + np.arange(count)]])
            convex, areas = _judge(points)
            corners.append((starts[block[convex]][:, None, None] + fan).reshape(-1, 3))
            faces.append(np.repeat(block[convex], count - 2))
            for k in np.flatnonzero(~convex):
                cut, simple = _cut(points[k], areas[k])
                crossing += not simple
                cut = fan if not simple and count == 4 else cut
                corners.append(starts[block[k]] + cut)
                faces.append(np.full(len(cut), block[k]))
    if crossing:
        notes.damage(f"{source}: polygons that cross themselves, with a guess at their inside: {crossing}")
    corner, face = np.concatenate(corners), np.concatenate(faces)
    order = np.argsort(face, kind="stable")
    return corner[order], face[order]


def usable_faces(
    positions: Floats, ids: Ints, corner_counts: Ints, starts: Ints, source: str, notes: Notes
) -> NDArray[np.bool_]:
    """Tell which polygons, as those of `triangulate`, can be shown; note how many cannot."""
    exists = (ids >= 0) & (ids < len(positions))
    finite = np.zeros(len(ids), np.bool_)
    finite_rows = np.asarray(np.isfinite(positions).all(axis=1))
    finite[exists] = finite_rows[ids[exists]]
    usable = (corner_counts >= 3) & (corner_counts <= MAX_CORNERS)
    if (corner_counts > MAX_CORNERS).any():
        notes.add(f"{source}: polygons of more than {MAX_CORNERS} corners were left out")
    for good, reason in ((exists, "does not exist"), (finite | ~exists, "is NaN or infinite")):
        # A running count of bad corners tells which polygons have any.
        bad = np.concatenate([[0], np.cumsum(~good)])
        wrong = usable & (bad[starts + corner_counts] > bad[starts])
        if wrong.any():
            notes.damage(f"{source}: faces left out, because a vertex {reason}: {np.count_nonzero(wrong)}")
        usable &= ~wrong
    return usable


def _scaled(points: Floats) -> Floats:
    """Return polygons (f, n, 3) with the first corner at 0 and an extent of 1: products neither overflow nor vanish."""
    points = points / 2 - points[:, :1] / 2
    extent = np.abs(points).max((1, 2), keepdims=True)
    return points / np.where(extent > 0, extent, 1.0)


def _judge(points: Floats) -> tuple[NDArray[np.bool_], Floats]:
    """Tell for polygons (f, n, 3) whether fans cut them, and return their area vectors, (f, 3).

    A fan is right if none of its triangles faces against the whole, and if the whole has an area where they have.
    """
    crosses = np.cross(points[:, 1:-1], points[:, 2:])
    areas = crosses.sum(1)
    along = np.einsum("fkc,fc->fk", crosses, areas)
    one_side = (along >= -_FLAT * np.abs(along).sum(1, keepdims=True)).all(1)
    return one_side & (np.linalg.norm(areas, axis=1) >= _FLAT * np.linalg.norm(crosses, axis=2).sum(1)), areas


def _cut(points: Floats, area: Floats) -> tuple[Ints, bool]:
    """Return the triangles (m, 3) of a polygon (n, 3) with an area vector, and whether they cover it."""
    from mapbox_earcut import triangulate_float64

    # Drop a polygon whose parts cancel.
    length = float(np.linalg.norm(area))
    if length <= _FLAT * float(np.linalg.norm(np.cross(points[1:-1], points[2:]), axis=1).sum()):
        return np.zeros((0, 3), np.int64), False
    # Project it along its area vector, from whose tip it runs counter-clockwise.
    normal = area / length
    right = np.cross(np.eye(3)[np.argmin(np.abs(normal))], normal)
    right /= np.linalg.norm(right)
    flat = np.ascontiguousarray(np.stack([points @ right, points @ np.cross(normal, right)], 1))
    cut = triangulate_float64(flat, np.array([len(flat)], np.uint32)).astype(np.int64).reshape(-1, 3)
    # Turn all triangles that way.
    u, v = flat[cut[:, 1]] - flat[cut[:, 0]], flat[cut[:, 2]] - flat[cut[:, 0]]
    doubled = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    cut[doubled < 0] = cut[doubled < 0][:, ::-1]
    return cut, abs(float(np.abs(doubled).sum()) - length) <= _AREA_ERROR * length
