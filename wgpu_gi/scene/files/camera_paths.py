"""Cameras that move from frame to frame: a turntable around the scene, or keyframes from a JSON file.

Keyframes are joined by cubic Hermite splines with finite-difference tangents.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...camera import Camera
from ...errors import GiError
from ..scene import Scene
from .camera_files import camera_from
from .read import read_file

CameraAt = Callable[[int], Camera]  # the camera of a frame


def turntable(camera: Camera, scene: Scene, frames: range) -> CameraAt:
    """Return a camera that circles the middle of the scene's bounding box once, counter-clockwise from above.

    The first of `frames` shows `camera` itself, as would the frame after the last: the frames loop seamlessly.
    """
    low, high = scene.bounds()
    centre = (low + high) / 2
    length = max(frames.stop - frames.start, 1)

    def at(frame: int) -> Camera:
        angle = 2 * math.pi * (frame - frames.start) / length
        turn = np.eye(4)
        turn[0, 0] = turn[2, 2] = math.cos(angle)
        turn[0, 2], turn[2, 0] = math.sin(angle), -math.sin(angle)
        turn[:3, 3] = centre - turn[:3, :3] @ centre
        return replace(camera, world_from_view=turn @ camera.world_from_view)

    return at


def load_camera_path(path: str | Path) -> CameraPath:
    """Load a camera that moves through keyframes, from JSON such as [{"frame": 0, "position": ..., "target": ...}].

    A key has the fields of a camera file and its `frame`; frames must ascend. Position, target, up and angle follow
    cubic Hermite splines whose tangent at a key is that of the parabola through it and its neighbours. Before the first
    and after the last key the camera stands still. Raises GiError for the first key that is wrong.
    """
    # Read and check the keys.
    path = Path(path)
    try:
        keys = json.loads(read_file(path, "camera path").decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise GiError(f"camera path {path} is not JSON: {error}") from None
    if not isinstance(keys, list) or not keys:
        raise GiError(f'camera path {path} must hold a list of keys: {{"frame": 0, "position": ..., "target": ...}}')
    read = [_key(f"camera path {path}, key {i}", key) for i, key in enumerate(keys)]
    frames, values = [frame for frame, _ in read], np.array([value for _, value in read])
    for before, after in pairwise(frames):
        if after <= before:
            raise GiError(f"camera path {path}: frame {after} comes after frame {before}; sort the keys by frame")

    return CameraPath(path, frames, values)


@dataclass(frozen=True)
class CameraPath:
    """A camera on splines through `values` at `frames`: position, target, up and angle in each row of (n, 10)."""

    file: Path
    frames: list[int]
    values: NDArray[np.float64]

    def __call__(self, frame: float) -> Camera:
        """Return the camera of a frame, or between two."""
        value = _through(self.frames, self.values, frame)
        try:
            return Camera.look_at(value[:3], value[3:6], value[6:9], float(value[9]), self.file.stem)  # type: ignore[arg-type]
        except GiError as error:
            raise GiError(f"camera path {self.file}, frame {frame}: {error}") from None


def _key(where: str, key: Any) -> tuple[int, list[float]]:
    """Return the frame of a key, and its position, target, up and angle in one list."""
    if not isinstance(key, dict) or type(key.get("frame")) is not int:
        raise GiError(f"{where}: the field 'frame' must be a whole number")
    fields = {name: value for name, value in key.items() if name != "frame"}
    camera_from(fields, where)  # raises GiError for wrong fields
    up, angle = fields.get("up", [0.0, 1.0, 0.0]), fields.get("yfov_deg", 60.0)
    return key["frame"], [*map(float, (*fields["position"], *fields["target"], *up)), float(angle)]


def _through(frames: Sequence[int], values: NDArray[np.float64], frame: float) -> NDArray[np.float64]:
    """Return the value at `frame` of the splines through `values` (n, 10) at `frames`."""
    if frame <= frames[0]:
        return values[0]
    if frame >= frames[-1]:
        return values[-1]
    slopes = np.gradient(values, frames, axis=0) if len(frames) > 1 else np.zeros_like(values)
    i = int(np.searchsorted(frames, frame, side="right")) - 1
    length = frames[i + 1] - frames[i]
    t = (frame - frames[i]) / length
    start = (1 + 2 * t) * (1 - t) ** 2 * values[i] + t * (1 - t) ** 2 * length * slopes[i]
    end = t**2 * (3 - 2 * t) * values[i + 1] - t**2 * (1 - t) * length * slopes[i + 1]
    return start + end
