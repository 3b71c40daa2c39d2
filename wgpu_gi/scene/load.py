"""One way in: a scene from a built-in name or a file, completed with a stated default light and camera."""

from __future__ import annotations

import difflib
import math
import os
from collections.abc import Sequence
from pathlib import Path

from ..errors import GiError
from .builtin import BUILTIN_SCENES, builtin_scene
from .camera_files import framing_camera
from .files import read_file
from .mesh_files import MESH_EXTENSIONS, load_mesh_file
from .scene import DirectionalLight, Environment, Light, PointLight, Scene

GLTF_EXTENSIONS = (".glb", ".gltf")

NO_CAMERA_NOTE = "the scene has no camera: one was placed that frames it (--camera sets another)"

# Radiance of the default sky: white, so that a material of albedo rho in the open has radiance rho.
DEFAULT_SKY = (1.0, 1.0, 1.0)


def load(source: str | Path, *, environment: Environment | None = None, lights: Sequence[Light] = ()) -> Scene:
    """Load a scene: a built-in name ("cornell") or a .glb, .gltf, .obj, .ply, .stl or .off file.

    `environment` replaces the scene's, `lights` are added to its own. A scene that then has no source of light gets a
    white sky of radiance 1, and one without a camera a framing camera; `Scene.notes` says so. A bare name is a
    built-in scene, even if a file is called so; a file needs its extension. Raises GiError for unknown names and
    extensions, for missing, empty and damaged files, with the supported ones listed.
    """
    path = Path(source)
    extension = path.suffix.lower()
    if str(source) in BUILTIN_SCENES:
        scene = builtin_scene(str(source))
    elif extension in GLTF_EXTENSIONS:
        from .gltf import load_gltf

        scene = load_gltf(path)
    elif extension in MESH_EXTENSIONS:
        scene = load_mesh_file(path)
    else:
        raise _unknown(path)
    if environment is not None:
        scene.environment = environment
    scene.lights.extend(lights)
    add_defaults(scene)
    return scene


def _unknown(path: Path) -> GiError:
    """Say why `path` is no scene: a folder, missing, empty, a mistyped name or a format that is not read."""
    formats = " ".join((*GLTF_EXTENSIONS, *MESH_EXTENSIONS))
    names = ", ".join(BUILTIN_SCENES)
    if not path.suffix and not os.path.exists(path):
        close = difflib.get_close_matches(str(path), BUILTIN_SCENES, 1)
        hint = f"; did you mean {close[0]!r}?" if close else ""
        return GiError(f"there is no built-in scene or file {str(path)!r}{hint} (built in: {names}; files: {formats})")
    try:
        read_file(path, "scene file")
    except GiError as error:
        return error
    kind = path.suffix or "a file without extension"
    return GiError(f"{path}: {kind} is no scene format that is read; use {formats}")


def has_light(scene: Scene) -> bool:
    """Say whether the scene has any source of light, or nothing that needs one because all of it is unlit."""
    materials = scene.materials
    emitting = any(max(m.emission) > 0 for m in materials) or (bool(materials) and all(m.unlit for m in materials))
    return bool(scene.lights) or scene.environment is not None or emitting


def add_defaults(scene: Scene) -> None:
    """Give a scene without light a white sky, and one without cameras a framing camera, and note it."""
    if not has_light(scene):
        scene.environment = Environment(DEFAULT_SKY, name="default sky")
        scene.notes.append("the scene has no light: a white sky of radiance 1 was added (--env or --light set others)")
    if not scene.cameras:
        scene.cameras.append(framing_camera(scene))
        scene.notes.append(NO_CAMERA_NOTE)


def parse_light(text: str) -> Light:
    """Return the light that "sun dx,dy,dz r,g,b" or "point x,y,z r,g,b" describes.

    The sun's direction is that of travel and its r,g,b are lux (W/m2) on a plane facing it; a point's position is in
    metres and its r,g,b are candela (W/sr). One value instead of three is white light. Raises GiError if malformed,
    not finite or negative, or without direction.
    """
    words = text.split()
    if len(words) != 3 or words[0] not in ("sun", "point"):
        raise GiError(f'light {text!r} is not understood; write "sun dx,dy,dz r,g,b" or "point x,y,z r,g,b"')
    where, power = _numbers(text, words[1]), _numbers(text, words[2])
    power = power * 3 if len(power) == 1 else power
    place = "direction" if words[0] == "sun" else "position"
    if len(where) != 3 or len(power) != 3:
        raise GiError(f"light {text!r} needs three numbers for its {place} and three for its colour")
    if min(power) < 0:
        raise GiError(f"light {text!r}: a light cannot be negative")
    color = (power[0], power[1], power[2])
    if words[0] == "point":
        return PointLight(where, 1.0, color, name="point")
    if not any(where):
        raise GiError(f"light {text!r}: the direction 0,0,0 points nowhere; the sun at noon travels 0,-1,0")
    return DirectionalLight(where, 1.0, color, name="sun")


def _numbers(text: str, word: str) -> list[float]:
    """Parse comma-separated finite numbers."""
    try:
        values = [float(part) for part in word.split(",")]
    except ValueError:
        raise GiError(f"light {text!r}: {word!r} is not a list of numbers such as 0.3,-1,0.2") from None
    if not all(math.isfinite(value) for value in values):
        raise GiError(f"light {text!r}: all numbers must be finite")
    return values
