"""The view of a scene without cameras: from outside, or, where surfaces enclose the viewer, from inside at eye height.

Rays decide. From places on a grid, level rays look around: a place is enclosed if walls surround it that face it. The
view from inside then looks along the longest free way. From outside, the view is from the front, the right and above,
unless another one shows much more of the sides that surfaces face to: the open side of a room, the front of a plane.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from .scene import Scene
from .sight import Sight

Array = NDArray[np.float64]

# From the front (+Z in glTF), the right and above: a box shows three faces.
FRAMING_DIRECTION = (0.55, 0.4, 0.75)
FRAMING_YFOV_DEG = 45.0
FRAMING_MARGIN = 1.05  # factor on the distance: 5 % of free picture around the bounding box
# Another view from outside must show this many times what the usual one shows, where that shows less than ENOUGH: a
# convex body shows 0.35 to 0.4.
BETTER, ENOUGH = 1.3, 0.3
OTHER_AZIMUTHS, OTHER_RISES = 16, (0.0, 0.45, -0.6)  # other views: about +Y, and heights over horizontal distances
POINTS = 200  # surface points whose visibility is compared

EYE_HEIGHT = 1.6  # metres above the floor, in rooms of PEOPLE_SIZED height; in others, a share of the height
PEOPLE_SIZED = (2.0, 30.0)
EYE_SHARE = 0.45
INSIDE_YFOV_DEG = 65.0
GRID = 6  # places along x and z
AZIMUTHS, ELEVATIONS = 32, (-8.0, 0.0, 12.0)  # directions of the level rays; degrees
SMOOTHED = 1  # azimuths to each side over which free ways are averaged: a quarter of a picture's width
# A place is enclosed if this share of its level rays hits surfaces, this share of them faces it, and there is a ceiling
# or half of the surfaces are walls, whose normals lean less than WALL (|cosine| with the vertical).
ENCLOSED, FACING, WALL = 0.9, 0.7, 0.6
# A cube faces a ray if this share of the area that faces away faces it: it may hold both sides of a thin wall.
TWO_SIDED = 0.4


@dataclass
class Room:
    """What is above a floor: its height, and the free height up to a ceiling, or to the top of the scene; metres."""

    floor: float
    height: float
    covered: bool


@dataclass
class Place:
    """A place to stand: the eye (3,), and what surrounds it."""

    eye: Array
    room: Room
    azimuth: float  # of the longest free way, from +X towards +Z
    way: float  # its length, metres
    hit: float  # share of the level rays that hit surfaces
    facing: float  # share of the hits that face the place
    walls: float  # share of the hits that are on walls
    seen: float  # shares of the surfaces in sight that face the place, by area and by number, summed

    @property
    def merit(self) -> float:
        """What makes one place better than another: a long free way, much in sight."""
        return self.way * self.seen

    @property
    def stands_free(self) -> bool:
        """Tell whether surfaces face the place: it is not inside a solid body."""
        return self.facing >= FACING

    @property
    def is_enclosed(self) -> bool:
        """Tell whether the place is in a room or a courtyard."""
        return self.hit >= ENCLOSED and self.stands_free and (self.room.covered or self.walls >= 0.5)


def automatic_camera(scene: Scene) -> Camera:
    """Return a view of the whole scene from outside, or from inside if it encloses the viewer."""
    sight = Sight.of(scene)
    if not len(sight.points):
        return framing_camera(scene)
    places = _places(sight)
    enclosed = [p for p in places if p.is_enclosed]
    if enclosed and 2 * len(enclosed) >= sum(p.stands_free for p in places):
        best = max(enclosed, key=lambda p: p.merit)
        outside = _shares_seen(sight, _outside(sight, [FRAMING_DIRECTION]))
        if 2 * best.seen >= outside.sum():
            return _camera_at(best)
    return _outside_camera(sight)


def inside_camera(scene: Scene) -> Camera:
    """Return a view at eye height from the place with the longest free way, enclosed places first."""
    sight = Sight.of(scene)
    places = _places(sight) if len(sight.points) else []
    if not places:
        return framing_camera(scene)
    return _camera_at(max(places, key=lambda p: (p.is_enclosed, p.stands_free, p.merit)))


def framing_camera(scene: Scene) -> Camera:
    """Return a camera outside the scene that sees all of it, from the front, the right and above.

    Every corner of the bounding box lies inside a square picture; wider pictures have room at the sides. A scene
    without extent is seen from 1 m.
    """
    return _framing(scene.bounds(), FRAMING_DIRECTION)


def _framing(bounds: Array, direction: tuple[float, float, float]) -> Camera:
    """Return the camera that sees the box `bounds` (2, 3) from a direction."""
    low, high = bounds
    centre, half = (low + high) / 2, (high - low) / 2
    back = np.array(direction) / np.linalg.norm(direction)
    axes = Camera.look_at(back, (0.0, 0.0, 0.0)).world_from_view[:3, :3]
    corners = np.array([[(i >> a & 1) * 2 - 1 for a in range(3)] for i in range(8)]) * half @ axes
    # A corner at (x, y, z) from the centre is inside if |x| and |y| are below tan(yfov/2) times its distance d - z.
    slope = math.tan(math.radians(FRAMING_YFOV_DEG) / 2)
    distance = float((corners[:, 2] + np.abs(corners[:, :2]).max(1) / slope).max()) * FRAMING_MARGIN
    if distance == 0.0:
        distance = 1.0
    return Camera.look_at(centre + back * distance, centre, yfov_deg=FRAMING_YFOV_DEG, name="framing")


# ------------------------------------------------------------------------------------------------ From outside


def _outside_camera(sight: Sight) -> Camera:
    """Return the framing view from the usual direction, or from one that shows much more."""
    turns = 2 * np.pi * np.arange(OTHER_AZIMUTHS) / OTHER_AZIMUTHS
    views = [FRAMING_DIRECTION, *((float(np.sin(a)), rise, float(np.cos(a))) for rise in OTHER_RISES for a in turns)]
    views += [(0.0, 1.0, 0.0), (0.0, -1.0, 0.0)]
    # A view shows the share of surface points in sight, more if they face it.
    seen, cosine = sight.in_sight(_outside(sight, views), *_some(sight.points, sight.normals))
    shown = (seen * np.where(cosine > 0, 0.5 + 0.5 * cosine, 0.0)).mean(1)
    best = int(np.argmax(shown > 0.99 * shown.max()))
    much_better = shown[0] < ENOUGH and shown[best] > BETTER * shown[0] + 0.02
    return _framing(sight.bounds, views[best if much_better else 0])


def _outside(sight: Sight, directions: list[tuple[float, float, float]]) -> Array:
    """Return the positions of framing views, (n, 3)."""
    return np.array([_framing(sight.bounds, direction).position for direction in directions])


def _shares_seen(sight: Sight, eyes: Array) -> Array:
    """Return the shares of surfaces whose front each eye sees, by area and by number of triangles, (n, 2)."""
    shares = []
    for points, normals in (_some(sight.points, sight.normals), _some(*sight.details)):
        seen, cosine = sight.in_sight(eyes, points, normals)
        shares.append((seen & (cosine > 0)).mean(1))
    return np.stack(shares, 1)


def _some(points: Array, normals: Array) -> tuple[Array, Array]:
    """Return POINTS of the points, and their normals."""
    chosen = np.linspace(0, len(points) - 1, POINTS).astype(int)
    return points[chosen], normals[chosen]


# ------------------------------------------------------------------------------------------------ From inside


def _places(sight: Sight) -> list[Place]:
    """Return the places on a grid that have a floor and free ways."""
    low, high = sight.bounds
    rooms, eyes = [], []
    for i in range(GRID * GRID):
        share = (np.array([i % GRID, i // GRID]) + 0.5) / GRID
        x, z = (low + (high - low) * (share[0], 0, share[1]))[[0, 2]]
        room = _room_at(sight, float(x), float(z))
        if room is not None:
            height = EYE_HEIGHT if PEOPLE_SIZED[0] <= room.height <= PEOPLE_SIZED[1] else EYE_SHARE * room.height
            rooms.append(room)
            eyes.append((x, room.floor + height, z))
    if not rooms:
        return []
    size = float(np.linalg.norm((high - low)[[0, 2]]))
    return [place for place in _look_around(sight, np.array(eyes), rooms) if place.way > 0.1 * size]


def _room_at(sight: Sight, x: float, z: float) -> Room | None:
    """Return the tallest of the rooms above each other at (x, z), else the space above all; None without a floor."""
    bodies = sight.heights(x, z)
    if not bodies:
        return None
    floors, extent = [top for _, top in bodies], float(sight.bounds[1, 1] - sight.bounds[0, 1])
    gaps = [under - floor for floor, (under, _) in zip(floors, bodies[1:], strict=False)]
    if gaps and max(gaps) > 0.2 * extent:
        tallest = int(np.argmax(gaps))
        return Room(floors[tallest], gaps[tallest], True)
    return Room(floors[-1], max(float(sight.bounds[1, 1]) - floors[-1], 0.1 * extent), False)


def _look_around(sight: Sight, eyes: Array, rooms: list[Room]) -> list[Place]:
    """Trace level rays from each eye (n, 3) and choose the direction with the longest free way."""
    azimuth, elevation = 2 * np.pi * np.arange(AZIMUTHS) / AZIMUTHS, np.radians(ELEVATIONS)[:, None]
    x, y, z = np.cos(azimuth) * np.cos(elevation), np.sin(elevation), np.sin(azimuth) * np.cos(elevation)
    directions = np.stack(np.broadcast_arrays(x, y, z), -1).reshape(-1, 3)
    every, starts = np.tile(directions, (len(eyes), 1)), np.repeat(eyes, len(directions), 0)
    distance, areas = sight.first_hits(starts, every)
    # Rays that leave the scene are as long as those to its bounds.
    low, high = sight.bounds
    with np.errstate(divide="ignore", invalid="ignore"):
        exits = np.where(every > 0, (high - starts) / every, np.where(every < 0, (low - starts) / every, np.inf)).min(1)
    ways = np.minimum(distance, np.maximum(exits, 0)).reshape(len(eyes), len(ELEVATIONS), AZIMUTHS).mean(1)
    smooth = np.mean([np.roll(ways, k, 1) for k in range(-SMOOTHED, SMOOTHED + 1)], 0)
    best = smooth.argmax(1)
    # Take shares by place.
    hit = np.isfinite(distance).reshape(len(eyes), -1)
    towards, away, vertical = np.moveaxis(areas.reshape(len(eyes), -1, 3), 2, 0)
    hits = np.maximum(hit.sum(1), 1)
    facing, walls = (hit & (towards > TWO_SIDED * away)).sum(1) / hits, (hit & (vertical < WALL)).sum(1) / hits
    seen = _shares_seen(sight, eyes).sum(1)
    return [
        Place(eye, room, float(azimuth[b]), float(s[b]), float(h.mean()), float(f), float(w), float(v))
        for eye, room, b, s, h, f, w, v in zip(eyes, rooms, best, smooth, hit, facing, walls, seen, strict=True)
    ]


def _camera_at(place: Place) -> Camera:
    """Return the camera of a place: along its free way, turned at most 7 degrees up to the middle of the room."""
    rise = float(np.clip(place.room.floor + 0.5 * place.room.height - place.eye[1], 0.0, 0.12 * place.way))
    way = np.array([math.cos(place.azimuth) * place.way, rise, math.sin(place.azimuth) * place.way])
    return Camera.look_at(place.eye.tolist(), (place.eye + way).tolist(), yfov_deg=INSIDE_YFOV_DEG, name="inside")
