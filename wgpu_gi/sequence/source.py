"""Where a scene comes from, and what is changed in it: all that another process needs to load the same."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..scene.files.environment_files import load_environment
from ..scene.files.light_texts import parse_light, relight
from ..scene.files.memory import MAX_MEMORY
from ..scene.files.notes import Notes
from ..scene.load import read_scene
from ..scene.scene import Environment, Scene


@dataclass(frozen=True)
class SceneSource:
    """A scene as `load` takes it, with an environment, and lights in command-line syntax: to add, and to change.

    `time` is the time code of a USD file, or the seconds that hold an animation, None if it may play.
    """

    scene: Any
    environment: Environment | str | Path | None = None
    lights: tuple[str, ...] = ()
    relight: tuple[str, ...] = ()
    max_memory: int = MAX_MEMORY
    strict: bool = False
    point_size: float | None = None
    time: float | None = None

    def load(self) -> Scene:
        """Load the scene. Raises GiError for one that cannot be read, and for wrong lights."""
        return load_scene(
            self.scene,
            self.environment,
            self.lights,
            self.relight,
            self.max_memory,
            self.strict,
            self.point_size,
            self.time,
        )


def load_scene(
    source: Any,
    env: Environment | str | Path | None,
    lights: Sequence[str],
    changes: Sequence[str],
    max_memory: int = MAX_MEMORY,
    strict: bool = False,
    point_size: float | None = None,
    time: float | None = None,
) -> Scene:
    """Load a scene, set its environment, add `lights` and apply `changes` to lights; all in command-line syntax."""
    notes = Notes(strict)
    added = [parse_light(text) for text in lights]
    environment = load_environment(env, notes, max_memory=max_memory) if isinstance(env, str | Path) else env
    scene = read_scene(
        source,
        environment=environment,
        lights=added,
        max_memory=max_memory,
        strict=strict,
        point_size=point_size,
        time=time,
    )
    scene.notes.extend(notes.sentences)
    for text in changes:
        relight(scene, text)
    return scene
