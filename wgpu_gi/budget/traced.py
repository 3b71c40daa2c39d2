"""Traced pixels of a picture: they tell its relMSE apart from noise and bias, and the noise of the path tracer.

The error of a picture is its squared distance to path-traced pixels less their noise; the picture stays as it is. The
denominators of relMSE must not contain the noise of what is measured: pixels that are bright by chance would count too
little, as a blotch of a few virtual lights (Keller 1997), or those that are dark by chance too much. So half of the
paths gives the denominators, the other half the differences, and both ways are averaged.

Departures: a few hundred pixels stand for the picture, so fireflies may be missed; spreads of per-pixel errors say how
well a mean is known only if it has no rare large parts.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..pixel_tracer import PixelTruth
from ..renderer import Renderer
from .front import LEAST_FLOOR

# Pixels, and their paths in the first round: replicates of so many paths.
FEW, MOST, REPLICATES, PATHS, MOST_PATHS = 128, 512, 8, 2, 4096
SEED = 0x7072_6F62  # none that a user would choose: pictures must not share the noise of the traced pixels
# Share of the pixels whose differences are the largest, which do not count: the edge of a lamp in one of 512 pixels hid
# the floor of many-light in the Cornell box, 0.0003, behind a standard error of 0.006. So floors come out too low where
# few pixels hold the error, in favour of the technique that has begun.
OUTLIERS = 1 / 256
# The noise that standard errors tell, in logarithms: by the number of frames.
NOISE_DOUBTS = ((8, 1.0), (32, 0.5))
LEAST_DOUBT = 0.25


def noise_doubt(frames: int) -> float:
    """Return the standard deviation of the logarithm of a noise that so many frames tell."""
    return next((doubt for below, doubt in NOISE_DOUBTS if frames < below), LEAST_DOUBT)


class Lognormal(NamedTuple):
    """What is known of a positive number: its median, and the standard deviation of its logarithm."""

    median: float
    spread: float

    def times(self, other: Lognormal) -> Lognormal:
        """Return what two independent sources tell together."""
        own, others = (max(x.spread, 1e-3) ** -2 for x in (self, other))
        mean = (own * math.log(self.median) + others * math.log(other.median)) / (own + others)
        return Lognormal(math.exp(mean), (own + others) ** -0.5)

    def measured(self, value: float, error: float) -> Lognormal:
        """Return what is known after a measurement with normal errors of the standard deviation `error`.

        So a measurement much more exact than the number decides, and one that cannot tell leaves the expectation.
        """
        top = max(math.log(self.median) + 4 * self.spread, math.log(max(value + 4 * error, LEAST_FLOOR)))
        logs = np.linspace(math.log(LEAST_FLOOR), top, 600)
        misfit = ((logs - math.log(self.median)) / max(self.spread, 1e-3)) ** 2
        misfit += ((np.exp(logs) - value) / max(error, LEAST_FLOOR)) ** 2
        shares = np.exp(-0.5 * (misfit - misfit.min()))
        shares /= shares.sum()
        mean = float(shares @ logs)
        return Lognormal(math.exp(mean), math.sqrt(float(shares @ (logs - mean) ** 2)))


class Measured(NamedTuple):
    """The relMSE of a picture by its standard errors, `noise`; and all of it, `total`, with its standard error."""

    noise: float
    total: float
    error: float


class TracedPixels:
    """Random pixels of the renderer's picture, path traced for about `seconds`."""

    def __init__(self, renderer: Renderer, clock: Callable[[], float], seconds: float) -> None:
        width, height = renderer.size
        order = np.random.default_rng(0).permutation(width * height)

        def trace(chosen: NDArray, replicates: int, seed: int) -> PixelTruth:
            pixels = np.stack([chosen % width, chosen // width], 1)
            return renderer.trace_pixels(pixels, replicates * PATHS, seed=seed, replicates=replicates)

        # A few pixels compile the shader, and again they tell the speed; then as many pixels as fit, up to a limit.
        begun = clock()
        few = order[:FEW]
        trace(few, REPLICATES, SEED)
        tried = clock()
        trace(few, REPLICATES, SEED)
        now = clock()
        fitting = len(few) * (seconds - (now - begun)) / max(now - tried, 1e-6)
        self._at = order[: int(min(max(fitting, FEW), MOST))]
        truth = trace(self._at, REPLICATES, SEED)
        # Double their paths as long as that fits.
        last = clock() - now
        while clock() - begun + 2 * last < seconds and truth.spp < MOST_PATHS:
            before = clock()
            truth = truth.joined(trace(self._at, truth.replicates.shape[1], SEED + truth.spp))
            last = clock() - before
        self.seconds = clock() - begun
        halves = truth.replicates[:, 0::2], truth.replicates[:, 1::2]
        self._spp = truth.spp
        self._means = [half.mean(1) for half in halves]
        self._variances = [half.var(1, ddof=1) / half.shape[1] for half in halves]

    def _weights(self, half: int, x: NDArray, s: NDArray) -> NDArray[np.float64]:
        """Return the weights of relMSE, from the mean of half of the paths and the picture, by inverse variance."""
        mean, variance = self._means[half], self._variances[half]
        # A pixel whose few paths found no light has no variance by chance: it has at least the average relative one.
        relative = variance.mean() / max(float((mean**2).mean()), np.finfo(np.float64).tiny)
        variance = np.maximum(variance, relative * mean**2)
        share = variance / np.maximum(variance + s**2 + (0.1 * x) ** 2, np.finfo(np.float64).tiny)
        guess = mean + share * (x - mean)
        brightness = 0.5 * (self._means[0] + self._means[1]).mean()
        return 1.0 / np.maximum(guess**2 + 0.01 * brightness**2, np.finfo(np.float32).tiny)

    def compare(self, picture: NDArray, deviation: NDArray) -> Measured:
        """Return the errors of a picture (h, w, 3), the mean of the frames so far, with its standard error."""
        x, s = (values.reshape(-1, 3)[self._at] for values in (picture, deviation))
        noise, squared = np.zeros(len(x)), np.zeros(len(x))
        for half in (0, 1):
            weights = self._weights(half, x, s)
            other = 1 - half
            noise += 0.5 * (s**2 * weights).mean(-1)
            squared += 0.5 * (((x - self._means[other]) ** 2 - self._variances[other]) * weights).mean(-1)
        kept = np.argsort(np.abs(squared))[: -max(round(OUTLIERS * len(x)), 1)]
        noise, squared = noise[kept], squared[kept]
        return Measured(float(noise.mean()), float(squared.mean()), float(squared.std()) / math.sqrt(len(kept)))

    def path_noise(self, picture: NDArray, deviation: NDArray) -> Lognormal:
        """Return the relMSE of one sample per pixel of the path tracer."""
        x, s = (values.reshape(-1, 3)[self._at] for values in (picture, deviation))
        parts = [(self._variances[1 - half] * self._weights(half, x, s)).mean(-1) for half in (0, 1)]
        each = 0.25 * (parts[0] + parts[1]) * self._spp
        mean = max(float(each.mean()), LEAST_FLOOR)
        return Lognormal(mean, math.hypot(LEAST_DOUBT, float(each.std()) / math.sqrt(len(each)) / mean))
