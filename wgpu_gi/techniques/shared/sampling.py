"""Pixel sampling: through the centres, or through a different point in each frame of a still picture."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

from ...records import KnownAttributes
from ...settings import setting
from ...upload.surface_samples import GOLDEN, R2

OPEN_FRAMES = 65536  # frames of a still picture that may end after any of them

# Uniforms of a pass whose random numbers stand still while anything moves (`wgsl/scene/sequence.wgsl`).
STILL_SEQUENCE = {"sequence": "still_sequence"}


@dataclass(repr=False, slots=True)
class CameraSettings(KnownAttributes):
    """Pixel sampling."""

    jitter: bool = setting(True, "Average over the pixel's square (box filter) instead of sampling its centre.")
    frames: int = setting(
        24,
        "Frames that a still picture averages; the path tracer averages samples instead.",
        "frames",
        range=(1, OPEN_FRAMES),
        presets={"low": 4, "high": 64},
    )
    antialias: int = setting(
        8,
        "Frames that temporal anti-aliasing averages in moving pictures of a single frame each: in the window while"
        " anything moves, and with --frames and camera.frames=1; 1: none. Lamps thinner than"
        " a pixel lose light at rest.",
        "frames",
        range=(1, 60),
    )
    footprint: float = setting(
        1.0,
        "Side of the square that a jittered sample averages textures over; 0 reads their finest mip level.",
        "pixels",
        range=(0, 4),
    )
    anisotropy: int = setting(
        2, "Most samples of a texture along the longer side of a pixel's footprint.", "samples", range=(1, 8)
    )


def sample_footprint(settings: CameraSettings, samples: int = 1) -> float:
    """Return the side, in pixels, of the square that each of `samples` samples of a pixel averages textures over.

    A sample stands for its share of the pixel, so the mean of many is not blurred beyond the pixel. Without jitter all
    samples show the pixel's centre alone.
    """
    return settings.footprint / math.sqrt(samples) if settings.jitter else 0.0


def pixel_offset(frame: int, frames: int) -> tuple[float, float]:
    """Return the point of each pixel's unit square that a jittered frame samples, for `frames` frames in all.

    The points are a rank-1 lattice: every row and column of the square has one point, their mean is exactly the centre,
    and consecutive frames are far apart. With OPEN_FRAMES they are Halton's, of which any number is even.
    """
    if frames == OPEN_FRAMES:
        return moving_offset(frame)
    index = (frame * _coprime(frames, R2[0]) + frames // 2) % frames
    other = (index * _coprime(frames, GOLDEN)) % frames
    return (index + 0.5) / frames, (other + 0.5) / frames


def moving_offset(frame: int) -> tuple[float, float]:
    """Return the point of each pixel's unit square that a frame of a moving or open-ended picture samples.

    Halton's sequence in bases 2 and 3: any consecutive frames are spread evenly, and more frames more evenly. The
    coverage by edges of any direction is off by 0.05 (RMS) in an exponential mean over 8 frames; with a lattice of 8
    points it is off by 0.07, with the sequence of the golden ratio's kind (R2) by 0.06. In the plain mean of the first
    8, 24, 64 and 256 frames: 0.068, 0.035, 0.016, 0.0056; R2 0.090, 0.050, 0.021, 0.0053; lattices of so many points
    0.056, 0.035, 0.013, 0.0044.
    """
    return _radical_inverse(frame + 1, 2), _radical_inverse(frame + 1, 3)


def _radical_inverse(number: int, base: int) -> float:
    """Return the digits of `number` mirrored at the point."""
    found, digit = 0.0, 1.0 / base
    while number:
        number, last = divmod(number, base)
        found, digit = found + last * digit, digit / base
    return found


@cache
def _coprime(count: int, share: float) -> int:
    """Return the number coprime to `count` that is nearest to `share` times `count`."""
    return min(range(1, count + 1), key=lambda k: (math.gcd(k, count) > 1, abs(k - share * count)))
