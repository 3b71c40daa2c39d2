"""Measures candidates of a budget in small pictures of the same view: seconds, noise, and distance to traced pixels.

Two sizes tell the fixed cost of a frame from the cost per pixel. The noise is that of `standard_error`. The floor is
the squared distance to path-traced pixels less the noise of both; all candidates are compared at the same pixels.

Departures: errors of a small picture stand for those of the large one, though filters and searches in screen space
reach farther in it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from ..options import Settings, technique_of
from ..pictures.noise import without_noise
from ..pixel_tracer import PixelTruth
from ..renderer import Renderer
from .front import LEAST_FLOOR, LEAST_NOISE, Candidate, Figures

SHOW = ("radiance", "standard_error")
# A probe has a sixteenth of the pixels, or as many as take no longer than the fixed cost of a frame.
SHARE, LEAST_PIXELS, MOST_PIXELS = 1 / 16, 15000, 30000
FLOOR_SPREAD = 1.1  # of the logarithm of a floor about the expected one: a factor of 3
FRAMES = 4  # of a probe: with fewer, the standard error is a guess
# The relative error of the noise that so few frames tell. In a generated street they told 0.54 of it, and the rest
# passed for a floor of 0.014 where the actual one is below 0.001. Standard errors of 8 frames and more are within 1.25.
NOISE_DOUBT = 0.5
# Traced pixels, and their paths in the first round: replicates of so many paths.
FEW_TRACED, MOST_TRACED, REPLICATES, PATHS, MOST_PATHS = 128, 2048, 8, 2, 1024
SEED = 0x7072_6F62  # none that a user would choose: pictures must not share the noise of the traced pixels

_rendered: WeakKeyDictionary[Any, set[Candidate]] = WeakKeyDictionary()  # candidates with pipelines, by device


def rendered(renderer: Renderer) -> set[Candidate]:
    """Return the candidates that this process has rendered on the renderer's device; add to it what is rendered."""
    return _rendered.setdefault(renderer.graph.device, set())


def probe_sizes(size: tuple[int, int]) -> tuple[tuple[int, int], tuple[int, int]]:
    """Return the sizes (width, height) of the smaller and the larger picture of a probe."""
    pixels = size[0] * size[1]
    wanted = min(max(pixels * SHARE, LEAST_PIXELS), MOST_PIXELS, pixels)
    return _scaled(size, wanted / 4), _scaled(size, wanted)


def _scaled(size: tuple[int, int], pixels: float) -> tuple[int, int]:
    scale = math.sqrt(pixels / (size[0] * size[1]))
    return max(round(size[0] * scale), 1), max(round(size[1] * scale), 1)


def probe_seconds(figures: Figures, size: tuple[int, int], *, is_warm: bool) -> float:
    """Return the seconds that a probe of a picture of `size` is expected to take."""
    small, large = (figures.frame_seconds(w * h) for w, h in probe_sizes(size))
    return (figures.warm if is_warm else figures.cold) + 2 * small + figures.warm + FRAMES * large


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


def likely_floor(expected: float, measured: float, error: float) -> float:
    """Return the most likely floor, if its logarithm is known to FLOOR_SPREAD and a measurement has normal errors.

    So a measurement much more exact than the floor decides, and one that cannot tell leaves the expectation.
    """
    tried = np.geomspace(LEAST_FLOOR, max(expected, measured + 3 * error, 2 * LEAST_FLOOR), 400)
    misfit = (np.log(tried / expected) / FLOOR_SPREAD) ** 2 + ((tried - measured) / max(error, LEAST_FLOOR)) ** 2
    return float(tried[np.argmin(misfit)])


class Probe:
    """Measures candidates in the renderer's view; leaves its settings and size changed."""

    def __init__(self, renderer: Renderer, clock: Callable[[], float]) -> None:
        self._renderer, self._clock = renderer, clock
        self._sizes = probe_sizes(renderer.size)
        self._truth: _Traced | None = None

    def measure(self, candidate: Candidate, settings: Settings, expected: Figures, truth_seconds: float) -> Figures:
        """Return the figures of a candidate. The first call traces pixels for about `truth_seconds`."""
        renderer, clock = self._renderer, self._clock
        renderer.settings = settings
        # Time: the first frame at the smaller size compiles and uploads; the second has the cost of that size.
        was_warm = candidate in rendered(renderer)
        ahead = technique_of(settings.gi).warm_up(settings)
        renderer.size = self._sizes[0]
        first = sum(run_frame(renderer, clock)[1] for _ in range(ahead + 1))
        rendered(renderer).add(candidate)
        more, small = run_frame(renderer, clock)
        renderer.size = self._sizes[1]
        runs = [run_frame(renderer, clock) for _ in range(ahead + FRAMES)]
        seconds = [spent for _, spent in runs]
        # A picture without noise has one frame.
        large = min([spent for ran, spent in runs[ahead + 1 :] if ran] or [seconds[ahead]])
        small = min(small, large) if more else large * self._share
        pixels = [w * h for w, h in self._sizes]
        per_pixel = (large - small) / max(pixels[1] - pixels[0], 1)
        # Errors.
        picture = np.asarray(renderer.read_back("radiance"), np.float64)
        deviation = np.asarray(renderer.read_back("standard_error"), np.float64)
        if self._truth is None:
            self._truth = _Traced(renderer, without_noise(picture, deviation), clock, truth_seconds)
        if technique_of(settings.gi).averages_samples:
            noise, floor = self._truth.noise(), LEAST_FLOOR
        else:
            noise, rest, error = self._truth.compare(picture, deviation)
            noise, floor = noise * FRAMES if more else 0.0, likely_floor(expected.floor, rest, error)
        return Figures(
            cold=expected.cold if was_warm else max(first - small, 0.0),
            warm=max(sum(seconds[: ahead + 1]) - large, 0.0),
            fixed=max(large - per_pixel * pixels[1], 0.0),
            per_pixel=per_pixel,
            noise=max(noise, LEAST_NOISE),
            floor=floor,
            measured=True,
        )

    @property
    def _share(self) -> float:
        (w, h), (width, height) = self._sizes
        return w * h / (width * height)


class _Traced:
    """Path-traced pixels of the picture that the renderer has rendered, with the weights of relMSE."""

    def __init__(self, renderer: Renderer, picture: NDArray, clock: Callable[[], float], seconds: float) -> None:
        """Trace random pixels until `seconds` are over; `picture` (h, w, 3) without its noise tells their weights."""
        height, width = picture.shape[:2]
        order = np.random.default_rng(0).permutation(width * height)

        def trace(chosen: NDArray, replicates: int, seed: int) -> PixelTruth:
            pixels = np.stack([chosen % width, chosen // width], 1)
            return renderer.trace_pixels(pixels, replicates * PATHS, seed=seed, replicates=replicates)

        # A few pixels compile the shader, and again they tell the speed; then as many pixels as fit, up to a limit.
        begun = clock()
        few = order[:FEW_TRACED]
        trace(few, REPLICATES, SEED)
        tried = clock()
        trace(few, REPLICATES, SEED)
        now = clock()
        fitting = len(few) * (seconds - (now - begun)) / max(now - tried, 1e-6)
        self._at = order[: int(min(max(fitting, FEW_TRACED), MOST_TRACED))]
        truth = trace(self._at, REPLICATES, SEED)
        # Double their paths as long as that fits.
        last = clock() - now
        while clock() - begun + last < seconds and truth.spp < MOST_PATHS:
            before = clock()
            truth = truth.joined(trace(self._at, truth.replicates.shape[1], SEED + truth.spp))
            last = 2 * (clock() - before)
        self._mean = np.asarray(truth.mean, np.float64)
        self._variance = np.asarray(truth.squared_error, np.float64)
        self._spp = truth.spp
        # Noise of the traced pixels must not choose their weights: pixels that are dark by chance, whose variance is
        # too low by chance, would count most. That added up to 0.04 to floors in the corridor and a glossy room.
        squared = self._values(picture) ** 2 + 0.01 * self._mean.mean() ** 2
        self._weights = 1.0 / np.maximum(squared, np.finfo(np.float32).tiny)

    def _values(self, picture: NDArray) -> NDArray[np.float64]:
        """Return the values of a picture (h, w, 3) at the traced pixels, (n, 3)."""
        values: NDArray[np.float64] = picture.reshape(-1, 3)[self._at]
        return values

    def compare(self, picture: NDArray, deviation: NDArray) -> tuple[float, float, float]:
        """Return the relMSE of a picture's noise, and that of what no frame removes with its standard error.

        picture, deviation: (h, w, 3), the mean of the frames so far and its standard error.
        """
        own = self._values(deviation) ** 2
        squared = (self._values(picture) - self._mean) ** 2
        rest = ((squared - self._variance - own) * self._weights).mean(-1)
        noise = float(np.mean(own * self._weights))
        return noise, float(rest.mean()), math.hypot(float(rest.std()) / math.sqrt(len(rest)), NOISE_DOUBT * noise)

    def noise(self) -> float:
        """Return the relMSE of one sample per pixel of the path tracer."""
        return float(np.mean(self._variance * self._weights)) * self._spp
