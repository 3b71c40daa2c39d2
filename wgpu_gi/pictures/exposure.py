"""Automatic exposure: the photographic average of Reinhard et al. 2002, "Photographic Tone Reproduction", eq. 1 and 2.

The log-average luminance becomes 0.18, the key of a scene that is neither bright nor dark. Departure: eq. 1 adds a
small constant to every luminance. Here, pixels that an 8-bit screen shows black are left out, so that a background
without light does not brighten the foreground.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from .color import REC709_LUMINANCE

KEY = 0.18
# The least linear value that is not black in 8-bit sRGB (12.92 x >= 1/255), relative to a mean at the key.
DARKEST = 1 / 255 / 12.92 / KEY
STEP = 0.1  # EV: invisible, and easy to type
LARGEST = 60.0  # EV: the range of the setting `exposure`
NOT_EXPOSED = ("alpha", "albedo", "normal", "depth", "position", "instance")  # buffers that hold no light


def automatic_exposure(picture: ArrayLike) -> float:
    """Return the exposure in EV, a multiple of 0.1, of linear radiance (h, w), (h, w, 3) or RGBA; 0 without light."""
    values = np.asarray(picture, np.float64)
    luminance = values[..., :3] @ REC709_LUMINANCE if values.ndim == 3 else values
    luminance = luminance[np.isfinite(luminance) & (luminance > 0.0)]
    if not luminance.size:
        return 0.0
    lit = luminance[luminance >= DARKEST * luminance.mean()]
    stops = math.log2(KEY) - float(np.log2(lit).mean())
    # + 0.0 turns -0.0 into 0.0.
    return float(np.clip(round(round(stops / STEP) * STEP, 1), -LARGEST, LARGEST)) + 0.0


def is_exposed(name: str) -> bool:
    """Return whether a buffer holds light: exposure and tone curve then apply on a screen."""
    return name not in NOT_EXPOSED


def exposure_text(stops: float, automatic: bool) -> str:
    """Return an exposure in words, such as "+1.3 EV (automatic)"."""
    return f"{stops:+g} EV{' (automatic)' if automatic else ''}"
