"""The camera that a user names: one of the scene, a JSON file or text, or an automatic view (`auto_camera`)."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path
from typing import Any

import numpy as np

from ...camera import YFOV_DEG, Camera
from ...errors import GiError
from ...float_limits import LARGEST_HEIGHT, SMALLEST_HEIGHT
from ..auto_camera import automatic_camera, inside_camera
from ..rules import is_whole, shown
from ..scene import Scene
from .read import read_file

AUTOMATIC = {"auto": automatic_camera, "inside": inside_camera}
CAMERA_FIELDS = ("position", "target", "up", "yfov_deg", "orthographic_height")


def load_camera(path: str | Path) -> Camera:
    """Load a camera from JSON such as {"position": [0, 1, 5], "target": [0, 1, 0], "yfov_deg": 50}.

    `position` and `target` are world points in metres. `up` ([0, 1, 0]) and `yfov_deg` (60, full vertical angle) are
    optional; `orthographic_height` (metres) makes the projection orthographic. The camera is named after the file.
    Raises GiError for the first field that is missing or wrong.
    """
    path = Path(path)
    try:
        text = read_file(path, "camera file").decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise GiError(f"camera file {path} is not JSON: {error}") from None
    return _parse_camera(text, f"camera file {path}", path.stem)


def _parse_camera(text: str, where: str, name: str) -> Camera:
    try:
        fields = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise GiError(f"{where} is not JSON: {error}") from None
    return camera_from(fields, where, name)


def camera_fields(camera: Camera, distance: float) -> dict[str, Any]:
    """Return the fields of a camera file for a camera whose target lies `distance` metres in front of it."""
    axes = camera.world_from_view[:3, :3]
    fields = {
        "position": camera.position.tolist(),
        "target": (camera.position - axes[:, 2] * distance).tolist(),
        "up": axes[:, 1].tolist(),
        "yfov_deg": math.degrees(camera.yfov),
    }
    if camera.orthographic_height is not None:
        fields["orthographic_height"] = camera.orthographic_height
    return fields


def camera_from(fields: Any, where: str, name: str = "") -> Camera:
    """Return the camera that the fields of a camera file describe; `where` begins messages. Raises GiError."""
    # Refuse unknown, missing and wrong fields.
    if not isinstance(fields, dict):
        raise GiError(f'{where} must hold an object such as {{"position": [0, 1, 5], "target": [0, 1, 0]}}')
    unknown = sorted(set(fields) - set(CAMERA_FIELDS))
    if unknown:
        raise GiError(f"{where}: unknown field {unknown[0]!r}; known are {', '.join(CAMERA_FIELDS)}")
    for field in ("position", "target"):
        if field not in fields:
            raise GiError(f"{where}: the field {field!r} is missing")
    yfov_deg, (low, high) = fields.get("yfov_deg", 60.0), YFOV_DEG
    if not _is_number(yfov_deg) or not low <= yfov_deg <= high:
        raise GiError(f"{where}: 'yfov_deg' must be a number from {low:.4f} to {high:.4f} degrees, not {yfov_deg!r}")
    up = _vector(where, fields, "up") if "up" in fields else [0.0, 1.0, 0.0]
    if not any(up):
        raise GiError(f"{where}: 'up' must have a direction, not [0, 0, 0]")
    height = fields.get("orthographic_height")
    if height is not None and not (_is_number(height) and SMALLEST_HEIGHT <= height <= LARGEST_HEIGHT):
        between = f"from {SMALLEST_HEIGHT:g} to {LARGEST_HEIGHT:g}"
        raise GiError(f"{where}: 'orthographic_height' must be a number of metres {between}, not {height!r}")
    # Make the camera.
    position, target = _vector(where, fields, "position"), _vector(where, fields, "target")
    try:
        camera = Camera.look_at(position, target, up, float(yfov_deg), name)
    except GiError as error:
        raise GiError(f"{where}: {error}") from None
    camera.orthographic_height = None if height is None else float(height)
    return camera


def _is_number(value: Any) -> bool:
    try:
        return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
    except OverflowError:  # an integer beyond the largest double
        return False


def _vector(where: str, fields: dict[str, Any], name: str) -> list[float]:
    """Return the three finite numbers of a field. Raises GiError for anything else."""
    value = fields[name]
    if isinstance(value, (tuple, np.ndarray)):
        value = value.tolist() if isinstance(value, np.ndarray) else list(value)
    if not isinstance(value, list) or len(value) != 3 or not all(_is_number(v) for v in value):
        raise GiError(f"{where}: {name!r} must be three finite numbers, not {json.dumps(value, default=str)[:60]}")
    return [float(v) for v in value]


def choose_camera(scene: Scene, selector: str | int | None = None, folder: Path | None = None) -> Camera:
    """Return the camera that `selector` names; None is the first camera.

    `selector` is a name or an index in the scene, `auto` (from outside, or from inside a scene that encloses the
    viewer), `inside` (at eye height), a .json file, or the text of such a file. Names come first, indices last. A
    relative file is looked up in the working folder, then in `folder` (the scene's). A scene without cameras has one,
    `auto`. Raises GiError with a list of the cameras if there is no such camera.
    """
    by_name = {camera.name: camera for camera in reversed(scene.cameras) if camera.name}
    if selector in by_name:
        return by_name[str(selector)]
    if selector in AUTOMATIC:
        return AUTOMATIC[str(selector)](scene)
    if str(selector).lstrip().startswith("{"):
        return _parse_camera(str(selector), "the camera", "")
    if str(selector).lower().endswith(".json"):
        path = Path(str(selector))
        beside = folder / path if folder else path
        return load_camera(path if os.path.exists(path) or not os.path.exists(beside) else beside)
    cameras = scene.cameras or [automatic_camera(scene)]
    try:
        index = 0 if selector is None else int(selector)
    except ValueError:
        index = -1
    if 0 <= index < len(cameras):
        return cameras[index]
    known = ", ".join(f"{i} {camera.name!r}" for i, camera in enumerate(cameras[:20]))
    raise GiError(
        f"there is no camera {selector!r}; this scene has {known}; or give {' or '.join(AUTOMATIC)}, or a .json file"
    )


def camera_of(scene: Scene, camera: Camera | str | int | dict[str, Any] | None) -> Camera:
    """Return a camera that Python code gives: a Camera, the fields of a camera file, or what `choose_camera` takes.

    Raises GiError for another.
    """
    if isinstance(camera, Camera):
        return camera
    if isinstance(camera, dict):
        return camera_from(camera, "camera")
    if camera is not None and not isinstance(camera, str) and not is_whole(camera):
        known = "the name or index of one in the scene, 'auto', 'inside', or a dict"
        raise GiError(f"camera must be a Camera, {known}, not {shown(camera)}")
    return choose_camera(scene, camera)
