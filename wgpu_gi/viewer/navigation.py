"""Camera motions: orbit and pan about a pivot, zoom to it, look around, fly.

Angles are radians, lengths metres. World Y stays up, so no drag rolls the camera.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..camera import Camera
from ..scene.scene import Scene

STEEPEST = math.radians(89.0)  # limit on looking up or down: at 90 degrees, a turn about Y is a roll
NEAREST = 1e-3  # shares of the scene's size to which zooming approaches the pivot

Vector = NDArray[np.float64]


def pivot_of(camera: Camera, scene: Scene) -> Vector:
    """Return a pivot in front of the camera: as far as the middle of the scene, at least a quarter of its size."""
    low, high = scene.bounds()
    forward = -camera.world_from_view[:3, 2]
    distance = float(((low + high) / 2 - camera.position) @ forward)
    return camera.position + forward * max(distance, size_of(scene) / 4)


def size_of(scene: Scene) -> float:
    """Return the diagonal of the scene's bounding box, 1 if it has none."""
    return float(np.linalg.norm(np.ptp(scene.bounds(), axis=0))) or 1.0


def orbit(camera: Camera, pivot: ArrayLike, right: float, down: float) -> Camera:
    """Turn the scene right and down: the camera moves about the pivot to the left and up."""
    return _turned(camera, np.asarray(pivot, np.float64), -right, -down)


def look(camera: Camera, right: float, down: float) -> Camera:
    """Turn the camera on the spot, to the right and down."""
    return _turned(camera, camera.position.copy(), -right, -down)


def pan(camera: Camera, pivot: ArrayLike, right: float, down: float) -> tuple[Camera, Vector]:
    """Move camera and pivot so that the scene moves right and down by shares of the picture's height; return both."""
    distance = float((np.asarray(pivot) - camera.position) @ -camera.world_from_view[:3, 2])
    height = camera.orthographic_height or 2 * math.tan(camera.yfov / 2) * max(distance, 0.0)
    shift = camera.world_from_view[:3, :3] @ np.array([-right, down, 0.0]) * height
    return _moved(camera, shift), np.asarray(pivot, np.float64) + shift


def zoom(camera: Camera, pivot: ArrayLike, factor: float, size: float) -> Camera:
    """Scale the distance to the pivot, or the height of an orthographic view, by `factor`."""
    if camera.orthographic_height is not None:
        return replace(camera, orthographic_height=max(camera.orthographic_height * factor, NEAREST * size))
    offset = camera.position - np.asarray(pivot, np.float64)
    distance = float(np.linalg.norm(offset))
    wanted = max(distance * factor, NEAREST * size)
    return _moved(camera, offset * (wanted / max(distance, 1e-30) - 1.0))


def fly(camera: Camera, steps: Sequence[float]) -> Camera:
    """Move by metres to the camera's right, up in the world, and forward."""
    right, up, forward = steps
    axes = camera.world_from_view[:3, :3]
    return _moved(camera, axes[:, 0] * right + np.array([0.0, up, 0.0]) - axes[:, 2] * forward)


def frame_all(camera: Camera, scene: Scene, aspect: float) -> Camera:
    """Move the camera, without turning it, so that it sees the bounding sphere of the scene."""
    low, high = scene.bounds()
    radius = size_of(scene) / 2
    back = camera.world_from_view[:3, 2]
    half = math.atan(math.tan(camera.yfov / 2) * min(aspect, 1.0))
    placed = camera.world_from_view.copy()
    placed[:3, 3] = (low + high) / 2 + back * radius / math.sin(half)
    height = None if camera.orthographic_height is None else 2 * radius / min(aspect, 1.0)
    return replace(camera, world_from_view=placed, orthographic_height=height)


def _turned(camera: Camera, centre: Vector, yaw: float, pitch: float) -> Camera:
    """Rotate about `centre`, by `yaw` about world Y and `pitch` about the camera's right, short of the poles."""
    axes = camera.world_from_view[:3, :3]
    steepness = math.asin(float(np.clip(-axes[1, 2], -1.0, 1.0)))  # elevation of the view: up is positive
    limited = float(np.clip(steepness + pitch, min(-STEEPEST, steepness), max(STEEPEST, steepness))) - steepness
    turn = _rotation((0.0, 1.0, 0.0), yaw) @ _rotation(axes[:, 0], limited)
    placed = np.eye(4)
    placed[:3, :3] = turn @ axes
    placed[:3, 3] = centre + turn @ (camera.position - centre)
    # Orthonormalise, so that rounding does not add up over thousands of turns.
    placed[:3, :3], _ = np.linalg.qr(placed[:3, :3])
    placed[:3, :3] *= np.sign(np.diag(placed[:3, :3].T @ (turn @ axes)))
    return replace(camera, world_from_view=placed)


def _moved(camera: Camera, shift: Vector) -> Camera:
    placed = camera.world_from_view.copy()
    placed[:3, 3] += shift
    return replace(camera, world_from_view=placed)


def _rotation(axis: ArrayLike, angle: float) -> Vector:
    """Return the (3, 3) rotation about a unit axis, counter-clockwise seen from its tip (Rodrigues)."""
    x, y, z = np.asarray(axis, np.float64)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross
