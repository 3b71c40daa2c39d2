"""Certificates: relMSE and bias of a whole picture, with 95 % intervals, from path-traced random pixels.

The truth has all bounces unless the settings limit them, and the settings' jitter, background and materials. relMSE and
bias are those of `measure.metrics`, over all pixels of the radiance, background included. `intervals.py` has the
statistics; `tools/README.md`, how often the intervals hold the truth.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import GiError
from ..pixel_tracer import PixelTruth, check_seed
from ..renderer import Renderer
from ..scene.rules import is_whole, shown
from .intervals import Draw, Estimate, Interval, bias_interval, draw_pixels, error_interval, error_mean, truth_mean

PIXELS = 200  # of a certificate, unless told otherwise
# In five of six pictures of 48x27, relMSE's interval held in 95 to 97 % of 150 draws of 50 pixels, in 84 to 96 % of 24,
# in 33 to 75 % of 4; in the sixth, many-light in a street, whose error is in few pixels, in 53 % of 50 and 87 % of 200.
LEAST_PIXELS, MOST_PIXELS = 50, 1_000_000
# Each replicate of a pixel has so many paths; a first round traces so many replicates. As long as more than NOISE_SHARE
# of an estimate's variance is the tracer's noise, the next round doubles them, up to MOST_REPLICATES.
PATHS, REPLICATES, MOST_REPLICATES = 16, 8, 128
NOISE_SHARE = 0.2
NEGLIGIBLE = {"relmse": 1e-5, "bias": 1e-4}  # standard errors of the noise below which it does not matter either way


@dataclass(frozen=True)
class Certificate:
    """What a picture errs by: `relmse` and `bias` (a fraction), from `pixels` pixels with `samples` paths each."""

    relmse: Interval
    bias: Interval
    pixels: int
    samples: int
    seconds: float

    def sentence(self) -> str:
        """Return the certificate for people."""
        e, b = self.relmse, self.bias
        return (
            f"relMSE {e.value:.3g} (95 %: {e.low:.3g} to {e.high:.3g}), bias {100 * b.value:+.2g} %"
            f" (95 %: {100 * b.low:+.2g} to {100 * b.high:+.2g}), from {self.pixels}"
            f" path-traced pixel{'s' * (self.pixels != 1)} of {self.samples} samples, {self.seconds:.1f} s"
        )

    def texts(self) -> dict[str, str]:
        """Return the certificate for a file's metadata; equal pictures have equal texts, so without the seconds."""
        numbers = {
            f"certificate.{name}": f"{interval.value:.6g} {interval.low:.6g} {interval.high:.6g}"
            for name, interval in (("relmse", self.relmse), ("bias", self.bias))
        }
        sentence, _, _ = self.sentence().rpartition(", ")
        counts = {"certificate.pixels": str(self.pixels), "certificate.samples": str(self.samples)}
        return {"certificate": sentence, **numbers, **counts}


def check_pixels(pixels: Any, name: str = "certify") -> int:
    """Return the number of pixels of a certificate; True is PIXELS. Raises GiError for wrong values of `name`."""
    if pixels is True:
        return PIXELS
    if not is_whole(pixels) or not LEAST_PIXELS <= pixels <= MOST_PIXELS:
        raise GiError(
            f"{name} must be a whole number of pixels from {LEAST_PIXELS} to {MOST_PIXELS}, not {shown(pixels)}"
        )
    return int(pixels)


def certify(
    renderer: Renderer,
    pixels: int = PIXELS,
    *,
    picture: ArrayLike | None = None,
    seed: int = 0,
    progress: Callable[[float], None] | None = None,
) -> Certificate:
    """Return what the renderer's picture, as it stands, errs by; nothing may have changed since its last step.

    `picture` (h, w, 3), linear radiance, takes its place, such as its denoised radiance. `progress` receives the
    fraction done, 0 to 1. Raises GiError if the truth is black, so that no relative error exists, before the first
    frame, and for wrong numbers.
    """
    start = time.perf_counter()
    count = check_pixels(pixels)
    check_seed(seed)
    picture = np.asarray(renderer.read_back("radiance") if picture is None else picture, np.float64)
    if picture.shape != (renderer.size[1], renderer.size[0], 3):
        raise GiError(f"a picture to certify must have the renderer's size, not the shape {picture.shape}")
    if not np.isfinite(picture).all():
        raise GiError("the picture has NaN or infinite values, so it has no relative error")
    draw = draw_pixels(picture, count, seed)
    drawn = picture[draw.pixels[:, 1], draw.pixels[:, 0]]
    # Trace, and double the number of paths while their noise widens the intervals.
    truth = _traced(renderer, draw, seed, None, progress)
    while True:
        brightness, error = estimates(draw, drawn, truth, float(picture.mean()))
        if 2 * truth.replicates.shape[1] > MOST_REPLICATES or _is_known(brightness, error):
            break
        truth = _traced(renderer, draw, seed, truth, progress)
    return Certificate(
        error_interval(error),
        bias_interval(float(picture.mean()), brightness),
        len(draw.pixels),
        truth.spp,
        time.perf_counter() - start,
    )


def _is_known(brightness: Estimate, error: Estimate) -> bool:
    """Return whether the tracer's noise hardly widens the intervals, or does not matter."""
    limits = (brightness, NEGLIGIBLE["bias"] * brightness.value), (error, NEGLIGIBLE["relmse"])
    return all(e.noise <= max(NOISE_SHARE * e.error**2, least**2) for e, least in limits)


def _traced(
    renderer: Renderer, draw: Draw, seed: int, before: PixelTruth | None, progress: Callable[[float], None] | None
) -> PixelTruth:
    """Return the truth with twice the replicates of `before`, or the first ones."""
    known = 0 if before is None else before.replicates.shape[1]
    count = known or REPLICATES

    def part_done(fraction: float) -> None:
        if progress is not None:
            progress((known + count * fraction) / (known + count))

    # Each round has other random numbers.
    part = renderer.trace_pixels(
        draw.pixels, count * PATHS, seed=(seed << 20) + known, replicates=count, progress=part_done
    )
    return part if before is None else before.joined(part)


def estimates(draw: Draw, drawn: NDArray[np.float64], truth: PixelTruth, mean: float) -> tuple[Estimate, Estimate]:
    """Return the mean of the truth, and relMSE of a picture of this `mean`, `drawn` (n, 3) at the drawn pixels.

    Raises GiError if the truth is black.
    """
    grey = truth.replicates.mean(-1)
    noise = grey.var(1, ddof=1) / grey.shape[1]
    brightness, deviations = truth_mean(draw, drawn.mean(-1), grey.mean(1), noise, mean)
    if not brightness.value > 0:
        raise GiError("the truth is black at all pixels that were traced, so the picture has no relative error")
    return brightness, error_mean(draw, drawn, truth.replicates, brightness.value, deviations)
