"""The frames of one candidate at full size: rendered one by one, timed, and what they tell about the candidate."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from ..options import Settings, technique_of
from ..pictures.noise import expected_relmse, without_noise
from ..renderer import Renderer
from .front import LEAST_NOISE, Candidate, Figures, averages_samples
from .traced import Lognormal, TracedPixels, noise_doubt

SHOW, INDIRECT = ("radiance", "standard_error"), "indirect"
# A run of the path tracer takes as many samples as fit into these seconds and this share of the time.
RUN_SECONDS, RUN_SHARE, MOST_PER_RUN = 0.25, 0.02, 16
REVIEWED = 3  # steps after which their time and their noise are known
CHECK_GROWTH = 1.5  # frames from one check of the error to the next
# From so many frames on, standard errors are exact enough to take the noise off. In a generated room (textured-12), 3
# frames told 30 times the actual noise, and 0.5 s went to direct light, with 4.5 times the error of the best.
ENOUGH_FRAMES = 8
# What standard errors tell of the noise is in doubt by so many times what they tell of a floor: in 12 scenes, the
# logarithm of expected over actual noise of many-light had standard deviations of 1.0, 0.8, 0.7 from 2, 16, 41 frames.
TOLD_DOUBT, MOST_DOUBT = 2.0, 1.0
RECENT = 9  # steps whose median predicts the next

_rendered: WeakKeyDictionary[Any, set[Candidate]] = WeakKeyDictionary()  # candidates with pipelines, by device


def rendered(renderer: Renderer) -> set[Candidate]:
    """Return the candidates that this process has rendered on the renderer's device; add to it what is rendered."""
    return _rendered.setdefault(renderer.graph.device, set())


def shown(candidate: Candidate, show: tuple[str, ...], *, has_rivals: bool) -> tuple[str, ...]:
    """Return the buffers that a picture of a candidate shows; has_rivals: other qualities may take over."""
    return show if not has_rivals or averages_samples(candidate) else (*dict.fromkeys((*show, INDIRECT)),)


def run_frame(
    renderer: Renderer,
    clock: Callable[[], float],
    show: tuple[str, ...] = SHOW,
    progress: Callable[[float], None] | None = None,
) -> tuple[bool, float]:
    """Render a frame to its end; return whether there was one to render, and the seconds it took."""
    begun = clock()
    more = renderer.step(progress, show=show)
    renderer.graph.device.wait()
    return more, clock() - begun


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
        *,
        has_rivals: bool,
    ) -> None:
        """Give the renderer the settings. figures: what is expected of the candidate. seconds: of the whole budget.

        has_rivals: other qualities of the technique may take over.
        """
        self.candidate, self.settings, self.frames = candidate, settings, 0
        self._renderer, self._clock, self._show = renderer, clock, show
        self._show = shown(candidate, show, has_rivals=has_rivals)
        # The means after each of the first frames, of the picture and of its indirect light, (h, w, 3).
        self._layers = (SHOW[0], INDIRECT) if INDIRECT in self._show else ()
        self._first_means: list[list[NDArray[np.float64]]] = []
        self._pixels = renderer.size[0] * renderer.size[1]
        self._expected = figures
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
        if self._layers and self.frames == len(self._first_means) + 1 <= REVIEWED:
            self._first_means.append([np.asarray(self._renderer.read_back(n), np.float64) for n in self._layers])
        return True

    def correct(self, floor: float, spread: float) -> None:
        """Take a floor that was found otherwise, with the spread of its logarithm, and make a review due."""
        self._expected = replace(self._expected, floor=floor, floor_spread=spread)
        self._review_at = 0

    def read(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the picture so far and its standard error, (h, w, 3) each."""
        picture, deviation = (np.asarray(self._renderer.read_back(name), np.float64) for name in SHOW)
        return picture, deviation

    def learn(self, traced: TracedPixels | None) -> Figures:
        """Return the candidate's figures: those expected, corrected by the frames so far and by traced pixels."""
        figures = self._timed()
        if self.frames < 2:
            return figures
        picture, deviation = self.read()
        noise = Lognormal(figures.noise, figures.noise_spread)
        if averages_samples(self.candidate) and traced is not None:
            noise = traced.path_noise(picture, deviation)
            return replace(figures, noise=noise.median, noise_spread=noise.spread, measured=True)
        # The noise.
        doubt, measured = noise_doubt(self.frames), None if traced is None else traced.compare(picture, deviation)
        told = self._noise(picture, deviation) * self.frames
        if math.isfinite(told):
            noise = noise.times(Lognormal(max(told, LEAST_NOISE), min(TOLD_DOUBT * doubt, MOST_DOUBT)))
        figures = replace(figures, noise=noise.median, noise_spread=noise.spread, measured=True)
        if len(self._first_means) == REVIEWED:
            figures = replace(figures, shared=shared_noise(self._first_means))
        # The floor: what the noise does not explain, which few frames do not tell.
        if measured is not None and not averages_samples(self.candidate):
            error = math.hypot(measured.error, doubt * max(measured.total, measured.noise))
            floor = Lognormal(figures.floor, figures.floor_spread).measured(measured.total - measured.noise, error)
            figures = replace(figures, floor=floor.median, floor_spread=floor.spread)
        return figures

    def _noise(self, picture: NDArray[np.float64], deviation: NDArray[np.float64]) -> float:
        """Return the relMSE that the noise of the frames so far causes.

        With its noise in its own denominator, a bright dot counts too little. With the noise taken off, the edge of a
        lamp counts too much, and so did one pixel of the Cornell box: 25 times the actual noise of the picture. Of
        many-light, the geometric mean of both has the least largest error, of the path tracer the second.
        """
        told = expected_relmse(picture, deviation)
        if self.frames < ENOUGH_FRAMES:
            return told
        clean = expected_relmse(without_noise(picture, deviation), deviation)
        return clean if averages_samples(self.candidate) else math.sqrt(told * clean)

    def _timed(self) -> Figures:
        """Return the figures expected before the first frame, with the seconds of the frames so far."""
        figures, frame, start = self._expected, float(np.median(self._seconds[-RECENT:])), self._start()
        scale = frame / max(figures.frame_seconds(self._pixels), 1e-9)
        return replace(
            figures,
            cold=figures.cold if self._was_warm or not self._steps else start,
            warm=start if self._was_warm and self._steps else figures.warm,
            fixed=figures.fixed * scale,
            per_pixel=figures.per_pixel * scale,
        )


def shared_noise(means: list[list[NDArray[np.float64]]]) -> float:
    """Return the share of the noise of a frame that all qualities have: that of all but indirect light.

    means: of a picture and its indirect light, after each of the first frames, (h, w, 3) each.
    """
    sums = [np.stack([k * mean for k, mean in enumerate(part, 1)]) for part in zip(*means, strict=True)]
    frames, indirect = (np.diff(part, axis=0, prepend=np.zeros_like(part[:1])) for part in sums)
    mean = frames.mean(0)
    weights = 1.0 / np.maximum(mean**2 + 0.01 * mean.mean() ** 2, np.finfo(np.float32).tiny)
    own, others = (float((part.var(0, ddof=1) * weights).mean()) for part in (indirect, frames - indirect))
    return others / (own + others) if own + others > 0 else 0.0


def words_of(candidate: Candidate, frames: int) -> str:
    """Return a candidate and a number of its frames, in words."""
    unit = "sample{} per pixel" if averages_samples(candidate) else "frame{}"
    return f"{candidate}: {frames} {unit.format('' if frames == 1 else 's')}"
