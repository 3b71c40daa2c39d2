"""How pixels are sampled: through their centres, or through other points in each frame of a still picture."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

from ...settings import setting
from ...upload.surface_samples import GOLDEN, R2


@dataclass
class CameraSettings:
    """How pixels are sampled."""

    jitter: bool = setting(True, "Average over the pixel's square (box filter) instead of sampling its centre.")
    frames: int = setting(
        24,
        "Frames that a still picture averages; the path tracer averages samples instead.",
        "frames",
        range=(1, 65536),
        presets={"low": 4, "high": 64},
    )


def pixel_offset(frame: int, frames: int) -> tuple[float, float]:
    """Return the point of each pixel's unit square that the rays of a jittered frame go through, of `frames` in all.

    A rank-1 lattice: every row and every column of the square has one point, their mean is exactly the centre, and
    frames that follow one another are far apart.
    """
    index = (frame * _coprime(frames, R2[0]) + frames // 2) % frames
    other = (index * _coprime(frames, GOLDEN)) % frames
    return (index + 0.5) / frames, (other + 0.5) / frames


@cache
def _coprime(count: int, share: float) -> int:
    """Return the number nearest to a share of `count` that has no common divisor with it."""
    return min(range(1, count + 1), key=lambda k: (math.gcd(k, count) > 1, abs(k - share * count)))
