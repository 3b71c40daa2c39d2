"""The pose of a Renderer: its scene and its camera at a time of an animation."""

from __future__ import annotations

import math

from ..camera import Camera
from ..errors import GiError
from .player import Player, find_animation
from .rules import number, optional, shown
from .scene import Scene

TIME = optional(number(unit="of seconds"))


def check_time(time: object) -> None:
    """Raise GiError for a time that is neither None nor a finite number."""
    if not TIME.allows(time):
        raise GiError(f"time must be {TIME.words}, not {shown(time)}")


def selectors(scene: Scene) -> tuple[str, ...]:
    """Return for each animation what selects it: its name, or its index if the name is empty or not the only one."""
    names = [animation.name for animation in scene.animations]
    return tuple(name if name and names.count(name) == 1 else str(i) for i, name in enumerate(names))


def index_of(scene: Scene, animation: str | int | None) -> int:
    """Return the index of an animation in the scene. Raises GiError if the scene does not have it."""
    return scene.animations.index(find_animation(scene, animation))


def start_of(scene: Scene, time: float | None, animation: str | int | None) -> float | None:
    """Return the time at which to show a scene: that given, else the start of a given animation, else None.

    Raises GiError for an animation that the scene does not have.
    """
    if time is None and animation is None:
        return None
    find_animation(scene, animation)
    return 0.0 if time is None else time


def outside(scene: Scene, time: float | None, animation: str | int | None) -> list[str]:
    """Return a sentence if the animation does not last until `time`, or starts later."""
    if time is None:
        return []
    found = find_animation(scene, animation)
    if 0 <= time <= found.duration:
        return []
    end = "first" if time < 0 else "last"
    return [f"the animation {found.name!r} lasts from 0 to {found.duration:.4g} s, so {time:g} s shows its {end} pose"]


def looped(time: float, duration: float) -> float:
    """Return the time in an animation that starts again at its end."""
    return math.fmod(time, duration) if duration > 0 else 0.0


class Pose:
    """Poses scenes. It keeps the Player of the last scene: instances must stay the same objects to have motion."""

    def __init__(self) -> None:
        self._player: Player | None = None

    def at(self, scene: Scene, camera: Camera, time: float | None, animation: str | int | None) -> tuple[Scene, Camera]:
        """Return the posed scene and the camera in it: both as they are if `time` is None.

        Raises GiError for a wrong time, and for an animation that the scene does not have.
        """
        check_time(time)
        found = None if time is None and animation is None else find_animation(scene, animation)
        if time is None or found is None:
            self._player = None
            return scene, camera
        player = self._player
        if player is None or player.source is not scene or player.animation is not found:
            self._player = player = Player(scene, animation)
        player.pose(time)
        return player.scene, player.posed(camera)
