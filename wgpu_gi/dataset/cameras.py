"""Cameras drawn at random where rays say that something can be seen: on a sphere, in a room, along a path.

A drawn camera is kept if it has free space around it, is not inside a body, and its picture shows enough, not a wall
close by; else another is drawn. Rays march through the cubes of `surroundings`.

Source: the camera samplers of BlenderProc, M. Denninger et al. 2023, "BlenderProc2: A Procedural Pipeline for
Photorealistic Rendering", JOSS 8(82): proximity checks and coverage by rays.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..camera import YFOV_DEG, Camera
from ..errors import GiError, near_names
from ..scene.auto_camera import EYE_HEIGHT, EYE_SHARE, PEOPLE_SIZED, framing_camera
from ..scene.files.camera_paths import CameraPath, load_camera_path
from .surroundings import Surroundings

Array = NDArray[np.float64]
Range = tuple[float, float]  # drawn uniformly between both

TRIES = 1000  # of a frame; a place as rare as one in 100 is missed by 0.00004 of the frames
CLEARANCE = 0.03  # default of the free space around cameras on a sphere, share of the scene's largest side
# Defaults of cameras in a room, as multiples of their height above the floor: 0.3 m and 2 m for people.
ROOM_CLEARANCE, ROOM_VIEW = 0.2, 1.25


@dataclass(frozen=True)
class SphereCameras:
    """Cameras around a point that look at it.

    Without `target` and `distance`: the middle of the scene, from 1 to 1.5 times as far as a view of all of it.
    Directions are uniform on the part of the sphere between two elevations. `target_shift` moves the target along each
    axis by up to that much. All lengths in metres; azimuth 0 is +Z, 90 degrees is +X.
    """

    target: tuple[float, float, float] | None = None
    distance: Range | None = None
    elevation_deg: Range = (5.0, 60.0)
    azimuth_deg: Range = (0.0, 360.0)
    target_shift: float = 0.0
    roll_deg: Range = (0.0, 0.0)
    yfov_deg: Range = (45.0, 45.0)
    clearance: float | None = None  # to the nearest surface; None: CLEARANCE
    view: float = 0.0  # least median distance of what the picture shows


@dataclass(frozen=True)
class RoomCameras:
    """Cameras anywhere above a floor that look about.

    Without `height` above the floor: 1.6 m in spaces from 2 to 30 m high, 45 % of the height in others, +- 20 %.
    Without `clearance` and `view`: 0.2 and 1.25 times that height.
    """

    height: Range | None = None
    azimuth_deg: Range = (0.0, 360.0)  # of the view
    elevation_deg: Range = (-20.0, 10.0)  # of the view; positive looks up
    roll_deg: Range = (0.0, 0.0)
    yfov_deg: Range = (55.0, 70.0)
    clearance: float | None = None
    view: float | None = None


@dataclass(frozen=True)
class PathCameras:
    """Cameras along the keys of a path, evenly from the first to the last.

    `shift` moves each along each axis by up to that much (metres), `turn_deg` turns it to the sides and up or down. The
    checks of the other kinds apply to cameras that are moved.
    """

    path: CameraPath
    shift: float = 0.0
    turn_deg: float = 0.0
    clearance: float = 0.0
    view: float = 0.0


Cameras = SphereCameras | RoomCameras | PathCameras
KINDS: dict[str, type] = {"sphere": SphereCameras, "room": RoomCameras, "path": PathCameras}


def cameras_from(table: dict[str, Any], where: str, folder: Path) -> Cameras:
    """Return the cameras of a table with `kind` and the fields of its class; files are relative to `folder`.

    A range is [least, most], or a number. Raises GiError that names the first wrong field, after `where`.
    """
    kind = table.get("kind")
    if kind not in KINDS:
        known = near_names(kind, KINDS) if isinstance(kind, str) else f"available: {', '.join(KINDS)}"
        raise GiError(f"{where}.kind: there is no {kind!r}; {known}")
    types = {each.name: str(each.type) for each in fields(KINDS[kind])}
    values: dict[str, Any] = {}
    for name, value in table.items():
        if name == "kind":
            continue
        if name not in types:
            raise GiError(f"{where}.{name}: cameras of the kind {kind} have no such field; {near_names(name, types)}")
        values[name] = _value(types[name], value, f"{where}.{name}", folder)
    if kind == "path" and "path" not in values:
        raise GiError(f"{where}.path is missing: the name of a .json file of keys")
    if not all(YFOV_DEG[0] <= angle <= YFOV_DEG[1] for angle in values.get("yfov_deg", ())):
        raise GiError(f"{where}.yfov_deg must lie between {YFOV_DEG[0]:.4f} and {YFOV_DEG[1]:.4f} degrees")
    cameras: Cameras = KINDS[kind](**values)
    return cameras


def _value(kind: str, value: Any, where: str, folder: Path) -> Any:
    """Return a field of a table in the type of its class."""
    if kind == "CameraPath":
        if not isinstance(value, str):
            raise GiError(f"{where} must be the name of a .json file of keys, not {value!r}")
        return load_camera_path(folder / value)
    numbers = value if isinstance(value, list) else [value]
    if not all(type(each) in (int, float) and math.isfinite(each) for each in numbers):
        raise GiError(f"{where} must hold finite numbers, not {value!r}")
    if kind.startswith("tuple"):
        if not isinstance(value, list) or len(value) != 3:
            raise GiError(f"{where} must be three numbers, [x, y, z] in metres, not {value!r}")
        return tuple(map(float, value))
    if kind.startswith("Range"):
        if len(numbers) not in (1, 2) or numbers[0] > numbers[-1]:
            raise GiError(f"{where} must be a number, or [least, most], not {value!r}")
        return float(numbers[0]), float(numbers[-1])
    if isinstance(value, list) or value < 0:
        raise GiError(f"{where} must be a number from 0, not {value!r}")
    return float(value)


def draw_camera(
    cameras: Cameras, surroundings: Surroundings, random: np.random.Generator, aspect: float, share: float = 0.0
) -> tuple[Camera, dict[str, Any]]:
    """Draw a camera, and return it with what was drawn: position, target, angles and the number of tries.

    `aspect` is the width of the picture over its height, `share` from 0 to 1 the place on a path. Raises GiError if no
    camera passes the checks, with what they found.
    """
    found: Counter[str] = Counter()
    for attempt in range(1, TRIES + 1):
        clearance, view = CLEARANCE * surroundings.size, 0.0
        if isinstance(cameras, SphereCameras):
            camera, target = _on_sphere(cameras, surroundings, random)
        elif isinstance(cameras, RoomCameras):
            standing = _in_room(cameras, surroundings, random)
            if standing is None:
                found["had no room above a floor"] += 1
                continue
            camera, target, height = standing
            clearance, view = ROOM_CLEARANCE * height, ROOM_VIEW * height
        else:
            camera, target = _on_path(cameras, random, share)
            if not cameras.shift and not cameras.turn_deg:
                return camera, _drawn(camera, target, attempt)
        clearance = clearance if cameras.clearance is None else cameras.clearance
        view = view if cameras.view is None else cameras.view
        aim = target if isinstance(cameras, SphereCameras) else None
        fault = surroundings.fault(camera, aspect, clearance, view, aim)
        if fault is None:
            return camera, _drawn(camera, target, attempt)
        found[fault] += 1
    reasons = ", ".join(f"{count} {reason}" for reason, count in found.most_common())
    raise GiError(f"no camera was found: of {TRIES}, {reasons}; change its ranges, or lower clearance or view")


def _drawn(camera: Camera, target: Array, attempt: int) -> dict[str, Any]:
    up, angle = camera.world_from_view[:3, 1], math.degrees(camera.yfov)
    known = {"position": camera.position.tolist(), "target": target.tolist(), "up": up.tolist(), "yfov_deg": angle}
    return {**known, "tries": attempt}


def _on_sphere(cameras: SphereCameras, surroundings: Surroundings, random: np.random.Generator) -> tuple[Camera, Array]:
    """Return a camera on a sphere, and its target (3,)."""
    low, high = surroundings.sight.bounds
    target = (low + high) / 2 if cameras.target is None else np.array(cameras.target)
    distance = cameras.distance
    if distance is None:
        whole = float(np.linalg.norm(framing_camera(surroundings.scene).position - (low + high) / 2))
        distance = whole, 1.5 * whole
    target = target + cameras.target_shift * random.uniform(-1, 1, 3)
    position = target + random.uniform(*distance) * _direction(random, cameras.azimuth_deg, cameras.elevation_deg)
    return _looking(position, target, random.uniform(*cameras.yfov_deg), random.uniform(*cameras.roll_deg)), target


def _in_room(
    cameras: RoomCameras, surroundings: Surroundings, random: np.random.Generator
) -> tuple[Camera, Array, float] | None:
    """Return a camera above a floor, a point in the middle of its view, and its height above the floor.

    None where there is no floor, or not enough height above it.
    """
    low, high = surroundings.sight.bounds
    x, _, z = random.uniform(low, high)
    spaces = surroundings.spaces(float(x), float(z))
    if not spaces:
        return None
    space = spaces[random.integers(len(spaces))]
    usual = EYE_HEIGHT if PEOPLE_SIZED[0] <= space.height <= PEOPLE_SIZED[1] else EYE_SHARE * space.height
    height = random.uniform(*(cameras.height or (0.8 * usual, 1.2 * usual)))
    if height >= space.height and not space.is_open:
        return None
    position = np.array([x, space.floor + height, z])
    forward = _direction(random, cameras.azimuth_deg, cameras.elevation_deg)
    target = position + surroundings.size / 10 * forward
    camera = _looking(position, target, random.uniform(*cameras.yfov_deg), random.uniform(*cameras.roll_deg))
    return camera, target, float(height)


def _on_path(cameras: PathCameras, random: np.random.Generator, share: float) -> tuple[Camera, Array]:
    """Return a camera on a path, and a point in the middle of its view."""
    first, last = cameras.path.frames[0], cameras.path.frames[-1]
    camera = cameras.path(first + share * (last - first))
    shift = cameras.shift * random.uniform(-1, 1, 3)
    aside, up = np.tan(np.radians(cameras.turn_deg * random.uniform(-1, 1, 2)))
    right, upward, back = camera.world_from_view[:3, :3].T
    position = camera.position + shift
    target = position + (-back + aside * right + up * upward)
    if not cameras.shift and not cameras.turn_deg:
        return camera, target
    return Camera.look_at(position.tolist(), target.tolist(), upward.tolist(), math.degrees(camera.yfov)), target


def _direction(random: np.random.Generator, azimuth_deg: Range, elevation_deg: Range) -> Array:
    """Return a direction (3,), uniform on its part of the sphere."""
    azimuth = math.radians(random.uniform(*azimuth_deg))
    height = random.uniform(*np.sin(np.radians(elevation_deg)))
    level = math.sqrt(max(1 - height**2, 0.0))
    return np.array([math.sin(azimuth) * level, height, math.cos(azimuth) * level])


def _looking(position: Array, target: Array, yfov_deg: float, roll_deg: float) -> Camera:
    """Return a camera that looks at a target, rolled about the way there."""
    camera = Camera.look_at(position.tolist(), target.tolist(), yfov_deg=yfov_deg)
    roll = np.eye(4)
    c, s = math.cos(math.radians(roll_deg)), math.sin(math.radians(roll_deg))
    roll[:2, :2] = [[c, -s], [s, c]]
    return replace(camera, world_from_view=camera.world_from_view @ roll)
