"""Decodes PNG, JPEG, WebP and other image files to 8-bit RGBA with Pillow, or returns the reason why it cannot."""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray
from PIL import Image as Pillow
from PIL import UnidentifiedImageError

from ...webgpu_limits import MAX_TEXTURE_SIDE
from .memory import MemoryBudget

# The largest texture that every device takes; decoded it is 256 MiB.
MAX_PIXELS = MAX_TEXTURE_SIDE**2

# Pillow's names of the formats that textures have; others, such as PostScript, run more than a decoder.
FORMATS = ("PNG", "JPEG", "WEBP", "BMP", "TGA", "TIFF", "GIF", "PPM", "DDS", "JPEG2000")

Picture = Pillow.Image | str


@contextmanager
def without_warnings() -> Iterator[None]:
    """Suppress Pillow's warnings of damaged metadata, and of sizes that `open_image` refuses; in one thread only."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


def open_image(encoded: bytes, budget: MemoryBudget, where: str, formats: tuple[str, ...] = FORMATS) -> Picture:
    """Return an image with only its header read, or the reason why there is none; `formats` are the allowed ones.

    Raises GiError, which begins with `where`, if its pixels do not fit into the budget.
    """
    try:
        picture = Pillow.open(io.BytesIO(encoded), formats=formats)
    except Exception as error:  # Pillow raises a dozen kinds of exceptions on broken files
        return _reason(error)
    if picture.width * picture.height > MAX_PIXELS:
        return f"{picture.width} x {picture.height} pixels are too large for a texture"
    budget.take(picture.width * picture.height * 4, where)
    return picture


def decode_image(picture: Picture) -> NDArray[np.uint8] | str:
    """Return the pixels (height, width, 4) uint8 of a result of `open_image`, or the reason why there are none."""
    if isinstance(picture, str):
        return picture
    try:
        if picture.mode.startswith("I"):
            # 16-bit grey, which Pillow would clip at 255 instead of scaling.
            grey = (np.asarray(picture).astype(np.int64) >> 8).astype(np.uint8)
            return np.dstack([grey, grey, grey, np.full_like(grey, 255)])
        return np.asarray(picture.convert("RGBA"))
    except MemoryError:
        return "there is not enough memory to decode it"
    except Exception as error:  # Pillow raises many kinds here, too
        return _reason(error)


def _reason(error: Exception) -> str:
    if isinstance(error, UnidentifiedImageError):
        return "it is not an image of a known format"
    if isinstance(error, Pillow.DecompressionBombError):
        return "it has more pixels than a texture can hold"
    return f"it cannot be decoded ({error or type(error).__name__})"
