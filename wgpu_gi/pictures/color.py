"""sRGB and luminance on the CPU: the IEC 61966-2-1 transfer curves and the weights of Rec.709."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

REC709_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # weights of linear red, green and blue (ITU-R BT.709)


def srgb_from_linear(linear: ArrayLike) -> NDArray[np.float32]:
    """Encode linear [0, 1] as sRGB [0, 1] in float32, by the exact piecewise curve; values outside are clamped."""
    x = np.clip(np.asarray(linear, np.float32), 0.0, 1.0)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.power(x, 1 / 2.4) - 0.055).astype(np.float32)


def linear_from_srgb(encoded: ArrayLike) -> NDArray:
    """Decode sRGB [0, 1] to linear [0, 1], the inverse of `srgb_from_linear`; values outside are clamped.

    The result is float32 for float32 input and float64 for any other.
    """
    x = np.asarray(encoded)
    x = np.clip(x if x.dtype == np.float32 else x.astype(np.float64), 0.0, 1.0)
    return np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)


LINEAR_OF_CODE: NDArray[np.float64] = linear_from_srgb(np.arange(256) / 255.0)  # linear value of each 8-bit sRGB code
