"""Scales pictures down by averaging areas: to what a texture can hold."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image as Pillow

from ...pictures.color import LINEAR_OF_CODE, srgb_from_linear
from ...webgpu_limits import MAX_TEXTURE_SIDE

STRIPE = 128  # rows that are averaged at once; bounds the memory for floats


def fitting_size(width: int, height: int, limit: int = MAX_TEXTURE_SIDE) -> tuple[int, int]:
    """Return the largest size of at most `limit` on each side, of nearly the same proportions."""
    scale = min(limit / max(width, height), 1.0)
    return max(round(width * scale), 1), max(round(height * scale), 1)


def scaled_down(pixels: NDArray[Any], size: tuple[int, int], srgb: bool) -> NDArray[Any]:
    """Return pixels (height, width, 4), uint8 or uint16, averaged to `size` (width, height).

    `srgb`: colours are averaged as light, so that lamps keep their power; else codes are averaged.
    """
    height, width = pixels.shape[:2]
    if size == (width, height):
        return pixels
    if srgb and pixels.dtype == np.uint16:
        pixels = (pixels >> 8).astype(np.uint8)
    largest = float(np.iinfo(pixels.dtype).max)
    scaled = np.empty((size[1], size[0], 4), pixels.dtype)
    linear = LINEAR_OF_CODE.astype(np.float32)
    for row in range(0, size[1], STRIPE):
        end = min(row + STRIPE, size[1])
        low, high = row * height / size[1], end * height / size[1]
        first, last = int(low), min(int(np.ceil(high)), height)
        for channel in range(4):
            codes = pixels[first:last, :, channel]
            is_light = srgb and channel < 3
            plane = linear[codes] if is_light else codes.astype(np.float32) / np.float32(largest)
            box = (0.0, low - first, float(width), min(high - first, float(last - first)))
            mean = np.asarray(
                Pillow.fromarray(plane).resize((size[0], end - row), Pillow.Resampling.BOX, box), np.float32
            )
            mean = srgb_from_linear(mean) if is_light else mean
            scaled[row:end, :, channel] = np.clip(np.round(mean * largest), 0, largest)
    return scaled
