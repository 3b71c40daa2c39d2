"""The playback of a session: the animation that plays, its speed, and the clock that sets the renderer's time."""

from __future__ import annotations

import time
from collections.abc import Callable

from ..renderer import Renderer
from ..scene.pose import index_of, looped, selectors

SPEEDS = 0.1, 4.0  # least and most
LONGEST_STEP = 0.5  # seconds between two frames at most: while shaders compile, the animation waits


class Playback:
    """Plays the animations of a renderer's scene. Until one is chosen, played or sought, the scene is at rest."""

    def __init__(self, renderer: Renderer, moved: Callable[[], None]) -> None:
        """`moved` is called after each change of the pose."""
        self._renderer, self._moved = renderer, moved
        self.playing = False
        self.speed = 1.0
        self.loop = True
        self._ticked = 0.0  # when the clock was read last

    @property
    def names(self) -> tuple[str, ...]:
        """The animations of the scene, as `--animation` takes them."""
        return selectors(self._renderer.scene)

    @property
    def name(self) -> str:
        """The chosen animation, one of `names`; empty if there is none."""
        return self.names[index_of(self._renderer.scene, self._renderer.animation)] if self.names else ""

    @property
    def duration(self) -> float:
        """Seconds that the chosen animation lasts."""
        scene = self._renderer.scene
        return scene.animations[index_of(scene, self._renderer.animation)].duration if scene.animations else 0.0

    @property
    def time(self) -> float:
        """Seconds from the start of the animation."""
        return min(max(self._renderer.time or 0.0, 0.0), self.duration)

    def choose(self, name: str) -> None:
        """Choose an animation, and go to its start."""
        self._renderer.animation = name
        self.seek(0.0)

    def seek(self, seconds: float) -> None:
        """Go to a time."""
        self._renderer.time = seconds
        self._moved()

    def toggle(self) -> None:
        """Play or pause; at the end, play from the start."""
        self.playing = not self.playing and self.duration > 0
        self._ticked = time.monotonic()
        if self.playing and not self.loop and self.time >= self.duration:
            self.seek(0.0)
        self._moved()

    def tick(self) -> None:
        """Advance by the time since the last tick, if it plays."""
        if not self.playing:
            return
        now = time.monotonic()
        passed, self._ticked = min(now - self._ticked, LONGEST_STEP), now
        seconds = self.time + passed * self.speed
        if seconds >= self.duration and not self.loop:
            self.playing, seconds = False, self.duration
        else:
            seconds = looped(seconds, self.duration)
        self.seek(seconds)
