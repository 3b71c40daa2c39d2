"""Loads a scene from a built-in name or a file, and adds a default light and camera if it has none."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from ..errors import GiError, known_names
from .built_in.scenes import BUILTIN_SCENES, builtin_scene
from .check import check_scene
from .files.camera_files import framing_camera
from .files.memory import MAX_MEMORY, MemoryBudget
from .files.mesh_files import MESH_EXTENSIONS, load_mesh_file
from .files.notes import Notes
from .files.read import read_file
from .rules import shown
from .scene import Environment, Light, Scene

GLTF_EXTENSIONS = (".glb", ".gltf")

NO_CAMERA_NOTE = "the scene has no camera: one that frames it was added (--camera sets another)"

# Radiance of the default sky: 1, so that an unoccluded matte surface of albedo rho has radiance rho.
DEFAULT_SKY = (1.0, 1.0, 1.0)


def load(
    source: str | Path,
    *,
    environment: Environment | None = None,
    lights: Sequence[Light] = (),
    max_memory: int = MAX_MEMORY,
    strict: bool = False,
    point_size: float | None = None,
) -> Scene:
    """Load a scene: a built-in name ("cornell") or a .glb, .gltf, .obj, .ply, .stl or .off file.

    `environment` replaces the scene's, `lights` are added to its own. A scene that then has no source of light gets a
    white sky of radiance 1, and one without a camera gets a camera that frames it; `Scene.notes` says so. A bare name
    is a built-in scene, even if a file has that name; files need their extension. A damaged part of a file is left out
    with a note, or raises GiError if `strict`. Points without faces are shown as discs or spheres of the diameter
    `point_size` in metres, by default twice their spacing.

    Raises GiError for unknown names and extensions, with a list of the known ones, for missing, empty and truncated
    files and those with nothing to show, and for a file that unpacks to more than `max_memory` bytes (decoded textures,
    decompressed geometry).
    """
    if not isinstance(source, (str, os.PathLike)):
        raise GiError(f"a scene is loaded from a name or a path, not from {shown(source)}")
    path, budget, notes = Path(source), MemoryBudget(max_memory), Notes(strict)
    extension = path.suffix.lower()
    if str(source) in BUILTIN_SCENES:
        scene = builtin_scene(str(source))
    elif extension in GLTF_EXTENSIONS:
        from .gltf.load import load_gltf

        scene = load_gltf(path, budget, notes)
    elif extension in MESH_EXTENSIONS:
        scene = load_mesh_file(path, budget, notes, point_size)
    else:
        raise _unknown(path)
    if environment is not None:
        scene.environment = environment
    if not isinstance(lights, (list, tuple)):
        raise GiError(f"lights must be a list of lights, not {shown(lights)}")
    scene.lights.extend(lights)
    check_scene(scene)
    add_defaults(scene)
    return scene


def _unknown(path: Path) -> GiError:
    """Return the reason why `path` is not a scene: a folder, missing, empty, a mistyped name or an unknown format."""
    formats = " ".join((*GLTF_EXTENSIONS, *MESH_EXTENSIONS))
    if not path.suffix and not os.path.exists(path):
        hint = f"{known_names(str(path), BUILTIN_SCENES)} (built in: {', '.join(BUILTIN_SCENES)}; files: {formats})"
        return GiError(f"there is no built-in scene or file {str(path)!r}; {hint}")
    try:
        read_file(path, "scene file")
    except GiError as error:
        return error
    kind = path.suffix or "a file without extension"
    return GiError(f"{path}: {kind} is not a supported scene format; use {formats}")


def has_light(scene: Scene) -> bool:
    """Tell whether the scene has a source of light, or needs none because all of its materials are unlit."""
    materials = scene.materials
    emitting = any(max(m.emission) > 0 for m in materials) or (bool(materials) and all(m.unlit for m in materials))
    return bool(scene.lights) or scene.environment is not None or emitting


def add_defaults(scene: Scene) -> None:
    """Add a white sky to a scene without light and a framing camera to one without cameras, with a note for each."""
    if not has_light(scene):
        scene.environment = Environment(DEFAULT_SKY, name="default sky")
        scene.notes.append("the scene has no light: a white sky of radiance 1 was added (--env or --light set others)")
    if not scene.cameras:
        scene.cameras.append(framing_camera(scene))
        scene.notes.append(NO_CAMERA_NOTE)
