"""Makes scenes of Python objects: arrays of vertices and faces, meshes, scenes, and what `trimesh_objects` converts."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ..errors import GiError
from .files.memory import MemoryBudget
from .files.notes import Notes
from .rules import shown
from .scene import Instance, Mesh, Scene


def scene_of_object(source: Any, notes: Notes, budget: MemoryBudget, point_size: float | None = None) -> Scene:
    """Return a new scene of a Scene, a Mesh, a trimesh mesh, cloud or scene, or a pair (vertices, faces).

    A Scene is copied with its lists, but shares the objects in them. Raises GiError for anything else.
    """
    if isinstance(source, Scene):
        lists = ("instances", "lights", "cameras", "notes", "animations")
        for name in lists:
            if not isinstance(getattr(source, name), (list, tuple)):
                raise GiError(f"scene.{name} must be a list, not {shown(getattr(source, name))}")
        lists_of: dict[str, Any] = {name: list(getattr(source, name)) for name in lists}
        return replace(source, **lists_of)
    if isinstance(source, Mesh):
        return Scene([Instance(source)], name=source.name)
    if type(source).__module__.partition(".")[0] == "trimesh":
        from .trimesh_objects import scene_of_trimesh

        return scene_of_trimesh(source, notes, budget, point_size)
    if isinstance(source, (tuple, list)) and len(source) == 2 and not any(isinstance(part, str) for part in source):
        return Scene.from_arrays(source[0], source[1])
    kinds = "a path, a built-in name, a Scene, a Mesh, a trimesh mesh or scene, or a pair of arrays (vertices, faces)"
    raise GiError(f"a scene is {kinds}, not {shown(source)}")
