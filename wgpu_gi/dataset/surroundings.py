"""What surrounds a camera: free space, whether it is inside a body, and what its picture shows, by rays on the CPU.

Rays march through the cubes of `scene.sight`, and meet the boxes of objects that were placed in the scene afterwards.
Errs by a cube, a hundredth of the scene: what is thinner or nearer than that may be missed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..errors import GiError
from ..scene.scene import Scene
from ..scene.sight import Sight

Array = NDArray[np.float64]

AROUND = 64  # rays to all sides
ACROSS = (8, 6)  # rays through a picture, columns and rows
TWO_SIDED = 0.4  # as for automatic cameras: a cube may hold both sides of a thin wall
# The least shares of surfaces around a camera that face it, and of a picture that shows surfaces from their front. A
# camera that looks at a target may stand outside, see the backs of some walls, and much background.
FACING, SHOWN = 0.7, 0.3
FACING_OUTSIDE, SHOWN_OUTSIDE = 0.5, 0.1
COVERED = 0.2  # least height of a space that is a room, share of the scene's: as for automatic cameras
FREE_WAY = 0.25  # least share of the way to its target that a camera has before it


class Space(NamedTuple):
    """A place to stand: the floor and the height above it, metres; open to the sky, or below something."""

    floor: float
    height: float
    is_open: bool = False


@dataclass(frozen=True)
class Surroundings:
    """A scene, and the boxes of objects placed in it, (n, 2, 3): lower and upper corners in metres."""

    scene: Scene
    sight: Sight
    boxes: Array = field(default_factory=lambda: np.zeros((0, 2, 3)))

    @classmethod
    def of(cls, scene: Scene) -> Surroundings:
        """Return those of a scene. Raises GiError if it has no surfaces."""
        sight = Sight.of(scene)
        if not len(sight.points):
            raise GiError("cameras cannot be drawn in a scene without surfaces")
        return cls(scene, sight)

    @property
    def size(self) -> float:
        """The largest side of the scene, metres."""
        return float((self.sight.bounds[1] - self.sight.bounds[0]).max())

    def spaces(self, x: float, z: float) -> list[Space]:
        """Return the spaces on the vertical line through (x, z).

        These are the spaces below something, without those less than half as high as the highest, such as below a
        table. If there is none, it is the one above all, but not above the roof of rooms.
        """
        covered, top = self._covered(x, z)
        low, high = self.sight.bounds[:, 1]
        highest = max((height for _, height in covered), default=0.0)
        if highest >= COVERED * (high - low):
            return [Space(*space) for space in covered if space[1] >= 0.5 * highest]
        if top is None or (self._has_roof and top > (low + high) / 2):
            return []
        return [Space(top, max(high - top, 0.1 * (high - low)), is_open=True)]

    def _covered(self, x: float, z: float) -> tuple[list[tuple[float, float]], float | None]:
        """Return floor and height of the spaces below something, and the top of all, None if there is nothing.

        The inside of a body is no space: its lowest surface faces down.
        """
        bodies = self.sight.heights(x, z)
        gaps = [(top, under - top) for (_, top), (under, _) in pairwise(bodies)]
        free = [(floor, height) for floor, height in gaps if self._is_floor(np.array([x, floor + height / 2, z]))]
        return free, bodies[-1][1] if bodies else None

    def _is_floor(self, above: Array) -> bool:
        """Tell whether the surface below a point (3,) faces it."""
        return bool(self.rays(above, np.array([[0.0, -1.0, 0.0]]))[1][0])

    @cached_property
    def _has_roof(self) -> bool:
        """Whether half of the scene lies below a roof: of 24 scenes, 66 to 100 % of rooms, up to 8 % of others."""
        low, high = self.sight.bounds
        xs, zs = (low[axis] + (high - low)[axis] * (np.arange(8) + 0.5) / 8 for axis in (0, 2))
        columns = [self._covered(float(x), float(z))[0] for x in xs for z in zs]
        roofed = [any(height >= COVERED * (high - low)[1] for _, height in column) for column in columns]
        return sum(roofed) >= len(roofed) / 2

    def fault(
        self, camera: Camera, aspect: float, clearance: float, view: float, target: Array | None = None
    ) -> str | None:
        """Return what is wrong with a camera, in words that follow a number; None if nothing is.

        The nearest surface must be `clearance` metres away, what the picture shows, `view` metres (median), and without
        a target also the median of the distances to all sides.
        """
        least_facing, least_shown = (FACING, SHOWN) if target is None else (FACING_OUTSIDE, SHOWN_OUTSIDE)
        if not self.is_free(camera.position, clearance):
            return "were too near to something"
        around, facing = self.rays(camera.position, _all_around())
        if facing.sum() < least_facing * np.isfinite(around).sum():
            return "were inside or behind something"
        distance, facing = self.rays(camera.position, _through_picture(camera, aspect))
        if facing.mean() < max(least_shown, least_facing * np.isfinite(distance).mean()):
            return "showed too little"
        # Without a target, the picture must show what is as far away as what is all around, else it shows one wall.
        hits = around[np.isfinite(around)]
        usual = np.median(hits) if target is None and len(hits) else 0.0
        if np.median(distance) < max(view, usual):
            return "stared at something near"
        if target is not None:
            way = target - camera.position
            length = float(np.linalg.norm(way))
            if self.rays(camera.position, way[None] / length)[0][0] < FREE_WAY * length:
                return "had something before the target"
        return None

    def is_free(self, position: Array, clearance: float) -> bool:
        """Tell whether no surface is nearer than `clearance` metres, to the size of a cube."""
        outside = np.maximum(np.maximum(self.boxes[:, 0] - position, position - self.boxes[:, 1]), 0.0)
        if len(self.boxes) and np.linalg.norm(outside, axis=1).min() <= clearance:
            return False
        at = (position - self.sight.low) / self.sight.side
        reach = clearance / self.sight.side
        first = np.maximum(np.floor(at - reach), 0).astype(int)
        last = np.minimum(np.floor(at + reach) + 1, self.sight.filled.shape).astype(int)
        if (first >= last).any():
            return True
        block = self.sight.filled[tuple(slice(a, b) for a, b in zip(first, last, strict=True))]
        cubes = np.argwhere(block) + first
        gap = np.maximum(np.maximum(cubes - at, at - cubes - 1), 0.0)
        return not bool((np.linalg.norm(gap, axis=1) <= reach).any())

    def rays(self, origin: Array, directions: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Return distances of what rays of unit `directions` (n, 3) hit, inf for nothing, and which hits face them."""
        starts = np.broadcast_to(origin, directions.shape)
        distance, areas = self.sight.first_hits(starts, directions)
        facing = np.isfinite(distance) & (areas[:, 0] > TWO_SIDED * areas[:, 1])
        if not len(self.boxes):
            return distance, facing
        # Boxes are hit from outside; fmax and fmin leave out 0 / 0, a ray within a side of a box.
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = (self.boxes - origin) / directions[:, None, None]
        near = np.fmax.reduce(np.fmin(ends[:, :, 0], ends[:, :, 1]), axis=2)
        far = np.fmin.reduce(np.fmax(ends[:, :, 0], ends[:, :, 1]), axis=2)
        boxes = np.where((far >= near) & (near > 0), near, np.inf).min(1)
        return np.minimum(distance, boxes), np.where(boxes < distance, True, facing)


def _all_around() -> Array:
    """Return AROUND directions, equally spread (a Fibonacci lattice)."""
    i = np.arange(AROUND) + 0.5
    height, turn = 1 - 2 * i / AROUND, i * math.pi * (3 - math.sqrt(5))
    level = np.sqrt(1 - height**2)
    return np.stack([level * np.cos(turn), height, level * np.sin(turn)], -1)


def _through_picture(camera: Camera, aspect: float) -> Array:
    """Return unit directions through a grid of ACROSS pixels."""
    columns, rows = ((np.arange(n) + 0.5) / n * 2 - 1 for n in ACROSS)
    x, y = np.meshgrid(columns * aspect, -rows)
    slope = math.tan(camera.yfov / 2)
    along = np.stack([x * slope, y * slope, -np.ones_like(x)], -1).reshape(-1, 3)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    return along @ camera.world_from_view[:3, :3].T
