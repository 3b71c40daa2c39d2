"""Finds the clusters that may cast shadows onto surfaces that the camera sees, and the part of each map that it needs.

Bittner, Mattausch, Silvennoinen and Wimmer 2011, "Shadow Caster Culling for Efficient Shadow Mapping". Departure: the
receivers are the whole view frustum. A caster lies in the convex hull of the frustum and the light. Half-spaces that
contain both bound the hull: a plane of the frustum with the light L on its inner side; and of two planes with L on
different sides, their combination P1 (-P2 . L) + P2 (P1 . L), which passes through L.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ..shared.culling import SIDES, reaches_inside

# Widening of the camera's frustum for the casters that are drawn, so that the maps stay while the camera moves a
# little: share of the picture's half width and height, and of the scene's radius. Twice the step of a moving benchmark
# picture (`measure/bench.py`, ORBIT_RADIUS); not tuned.
ROOM = 0.1
ROOM_AROUND = 0.01
JITTER = 1.0  # pixels at the picture's edges: its points are jittered by up to half a pixel
# Texels around a receiver that count: `lookup.wgsl` reads up to 1.6 texels around a point, which it moves by up to 1.42
# times as many.
FILTER = 5.0
ROUNDING = 1e-6  # of a corner's distance to a plane over the scene's size: 17 roundings of float32
SIDES_OF_BOX = np.concatenate([np.eye(3), -np.eye(3)])
TINY = np.finfo(np.float64).tiny


@dataclass(frozen=True)
class Receivers:
    """The points for which shadows are looked up: those in `box` (2, 3), metres, that a camera sees.

    `camera` is its View uniform.
    """

    camera: NDArray[np.void]
    box: NDArray[np.float64]

    @property
    def radius(self) -> float:
        """Radius of a sphere around the box, metres."""
        return float(np.linalg.norm(np.ptp(self.box, axis=0))) / 2


def casters(views: NDArray[np.void], receivers: Receivers, boxes: NDArray[np.float32], wide: bool) -> NDArray[np.bool_]:
    """Return whether each box (c, 2, 3) may cast a shadow onto a receiver in each of v shadow views: (v, c).

    `wide`: the camera may move a little. Conservative.
    """
    planes, sizes = _frustum(receivers, wide)
    lights, is_lamp = _lights(views)
    # Keep the planes with the light on their inner side, and combine those with it on different sides.
    side = lights @ planes.T
    inner, outer = np.maximum(side, 0)[:, None, :], np.maximum(-side, 0)[:, :, None]
    hull, bounds = (
        np.concatenate([np.where(side[..., None] >= 0, p, 0), _combined(inner, outer, p)], 1) for p in (planes, sizes)
    )
    # A shadow's filter reads texels around the receiver. Those of a lamp's perspective views widen with the distance.
    farthest = (
        np.linalg.norm(lights[:, :3] / np.where(is_lamp, lights[:, 3], 1)[:, None], axis=1) + 2 * receivers.radius
    )
    margin = FILTER * views["texel"] * np.where(is_lamp, farthest, 1.0)
    hull[..., 3] += margin[:, None] * np.linalg.norm(hull[..., :3], axis=2)
    return reaches_inside(hull, bounds, boxes)


def needed_texels(views: NDArray[np.void], receivers: Receivers, wide: bool) -> NDArray[np.int64]:
    """Return the rectangle of the atlas that each of v views needs: x, y, width, height, (v, 4). Conservative.

    Lamps' views are needed whole; only suns' are cut to the receivers.
    """
    corners = _receiver_corners(receivers, wide)
    low, high = views["corner"].astype(np.float64), (views["corner"] + views["size"]).astype(np.float64)
    is_sun = ~_lights(views)[1]
    if is_sun.any():
        # Project the corners of the convex receivers.
        matrices = views["clip_from_world"][is_sun].astype(np.float64).transpose(0, 2, 1)
        ndc = matrices[:, None, :2, :3] @ corners[:, :, None] + matrices[:, None, :2, 3:]
        texels = low[is_sun, None] + views["size"][is_sun, None] * (ndc[..., 0] * (0.5, -0.5) + 0.5)
        first = np.floor(texels.min(1, initial=np.inf) - FILTER)
        last = np.ceil(texels.max(1, initial=-np.inf) + FILTER)
        low[is_sun] = np.clip(first, low[is_sun], high[is_sun])
        high[is_sun] = np.clip(last, low[is_sun], high[is_sun])
    return np.concatenate([low, high - low], 1).astype(np.int64)


def _frustum(receivers: Receivers, wide: bool) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the planes (p, 4) of the camera's frustum, of unit normals, and their error bounds (p, 4)."""
    camera = receivers.camera.reshape(-1)[0]
    rows = camera["clip_from_world"].astype(np.float64).T.copy()
    # In a picture of 1 + room times the size, a point has coordinates 1 / (1 + room) times as large.
    rows[:2] /= 1 + 2 * JITTER / camera["size"].astype(np.float64)[:, None] + ROOM * wide
    planes, sizes = SIDES @ rows, np.abs(SIDES) @ np.abs(rows)
    length = np.linalg.norm(planes[:, :3], axis=1)
    kept = length > 0  # an infinite far plane has no normal
    planes, sizes = (found[kept] / length[kept, None] for found in (planes, sizes))
    planes[:, 3] += ROOM_AROUND * receivers.radius * wide
    return planes, sizes


def _receiver_corners(receivers: Receivers, wide: bool) -> NDArray[np.float64]:
    """Return the corners (n, 3) of the part of the box that the camera's frustum holds: where three planes meet."""
    low, high = receivers.box
    box = np.concatenate([SIDES_OF_BOX, np.concatenate([-low, high])[:, None]], 1)
    planes = np.concatenate([_frustum(receivers, wide)[0], box])
    triples = planes[list(combinations(range(len(planes)), 3))]
    crossing = np.abs(np.linalg.det(triples[..., :3])) > ROUNDING
    points = np.linalg.solve(triples[crossing, :, :3], -triples[crossing, :, 3:])[..., 0]
    size = np.abs(receivers.box).max() + receivers.radius
    inside: NDArray[np.bool_] = (points @ planes[:, :3].T + planes[:, 3] >= -ROUNDING * size).all(1)
    return points[inside]


def _lights(views: NDArray[np.void]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return the lights of v views: (v, 4), the place of a lamp or the direction to a sun; and which are lamps."""
    matrices = views["clip_from_world"].astype(np.float64).transpose(0, 2, 1)
    is_lamp = (matrices[:, 3, :3] != 0).any(1)
    # All planes across the view meet in its light: x, y and w are 0 there.
    rows = matrices[:, [0, 1, 3]]
    rows = rows / np.maximum(np.abs(rows).max(2, keepdims=True), TINY)
    lights = np.linalg.svd(rows)[2][:, 3]
    # Depth grows towards a sun.
    lights *= np.sign(np.where(is_lamp, lights[:, 3], np.einsum("vc,vc->v", matrices[:, 2], lights)))[:, None]
    lights[~is_lamp, 3] = 0.0
    return lights, is_lamp


def _combined(
    inner: NDArray[np.float64], outer: NDArray[np.float64], planes: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the combinations of all pairs of planes (p, 4) through the light, (v, p * p, 4); 0 where there is none.

    `inner` (v, 1, p) and `outer` (v, p, 1): distance of the light from each plane, on its inner or outer side.
    """
    scale = np.where((inner > 0) & (outer > 0), 1 / np.maximum(inner + outer, TINY), 0.0)
    mixed = (scale * outer)[..., None] * planes + (scale * inner)[..., None] * planes[:, None]
    found: NDArray[np.float64] = mixed.reshape(len(mixed), len(planes) ** 2, 4)
    return found
