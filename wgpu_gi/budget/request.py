"""What a caller asks for: a budget of time and error, and the time in the animation that a picture shows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from ..buffers import COMMON
from ..errors import GiError
from ..renderer import Renderer
from ..scene.load import is_usd, lit, lit_at
from ..scene.pose import check_time
from ..scene.scene import Environment, Scene
from .amounts import checked_error, checked_seconds, seconds_of
from .outcome import Outcome
from .refine import render_within


class Budget(NamedTuple):
    """What a picture may take, and the relMSE it must reach: whichever comes first ends it."""

    seconds: float | None
    error: float | None

    def words(self) -> str:
        """Return the budget as arguments of the command line."""
        time = [] if self.seconds is None else [f"--time {self.seconds:g}s"]
        return " ".join([*time, *([] if self.error is None else [f"--error {self.error:g}"])])


class Asked(NamedTuple):
    """A scene with light, the time in its animation, and a budget, None for the picture that the settings describe.

    `notes` are sentences on the scene. With `is_fixed`, the settings name the technique. `quality`: whose presets the
    settings have; None: any, if there is a budget.
    """

    scene: Scene
    at: float | None
    animation: str | int | None
    budget: Budget | None
    notes: list[str]
    is_fixed: bool
    quality: str | None

    def run(
        self, renderer: Renderer, progress: Callable[[float], None] | None, show: tuple[str, ...]
    ) -> Outcome | None:
        """Render the picture with the buffers `show`; return what became of the budget, None without one."""
        renderer.time, renderer.animation = self.at, self.animation
        if self.budget is None:
            renderer.run(progress, show=show)
            return None

        def report(fraction: float, _: str) -> None:
            if progress is not None:
                progress(fraction)

        techniques = (renderer.settings.gi,) if self.is_fixed else None
        return render_within(renderer, *self.budget, techniques, report, quality=self.quality, show=show)


def asked_of(
    scene: Any,
    environment: Environment | str | Path | None,
    amounts: tuple[float | str | None, float | None, float | None],
    animation: str | int | None,
    names: Sequence[str],
    is_fixed: bool,
    quality: str | None,
) -> Asked:
    """Load the scene, and read `amounts`: time, error, and the time in the animation; see `gi.render`.

    `names` are the buffers to show. Raises GiError for wrong amounts, and for a buffer that only some techniques have
    if none is fixed.
    """
    time, error, at = amounts
    notes: list[str] = []
    least = None if error is None else checked_error(error)
    seconds = _seconds_of_text(time) if isinstance(time, str) else None
    number = None if isinstance(time, str) else time
    check_time(number)
    check_time(at)
    if number is not None and at is None:
        # A number is a time in the animation if the scene has one.
        animated = is_usd(scene) or animation is not None
        if not animated:
            scene, notes = lit(scene, environment)
            environment, animated = None, bool(scene.animations)
        at, number = (number, None) if animated else (None, number)
    if number is not None:
        seconds = checked_seconds(number)
    lighted, at, more = lit_at(scene, environment, at, animation)
    budget = None if seconds is None and least is None else Budget(seconds, least)
    for name in names if budget is not None and not is_fixed else ():
        if name not in COMMON:
            raise GiError(f"only some techniques have a buffer {name!r}; name one by gi, or leave out time and error")
    return Asked(lighted, at, animation, budget, [*notes, *more], is_fixed, quality)


def _seconds_of_text(text: str) -> float:
    """Return the seconds of a budget. Raises GiError for a text without a unit."""
    seconds = seconds_of(text)
    if seconds is None:
        raise GiError(f"time {text!r} has no unit; write {text + 's'!r}, or a number instead of text")
    return seconds
