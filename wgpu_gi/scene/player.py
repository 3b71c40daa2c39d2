"""Shows a scene at the times of one of its animations."""

from __future__ import annotations

from copy import copy

from ..camera import Camera
from .animation import Animation, chosen_animation
from .posing import Posing
from .scene import Scene


def find_animation(scene: Scene, animation: str | int | None = None) -> Animation:
    """Return an animation of a scene by its name or its index, also as a text; None is the first.

    Raises GiError if the scene has no animation, or not that one.
    """
    return chosen_animation(scene.animations, animation)


class Player:
    """A posed copy of a scene, `scene`, which shares with its `source` all that the `animation` does not drive.

    The copies of driven parts are made once, so that they keep their identity. Raises GiError for an unknown animation.
    """

    def __init__(self, scene: Scene, animation: str | int | None = None) -> None:
        self.source = scene
        self.animation = find_animation(scene, animation)
        self.scene = copy(scene)
        self._posing = Posing(self.animation)

    def pose(self, time: float) -> None:
        """Show a time in seconds, limited to [0, duration], after taking over what changed in the source."""
        self._posing.take_over(self.source, self.scene)
        self._posing.write(min(max(time, 0.0), self.animation.duration))

    def posed(self, camera: Camera) -> Camera:
        """Return the camera that stands for one of the source: its driven copy, or itself."""
        found: Camera = self._posing.copy_of(camera)
        return found
