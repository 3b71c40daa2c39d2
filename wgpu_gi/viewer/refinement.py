"""How far a view at rest is refined: to the frames of its settings, or until its noise or its time meets a budget.

The error of a budget is compared with the noise, the relMSE that `standard_error` predicts. The bias of the technique
is not in it; a certificate measures both.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from ..budget.front import OPEN_SPP
from ..options import Settings, technique_of
from ..pictures.noise import expected_relmse, without_noise
from ..renderer import Renderer
from ..techniques.shared.sampling import OPEN_FRAMES

NEEDS = ("radiance", "standard_error")
LEAST_FRAMES = 8  # frames or samples that `without_noise` needs
GROWTH = 1.25  # of the frames from one measurement of the noise to the next: reading back costs time


class Refinement:
    """Tells when a view at rest is done. `noise` is the last measured relMSE of its noise, None before the first."""

    def __init__(self, seconds: float | None = None, error: float | None = None) -> None:
        """Refine for at most `seconds` at rest, and until the noise is at most `error`; None: no limit."""
        self.seconds, self.error = seconds, error
        self.noise: float | None = None
        self._finished, self._begun, self._measure_at = 0, 0.0, float(LEAST_FRAMES)

    @property
    def is_open(self) -> bool:
        """True if the budget decides on the number of frames, not the settings."""
        return self.seconds is not None or self.error is not None

    @property
    def needs(self) -> tuple[str, ...]:
        """The buffers that steps at rest must compute."""
        return () if self.error is None else NEEDS

    @contextmanager
    def opened(self, settings: Settings) -> Iterator[None]:
        """Leave the number of frames and samples open during a step."""
        if not self.is_open:
            yield
            return
        camera, own = settings.camera, (settings.camera.frames, settings.spp)
        camera.frames, settings.spp = OPEN_FRAMES, OPEN_SPP
        try:
            yield
        finally:
            camera.frames, settings.spp = own

    def is_met(self, renderer: Renderer) -> bool:
        """Return whether the picture of the renderer's last step, at rest, meets the budget."""
        done, before = renderer.finished, self._finished
        self._finished = done
        if done <= before or before == 0:
            self.noise, self._begun, self._measure_at = None, time.monotonic(), float(LEAST_FRAMES)
        if self.seconds is not None and time.monotonic() - self._begun >= self.seconds:
            return True
        if self.error is None or done < self._measure_at:
            return False
        self._measure_at = GROWTH * done
        picture, deviation = (np.asarray(renderer.read_back(name), np.float64) for name in NEEDS)
        self.noise = expected_relmse(without_noise(picture, deviation), deviation)
        return self.noise <= self.error

    def words(self, renderer: Renderer) -> str:
        """Return how far the picture is refined."""
        unit = "spp" if technique_of(renderer.settings.gi).averages_samples else "frames"
        noise = "" if self.noise is None else f", noise {self.noise:.2g}"
        return f"{renderer.finished} {unit}{noise}"
