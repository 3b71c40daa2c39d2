"""What can be seen in a scene: rays through voxels, on the CPU, for the few questions of an automatic camera.

Points spread over the surfaces by area fill a grid of cubes; rays march through it in half steps (voxel ray casting as
in Levoy 1988, "Display of Surfaces from Volume Data"). It takes as long for a million triangles as for ten. Errs by a
cube: a hundredth of the scene.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .deformation import posed_positions
from .scene import Scene

Array = NDArray[np.float64]
CUBES = 96  # along the longest side of the grid
POINTS_PER_FACE = 5  # mean number of points on a cube's face: 0.7 % of them get none
MOST_POINTS = 1_500_000
DETAILS = 1000
CHUNK = 1 << 18  # triangles taken at once
# Large planes around small details are left out of the bounds: those this many times as large as all others together.
GROUND = 20.0


@dataclass
class Sight:
    """A scene's surfaces in cubes.

    low: corner of the grid (3,), side: of a cube, metres. facing: area that faces -X, +X, -Y, +Y, -Z, +Z, by cube
    (x, y, z, 6). floor, ceiling: largest and least height of the points in each cube, above `low`. points, normals:
    (n, 3) points of the surfaces, equally spaced by area, within `bounds` (2, 3), which leave out a large plane around
    small details. details: middles (m, 3) and normals of some triangles, each as likely: dense where the scene is
    modelled finely.
    """

    low: Array
    side: float
    facing: NDArray[np.float32]
    floor: NDArray[np.float32]
    ceiling: NDArray[np.float32]
    points: Array
    normals: Array
    details: tuple[Array, Array]
    bounds: Array

    @classmethod
    def of(cls, scene: Scene) -> Sight:
        """Fill the cubes. A scene without any area has no points."""
        bounds, area = _measure(scene)
        side = max(float((bounds[1] - bounds[0]).max()) / CUBES, 1e-30)
        low = bounds[0] - 1.5 * side
        shape = tuple(np.ceil((bounds[1] - low) / side + 2).astype(int))
        count = min(max(POINTS_PER_FACE * area / side**2, 10_000), MOST_POINTS)
        points, normals = _spread(scene, bounds, max(area / count, 1e-300))
        cube = np.floor((points - low) / side).astype(np.int64)
        inside = ((cube >= 0) & (cube < shape)).all(1)
        points, normals, cube = points[inside], normals[inside], cube[inside]
        # Sum what faces each way, and find the heights.
        flat = np.ravel_multi_index(tuple(cube.T), shape)
        size = int(np.prod(shape))
        sides = [np.bincount(flat, np.maximum(s * normals[:, k], 0), size) for k in range(3) for s in (-1, 1)]
        floor, ceiling = np.full(size, -np.inf, np.float32), np.full(size, np.inf, np.float32)
        height = (points[:, 1] - low[1]).astype(np.float32)
        np.maximum.at(floor, flat, height)
        np.minimum.at(ceiling, flat, height)
        facing = np.stack(sides, 1).astype(np.float32).reshape(*shape, 6)
        return cls(
            low, side, facing, floor.reshape(shape), ceiling.reshape(shape), points, normals, _details(scene), bounds
        )

    @cached_property
    def filled(self) -> NDArray[np.bool_]:
        """Which cubes (x, y, z) hold surfaces."""
        return np.asarray(self.facing.any(3))

    def first_hits(self, origins: Array, directions: Array) -> tuple[Array, Array]:
        """Return distance and facing of the first hits of rays, each (n, 3), of unit directions.

        Rays start beyond 1.5 cubes. Distance is inf where nothing is hit. Facing (n, 3) holds by ray the areas that
        face it and that face away, and the share of the vertical.
        """
        shape = np.array(self.facing.shape[:3])
        with np.errstate(divide="ignore", invalid="ignore"):
            a, b = (self.low - origins) / directions, (self.low + shape * self.side - origins) / directions
        enter, leave = np.nanmax(np.minimum(a, b), 1), np.nanmin(np.maximum(a, b), 1)
        filled = self.filled.ravel()
        strides = np.array([shape[1] * shape[2], shape[2], 1])
        distance, cube = np.full(len(origins), np.inf), np.zeros(len(origins), np.int64)
        # March all rays at once; those that hit or leave drop out.
        t = np.maximum(enter, 1.5 * self.side)
        active = np.flatnonzero(t < leave)
        start, step, t = (origins[active] - self.low) / self.side, directions[active] / self.side, t[active]
        leave = leave[active]
        while len(active):
            at = (start + step * t[:, None]).astype(np.int64)
            index = np.clip(at, 0, shape - 1) @ strides
            hit = filled[index]
            distance[active[hit]], cube[active[hit]] = t[hit], index[hit]
            t = t + 0.5 * self.side
            kept = ~hit & (t < leave)
            active, start, step, t, leave = active[kept], start[kept], step[kept], t[kept], leave[kept]
        # A ray towards -X meets what faces +X.
        sides = self.facing.reshape(-1, 3, 2)[cube]
        meets, total = np.where(directions < 0, sides[:, :, 1], sides[:, :, 0]), sides.sum(2)
        vertical = total[:, 1] / np.maximum(np.linalg.norm(total, axis=1), 1e-30)
        along = np.abs(directions)
        return distance, np.stack([(meets * along).sum(1), ((total - meets) * along).sum(1), vertical], 1)

    def in_sight(self, eyes: Array, points: Array, normals: Array) -> tuple[NDArray[np.bool_], Array]:
        """Tell which surface points (n, 3) with their normals each eye (m, 3) sees: (m, n), and the cosines there."""
        to_eye = eyes[:, None] - points
        cosine = np.einsum("mnc,nc->mn", to_eye, normals) / np.maximum(np.linalg.norm(to_eye, axis=2), 1e-300)
        # Aim beside the surface, so that its own cubes do not hide the point.
        away = 1.8 * self.side * np.sign(cosine)[..., None] * normals - to_eye
        distance = np.maximum(np.linalg.norm(away, axis=2), 1e-300)
        origins = np.broadcast_to(eyes[:, None], away.shape).reshape(-1, 3)
        nearest, _ = self.first_hits(origins, (away / distance[..., None]).reshape(-1, 3))
        return nearest.reshape(distance.shape) >= distance, cosine

    def heights(self, x: float, z: float) -> list[tuple[float, float]]:
        """Return underside and top of the bodies on the vertical line through (x, z), from below."""
        i, k = (int((v - self.low[axis]) / self.side) for v, axis in ((x, 0), (z, 2)))
        filled = np.flatnonzero(self.filled[i, :, k])
        runs = np.split(filled, np.flatnonzero(np.diff(filled) > 1) + 1) if len(filled) else []
        base = float(self.low[1])
        return [(base + float(self.ceiling[i, run[0], k]), base + float(self.floor[i, run[-1], k])) for run in runs]


def _chunks(scene: Scene) -> Iterator[Array]:
    """Yield the scene's triangles in the world, (n, 3, 3), counter-clockwise from their front."""
    for instance in scene.instances:
        matrix = np.asarray(instance.world_from_local, np.float64)
        positions = posed_positions(instance) @ matrix[:3, :3].T + matrix[:3, 3]
        triangles = np.asarray(instance.mesh.triangles, np.int64).reshape(-1, 3)
        if np.linalg.det(matrix[:3, :3]) < 0:
            triangles = triangles[:, ::-1]
        for first in range(0, len(triangles), CHUNK):
            yield positions[triangles[first : first + CHUNK]]


def _measure(scene: Scene) -> tuple[Array, float]:
    """Return bounds (2, 3) without a large plane around small details, and the area within about these bounds, m2."""
    whole = scene.bounds()
    limit = float((whole[1] - whole[0]).max()) / GROUND
    low, high, small, count = np.full(3, np.inf), np.full(3, -np.inf), 0, 0
    total = detailed = 0.0
    for corners in _chunks(scene):
        area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
        is_small = np.ptp(corners, axis=1).max(1) < limit
        small, count = small + int(is_small.sum()), count + len(corners)
        total, detailed = total + float(area.sum()), detailed + float(area[is_small].sum())
        if is_small.any():
            low, high = np.minimum(low, corners[is_small].min((0, 1))), np.maximum(high, corners[is_small].max((0, 1)))
    if 2 * small < count or not small or float((high - low).max()) >= limit:
        return whole, total
    around = 0.25 * float((high - low).max()) * np.array([1.0, 0.0, 1.0])
    return np.stack([low - around, high + around]), detailed + float(np.prod((high - low + 2 * around)[[0, 2]]))


def _details(scene: Scene) -> tuple[Array, Array]:
    """Return middles and unit normals of about DETAILS triangles, by their number."""
    stride = -(-scene.triangle_count // DETAILS)
    middles, normals, start = [np.zeros((0, 3))], [np.zeros((0, 3))], 0
    for corners in _chunks(scene):
        chosen = corners[start::stride]
        start = (start - len(corners)) % stride
        normal = np.cross(chosen[:, 1] - chosen[:, 0], chosen[:, 2] - chosen[:, 0])
        middles.append(chosen.mean(1))
        normals.append(normal / np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None])
    return np.concatenate(middles), np.concatenate(normals)


def _spread(scene: Scene, bounds: Array, spacing: float) -> tuple[Array, Array]:
    """Return points and unit normals, one for each `spacing` m2 of the surfaces in about the bounds."""
    rng = np.random.default_rng(1)
    points, normals, start = [np.zeros((0, 3))], [np.zeros((0, 3))], 0.5
    for whole in _chunks(scene):
        corners = _within(whole, bounds)
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = np.linalg.norm(normal, axis=1) / 2
        # Step through the areas; the remainder goes on to the next triangles.
        sums = np.cumsum(area) / spacing
        steps = np.arange(start, sums[-1] if len(sums) else 0.0)
        start += len(steps) - float(sums[-1] if len(sums) else 0.0)
        chosen = np.minimum(np.searchsorted(sums, steps), len(sums) - 1)
        b = rng.random((len(chosen), 2))
        b = np.where(b.sum(1, keepdims=True) > 1, 1 - b, b)
        c = corners[chosen]
        points.append(c[:, 0] + np.einsum("nk,nkc->nc", b, c[:, 1:] - c[:, :1]))
        normals.append(normal[chosen] / (2 * area[chosen, None]))
    return np.concatenate(points), np.concatenate(normals)


def _within(corners: Array, bounds: Array) -> Array:
    """Return triangles with the largest ones, which reach far beyond `bounds`, clipped to them."""
    size = float((bounds[1] - bounds[0]).max())
    large = np.ptp(corners, axis=1).max(1) > 4 * size
    if not large.any():
        return corners
    parts = [corners[~large]]
    for triangle in corners[large]:
        polygon = triangle
        for axis in range(3):
            for limit, sign in ((bounds[0, axis] - size / CUBES, 1), (bounds[1, axis] + size / CUBES, -1)):
                polygon = _clipped(polygon, sign * (polygon[:, axis] - limit))
        parts.append(
            np.array([(polygon[0], polygon[k], polygon[k + 1]) for k in range(1, len(polygon) - 1)]).reshape(-1, 3, 3)
        )
    return np.concatenate(parts)


def _clipped(polygon: Array, above: Array) -> Array:
    """Return the part of a convex polygon (n, 3) where `above` (n,) is positive (Sutherland and Hodgman 1974)."""
    kept = []
    for k in range(len(polygon)):
        h, g = above[k - 1], above[k]
        if (h > 0) != (g > 0):
            kept.append(polygon[k - 1] + (polygon[k] - polygon[k - 1]) * (h / (h - g)))
        if g > 0:
            kept.append(polygon[k])
    return np.array(kept).reshape(-1, 3)
