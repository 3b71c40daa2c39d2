"""Loads a scene from a built-in name, a file or objects, and adds a default light and camera if it has none."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from ..errors import GiError, known_names, warn_of
from .auto_camera import automatic_camera
from .built_in.scenes import BUILTIN_SCENES, builtin_scene
from .check import check_scene
from .default_sky import default_sky
from .files.environment_files import load_environment
from .files.memory import MAX_MEMORY, MemoryBudget
from .files.mesh_files import MESH_EXTENSIONS, load_mesh_file
from .files.notes import Notes
from .files.read import read_file
from .objects import scene_of_object
from .pose import check_time, outside, start_of
from .rules import is_whole, shown
from .scene import Environment, Light, Scene

GLTF_EXTENSIONS = (".glb", ".gltf")
USD_EXTENSIONS = (".usd", ".usda", ".usdc", ".usdz")

NO_CAMERA_NOTE = "the scene has no camera: an automatic view was added"
NO_LIGHT_NOTE = "the scene has no light: an overcast sky was added"
GLOW_NOTE = "the scene has no light but surfaces that glow: an overcast sky was added"


def load(
    source: Any,
    *,
    environment: Environment | str | Path | None = None,
    lights: Sequence[Light] = (),
    max_memory: int = MAX_MEMORY,
    strict: bool = False,
    point_size: float | None = None,
    time: float | None = None,
) -> Scene:
    """Load a scene from a built-in name ("cornell"), a .glb, .gltf, .obj, .ply, .stl, .off or .usd* file, or objects.

    Objects are a trimesh mesh or scene, a pair of arrays (vertices, faces), a Mesh, or a Scene, which is copied but
    shares its instances. `environment` replaces the scene's; it is an Environment, or what `load_environment` takes.
    `lights` are added to the scene's own. A scene that then has no source of light (see `glows_only`) gets an
    overcast sky, and one without a camera an automatic view. `Scene.notes` says so, and what was approximated;
    each note is also a GiWarning, except that on the camera. A bare name is a built-in scene, even if a file has that
    name; files need their extension. A damaged part of a file is left out with a note, or raises GiError if `strict`.
    Points without faces are shown as discs or spheres of the diameter `point_size` in metres, by default twice their
    spacing. USD files are shown at the time code `time`, by default at their start.

    Raises GiError for unknown names and extensions, with a list of the known ones, for missing, empty and truncated
    files and those with nothing to show, for objects of other types, and for a file that unpacks to more than
    `max_memory` bytes (decoded textures, decompressed geometry).
    """
    scene = read_scene(
        source,
        environment=environment,
        lights=lights,
        max_memory=max_memory,
        strict=strict,
        point_size=point_size,
        time=time,
    )
    warn_of(with_remedies(note for note in scene.notes if note != NO_CAMERA_NOTE), stacklevel=2)
    return scene


def read_scene(
    source: Any,
    *,
    environment: Environment | str | Path | None = None,
    lights: Sequence[Light] = (),
    max_memory: int = MAX_MEMORY,
    strict: bool = False,
    point_size: float | None = None,
    time: float | None = None,
) -> Scene:
    """Load a scene as `load` does, without warnings: only `Scene.notes` says what was assumed."""
    if not is_whole(max_memory) or max_memory < 1:
        raise GiError(f"max_memory must be a whole number of bytes above 0, not {shown(max_memory)}")
    if not isinstance(lights, (list, tuple)):
        raise GiError(f"lights must be a list of lights, not {shown(lights)}")
    notes = Notes(strict)
    is_gltf = isinstance(source, (str, os.PathLike)) and Path(source).suffix.lower() in GLTF_EXTENSIONS
    if isinstance(source, (str, os.PathLike)):
        scene = _load_path(source, MemoryBudget(max_memory), notes, point_size, time)
    else:
        scene = scene_of_object(source, notes, MemoryBudget(max_memory), point_size)
    if environment is not None:
        scene.environment, found = _environment(environment, max_memory, strict)
        scene.notes.extend(found)
    scene.lights.extend(lights)
    check_scene(scene)
    add_defaults(scene, glow=is_gltf and glows_only(scene))
    return scene


def _load_path(
    source: str | os.PathLike[str], budget: MemoryBudget, notes: Notes, point_size: float | None, time: float | None
) -> Scene:
    """Load a built-in scene or a file."""
    path = Path(source)
    extension = path.suffix.lower()
    if str(source) in BUILTIN_SCENES:
        return builtin_scene(str(source))
    if extension in GLTF_EXTENSIONS:
        from .gltf.load import load_gltf

        return load_gltf(path, budget, notes, point_size)
    if extension in MESH_EXTENSIONS:
        return load_mesh_file(path, budget, notes, point_size)
    if extension in USD_EXTENSIONS:
        from .usd.load import load_usd

        return load_usd(path, budget, notes, time)
    raise _unknown(path)


def _environment(environment: Any, max_memory: int, strict: bool) -> tuple[Environment, list[str]]:
    """Return an environment from an object, a file or a text, and the notes on it."""
    if isinstance(environment, Environment):
        return environment, []
    if not isinstance(environment, (str, os.PathLike)):
        raise GiError(f"environment must be an Environment or the path of an image, not {shown(environment)}")
    notes = Notes(strict)
    return load_environment(Path(environment), notes, max_memory=max_memory), notes.sentences


def is_usd(source: object) -> bool:
    """Tell whether `load` would read a USD file, which is shown at a time code."""
    return isinstance(source, (str, os.PathLike)) and Path(source).suffix.lower() in USD_EXTENSIONS


def lit(
    source: Any, environment: Environment | str | Path | None = None, time: float | None = None
) -> tuple[Scene, list[str]]:
    """Return a scene with light to render, and the notes that its user has not seen.

    A Scene with light is returned itself, so that later changes show; one without is copied. See `load`.
    """
    known: list[str] = []
    if isinstance(source, Scene):
        check_scene(source)
        known = source.notes
        if environment is None and has_light(source):
            return source, []
    scene = read_scene(source, environment=environment, time=time)
    return scene, with_remedies(note for note in scene.notes if note not in known and note != NO_CAMERA_NOTE)


def with_remedies(notes: Iterable[str]) -> list[str]:
    """Return notes with what a Python program can do about them."""
    return [
        f"{note} (environment= or lights= set others)" if note in (NO_LIGHT_NOTE, GLOW_NOTE) else note for note in notes
    ]


def _unknown(path: Path) -> GiError:
    """Return the reason why `path` is not a scene: a folder, missing, empty, a mistyped name or an unknown format."""
    formats = " ".join((*GLTF_EXTENSIONS, *MESH_EXTENSIONS, *USD_EXTENSIONS))
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


def glows_only(scene: Scene) -> bool:
    """Tell whether the scene's only light is emission of the kind that decorates glTF files: displays, labels, coals.

    Programs that show glTF files add a sky, so their authors count on one. A lamp emits more than 1
    (KHR_materials_emissive_strength), or 1 from a surface without a texture, since older exporters limit it to that.
    """
    emitters = [(max(m.emission), m.emission_texture is not None) for m in scene.materials if max(m.emission) > 0]
    lamps = [radiance for radiance, textured in emitters if radiance > 1 or (radiance == 1 and not textured)]
    return bool(emitters) and not (lamps or scene.lights or scene.environment is not None)


def add_defaults(scene: Scene, glow: bool = False) -> None:
    """Add an overcast sky to a scene without light, or with a glow only, and an automatic view if it has no camera."""
    if glow or not has_light(scene):
        scene.environment = default_sky()
        scene.notes.append(GLOW_NOTE if glow else NO_LIGHT_NOTE)
    if not scene.cameras:
        scene.cameras.append(automatic_camera(scene))
        scene.notes.append(NO_CAMERA_NOTE)


def lit_at(
    scene: Any, environment: Environment | str | Path | None, time: float | None, animation: str | int | None
) -> tuple[Scene, float | None, list[str]]:
    """Return a scene with light, the seconds at which to show its animation, and notes; see `lit` and `Renderer`."""
    check_time(time)
    usd = is_usd(scene)
    lighted, notes = lit(scene, environment, time if usd else None)
    seconds = start_of(lighted, None if usd else time, animation)
    return lighted, seconds, [*notes, *outside(lighted, seconds, animation)]
