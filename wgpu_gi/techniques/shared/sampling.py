"""Pixel sampling: through the centres, or through a different point in each frame of a still picture."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...records import KnownAttributes
from ...settings import setting

OPEN_FRAMES = 65536  # frames of a still picture that may end after any of them

# Uniforms of a pass whose random numbers stand still while anything moves (`wgsl/scene/sequence.wgsl`).
STILL_SEQUENCE = {"sequence": "still_sequence"}
PIXEL_SEED = 0x9E3779B9  # sets the points in the pixel apart from all other random numbers
# Steps of the multiplication by Pascal's triangle modulo 2: shifts, and the bits that they apply to.
PASCAL = ((1, 0x55555555), (2, 0x33333333), (4, 0x0F0F0F0F), (8, 0x00FF00FF), (16, 0x0000FFFF))
MASK = 0xFFFFFFFF
BELOW_ONE = np.float32(0.99999994)


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


def pixel_offset(frame: int, seed: int) -> tuple[float, float]:
    """Return the point of each pixel's unit square that a frame of a jittered still picture samples.

    Owen-scrambled Sobol points, by `sobol_2d` of `wgsl/common/random.wgsl`: the mean over any number of frames is even,
    and so is that over each aligned block of 2^k frames, which `standard_error` is estimated from. The coverage by
    edges of any direction is off by 0.104, 0.061, 0.029 and 0.013 (RMS) in the mean over 4, 8, 24 and 64 frames; with
    rank-1 lattices by 0.120, 0.062, 0.032 and 0.013, with Halton's sequence by 0.142, 0.071, 0.036 and 0.017.
    """
    first, second = (bits / 2**32 for bits in sobol_bits(frame, _hash(seed ^ PIXEL_SEED)))
    return first, second


def pixels_of_sequence(count: int, size: tuple[int, int]) -> tuple[tuple[int, int], ...]:
    """Return the pixels that `wgsl/many_light/vpl/view_samples.wgsl` picks of a picture; float32, as there."""
    found = []
    for index in range(count):
        units = [min(np.float32(bits) * np.float32(2**-32), BELOW_ONE) for bits in sobol_bits(index, 0)]
        x, y = (min(int(unit * np.float32(side)), side - 1) for unit, side in zip(units, size, strict=True))
        found.append((x, y))
    return (*found,)


def sobol_bits(index: int, key: int) -> tuple[int, int]:
    """Return the 32 bits of both coordinates of point `index`, by `sobol_2d` of `wgsl/common/random.wgsl`."""
    # Shuffle the points, then take the van der Corput sequence, and the one by Pascal's triangle modulo 2.
    order = _owen_scramble(_reversed_bits(index), _hash(key))
    x, y = _reversed_bits(order), _reversed_bits(order)
    for shift, mask in PASCAL:
        y ^= (y >> shift) & mask
    keys = key ^ 0x68BC21EB, key ^ 0x02E5BE93
    first, second = (_reversed_bits(_owen_scramble(v, _hash(k))) for v, k in zip((x, y), keys, strict=True))
    return first, second


def moving_offset(frame: int) -> tuple[float, float]:
    """Return the point of each pixel's unit square that a frame of a moving picture samples.

    Halton's sequence in bases 2 and 3: any consecutive frames are spread evenly, and more frames more evenly. The
    coverage by edges of any direction is off by 0.05 (RMS) in an exponential mean over 8 frames; with a lattice of 8
    points it is off by 0.07, with the sequence of the golden ratio's kind (R2) by 0.06.
    """
    return _radical_inverse(frame + 1, 2), _radical_inverse(frame + 1, 3)


def _radical_inverse(number: int, base: int) -> float:
    """Return the digits of `number` mirrored at the point."""
    found, digit = 0.0, 1.0 / base
    while number:
        number, last = divmod(number, base)
        found, digit = found + last * digit, digit / base
    return found


def _hash(value: int) -> int:
    """Return the 32-bit hash of `wgsl/common/random.wgsl`."""
    state = (value * 747796405 + 2891336453) & MASK
    word = (((state >> ((state >> 28) + 4)) ^ state) * 277803737) & MASK
    return (word >> 22) ^ word


def _owen_scramble(reversed_bits: int, seed: int) -> int:
    """Return the 32 bits of `laine_karras` in `wgsl/common/random.wgsl`."""
    x = reversed_bits ^ (reversed_bits * 0x3D20ADEA & MASK)
    x = (x + seed) * ((seed >> 16) | 1) & MASK
    x ^= x * 0x05526C56 & MASK
    return x ^ (x * 0x53A22864 & MASK)


def _reversed_bits(value: int) -> int:
    return int(f"{value:032b}"[::-1], 2)
