"""The exposure meter: updates the automatic exposure of a view at rest, and keeps it while the view moves."""

from __future__ import annotations

from ..pictures.exposure import automatic_exposure
from ..renderer import Renderer

TOLERANCE = 1 / 3  # EV: a smaller change is not worth a jump; the step of a camera's dial
STRIDE = 2  # every second pixel of every second row is measured


class ExposureMeter:
    """Sets `automatic_exposure` of a renderer."""

    def __init__(self, renderer: Renderer) -> None:
        self._renderer = renderer
        self._following = True  # measures after the last move, until its picture is complete
        self.started = False  # measured at least once
        self._still = 0  # steps at rest since the last move

    def moved(self) -> None:
        """Record that camera or lights moved. Other changes, such as a new technique, keep the exposure."""
        self._following = True

    def restart(self) -> None:
        """Measure at the next step in any case."""
        self._following, self.started = True, False

    def measure(self, ran: bool, moving: bool) -> bool:
        """Measure after a step if the exposure may change; return whether it did.

        It may change in the first step, and at rest after a move in steps 1, 2, 4, 8 ... as the noise falls. A step
        with nothing to do (not `ran`) ends this: the picture is complete.
        """
        renderer = self._renderer
        self._still = 0 if moving else self._still + 1
        if renderer.settings.exposure is not None or not self._following:
            return False
        if self.started and (moving or (ran and self._still & (self._still - 1))):
            return False
        self._following = ran
        before, measured = renderer.exposure, automatic_exposure(renderer.read_back()[::STRIDE, ::STRIDE])
        if self.started and abs(measured - before) <= TOLERANCE:
            return False
        renderer.automatic_exposure, self.started = measured, True
        return measured != before
