"""The frames of one candidate at full size: rendered one by one, timed, and what they tell about the candidate."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..options import Settings, technique_of
from ..pictures.noise import expected_relmse, without_noise
from ..renderer import Renderer
from .front import LEAST_NOISE, Candidate, Figures, averages_samples
from .probe import SHOW, rendered, run_frame

# A run of the path tracer takes as many samples as fit into these seconds and this share of the time.
RUN_SECONDS, RUN_SHARE, MOST_PER_RUN = 0.25, 0.02, 16
REVIEWED = 3  # steps after which their time and their noise are known
CHECK_GROWTH = 1.5  # frames from one check of the error to the next
# From so many frames on, standard errors are exact enough to take the noise off. In a generated room (textured-12), 3
# frames told 30 times the actual noise, and 0.5 s went to direct light, with 4.5 times the error of the best.
ENOUGH_FRAMES = 8
RECENT = 9  # steps whose median predicts the next


class FrameSeries:
    """A still picture of one candidate as it grows; the renderer has it."""

    def __init__(
        self,
        renderer: Renderer,
        clock: Callable[[], float],
        candidate: Candidate,
        settings: Settings,
        figures: Figures,
        seconds: float | None,
        show: tuple[str, ...],
    ) -> None:
        """Give the renderer the settings. figures: what is expected of the candidate. seconds: of the whole budget."""
        self.candidate, self.settings, self.frames = candidate, settings, 0
        self._renderer, self._clock, self._show = renderer, clock, show
        self._pixels = renderer.size[0] * renderer.size[1]
        self._was_warm = candidate in rendered(renderer)
        self._ahead = technique_of(candidate.gi).warm_up(settings)
        self._steps, self._first = 0, 0.0
        self._seconds = [figures.frame_seconds(self._pixels)]
        self._check_at, self._review_at = 1.0, REVIEWED
        self._per_step = 1
        if averages_samples(candidate):
            wanted = RUN_SECONDS if seconds is None else min(RUN_SECONDS, RUN_SHARE * seconds)
            self._per_step = min(max(int(wanted / self._seconds[0]), 1), MOST_PER_RUN)
            settings.path.samples_per_run = self._per_step
        renderer.settings = settings

    @property
    def words(self) -> str:
        """The candidate and the number of its frames, in words."""
        return words_of(self.candidate, self.frames)

    @property
    def step_seconds(self) -> float:
        """Seconds that the next step is expected to take."""
        return float(np.median(self._seconds[-RECENT:])) * self._per_step

    @property
    def start_seconds(self) -> float:
        """Seconds that the first step took longer than the others; 0 if this candidate had its pipelines."""
        return 0.0 if self._was_warm else self._start()

    def _start(self) -> float:
        frame = float(np.median(self._seconds[-RECENT:]))
        return max(self._first - frame * self._per_step, 0.0)

    def is_review_due(self) -> bool:
        """Return whether the first steps are done, or twice as many as at the last review."""
        if self._steps < self._review_at:
            return False
        self._review_at = 2 * self._steps
        return True

    def is_check_due(self) -> bool:
        """Return whether there are half again as many frames as at the last check."""
        if self.frames < self._check_at:
            return False
        self._check_at = self.frames * CHECK_GROWTH
        return True

    def step(self, report: Callable[[float], None]) -> bool:
        """Render a frame, or samples; return whether there was one to render. The first comes after a warm-up."""
        begun = self._clock()
        for _ in range(1 if self._steps else self._ahead + 1):
            more, seconds = run_frame(self._renderer, self._clock, self._show, report)
            if not more:
                return False
        if self._steps:
            recent = self._seconds[-RECENT:] if self._steps > 1 else []
            self._seconds = [*recent, seconds / self._per_step]
        else:
            self._first = self._clock() - begun
            rendered(self._renderer).add(self.candidate)
        self._steps += 1
        # A picture of the same settings goes on.
        self.frames = self._renderer.finished
        return True

    def review(self) -> None:
        """Make a review due."""
        self._review_at = 0

    def learn(self, figures: Figures) -> Figures:
        """Return the candidate's figures, corrected by the frames so far: their time and, from two on, their noise."""
        frame = float(np.median(self._seconds[-RECENT:]))
        scale = frame / max(figures.frame_seconds(self._pixels), 1e-9)
        start = self._start()
        figures = replace(
            figures,
            cold=figures.cold if self._was_warm or not self._steps else start,
            warm=start if self._was_warm and self._steps else figures.warm,
            fixed=figures.fixed * scale,
            per_pixel=figures.per_pixel * scale,
        )
        if self.frames > 1:
            picture, deviation = (np.asarray(self._renderer.read_back(name), np.float64) for name in SHOW)
            if self.frames >= ENOUGH_FRAMES:
                picture = without_noise(picture, deviation)
            noise = expected_relmse(picture, deviation) * self.frames
            figures = replace(figures, noise=max(noise, LEAST_NOISE) if math.isfinite(noise) else figures.noise)
        return figures


def words_of(candidate: Candidate, frames: int) -> str:
    """Return a candidate and a number of its frames, in words."""
    unit = "sample{} per pixel" if averages_samples(candidate) else "frame{}"
    return f"{candidate}: {frames} {unit.format('' if frames == 1 else 's')}"
