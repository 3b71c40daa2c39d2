"""Decodes image files to RGBA with Pillow, and KTX2 files with opengl_basisu, or returns the reason why it cannot.

Pictures that are too large for a texture are scaled down; colours are averaged as light, not as codes.
"""

from __future__ import annotations

import importlib.util
import io
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image as Pillow
from PIL import UnidentifiedImageError, features

from .image_scaling import fitting_size, scaled_down
from .memory import MemoryBudget

# A file that announces more pixels than this, 1 GiB decoded, is damaged or hostile.
MOST_PIXELS = 16384 * 16384

# Pillow's names of the formats that textures have; others, such as PostScript, run more than a decoder.
FORMATS = ("PNG", "JPEG", "WEBP", "AVIF", "BMP", "TGA", "TIFF", "GIF", "PPM", "DDS", "JPEG2000")

_KTX2 = b"\xabKTX 20\xbb\r\n\x1a\n"
NO_BASISU = "it is a KTX2 file, which needs the package opengl_basisu (pip install opengl_basisu)"
_NO_AVIF = "this Pillow was built without AVIF (pip install --force-reinstall Pillow)"

# Pillow keeps the high byte of 16-bit colours of a PNG; read as little-endian, the other byte of each is kept.
_LOW_BYTES = {"RGB;16B": "RGB;16L", "RGBA;16B": "RGBA;16L"}


@dataclass
class OpenedImage:
    """An image of which only the header was read; `decode` returns its pixels (height, width, 4) uint8 or uint16."""

    width: int
    height: int
    decode: Callable[[], NDArray[Any]]

    @property
    def note(self) -> str:
        """What is said of a picture that is scaled down; empty for others."""
        size = fitting_size(self.width, self.height)
        if size == (self.width, self.height):
            return ""
        shown = f"{size[0]} x {size[1]}"
        return f"its {self.width} x {self.height} pixels were scaled down to {shown}, which a texture can hold"


Picture = OpenedImage | str


@contextmanager
def without_warnings() -> Iterator[None]:
    """Suppress Pillow's warnings of damaged metadata, and its limit of pixels; for one thread only."""
    limit = Pillow.MAX_IMAGE_PIXELS
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        Pillow.MAX_IMAGE_PIXELS = None
        try:
            yield
        finally:
            Pillow.MAX_IMAGE_PIXELS = limit


def open_image(encoded: bytes, budget: MemoryBudget, where: str, deep: bool = False) -> Picture:
    """Return an image with only its header read, or the reason why there is none.

    With `deep`, 16 bits a channel are kept where the file has them. Raises GiError, which begins with `where`, if the
    pixels do not fit into the budget.
    """
    try:
        opened: Picture
        if encoded.startswith(_KTX2):
            opened = _open_ktx2(encoded)
        else:
            opened = from_pillow(Pillow.open(io.BytesIO(encoded), formats=FORMATS), encoded, deep)
    except Exception as error:  # the libraries raise a dozen kinds of exceptions on broken files
        return _reason(error, encoded)
    if isinstance(opened, str):
        return opened
    if opened.width * opened.height > MOST_PIXELS:
        return f"{opened.width} x {opened.height} pixels are too many"
    budget.take(opened.width * opened.height * (8 if deep else 4), where)
    return opened


def decode_image(picture: Picture, srgb: bool = True) -> NDArray[Any] | str:
    """Return the pixels (height, width, 4) of a result of `open_image`, or the reason why there are none.

    uint8, or uint16 if 16 bits were kept. Pictures that are too large for a texture are scaled down; `srgb`: the
    colours are sRGB codes.
    """
    if isinstance(picture, str):
        return picture
    try:
        pixels = picture.decode()
        return scaled_down(pixels, fitting_size(picture.width, picture.height), srgb)
    except MemoryError:
        return "there is not enough memory to decode it"
    except Exception as error:  # the libraries raise many kinds here, too
        return _reason(error, b"")


def has_basisu() -> bool:
    """Tell whether the transcoder of KTX2 files is installed."""
    return importlib.util.find_spec("opengl_basisu") is not None


def from_pillow(picture: Pillow.Image, encoded: bytes = b"", deep: bool = False) -> OpenedImage:
    """Return an image of Pillow for `decode_image`; its file `encoded` is read again with `deep`."""
    return OpenedImage(picture.width, picture.height, lambda: _decode_by_pillow(picture, encoded, deep))


def _decode_by_pillow(picture: Pillow.Image, encoded: bytes, deep: bool) -> NDArray[Any]:
    raw_mode = _raw_mode(picture)
    if picture.mode.startswith("I"):
        # 16-bit grey, which Pillow would clip at 255 instead of scaling.
        grey = np.asarray(picture).astype(np.int64).clip(0, 65535).astype(np.uint16)
        pixels = np.dstack([grey, grey, grey, np.full_like(grey, 65535)])
        return pixels if deep else (pixels >> 8).astype(np.uint8)
    if not deep or raw_mode not in _LOW_BYTES:
        return np.asarray(picture.convert("RGBA"))
    # Decode the high bytes and the low bytes one after the other.
    low = Pillow.open(io.BytesIO(encoded), formats=["PNG"])
    low.tile = [tile._replace(args=_LOW_BYTES[raw_mode]) for tile in low.tile]  # type: ignore[attr-defined]
    high_bytes, low_bytes = (np.asarray(part.convert("RGBA")) for part in (picture, low))
    pixels = high_bytes.astype(np.uint16) << 8 | low_bytes
    if raw_mode.startswith("RGB;"):
        pixels[..., 3] = 65535
    return pixels


def _raw_mode(picture: Pillow.Image) -> str:
    """Return how Pillow unpacks the pixels of a PNG that is not yet loaded; empty for other formats."""
    tiles = getattr(picture, "tile", None) or [] if picture.format == "PNG" else []
    args = tiles[0][3] if tiles else ""
    return args if isinstance(args, str) else str(args[0])


def _open_ktx2(encoded: bytes) -> OpenedImage | str:
    """Open a KTX2 file of Basis Universal, the only kind that glTF has (KHR_texture_basisu)."""
    if not has_basisu():
        return NO_BASISU
    import opengl_basisu

    texture = opengl_basisu.open(encoded)
    target = opengl_basisu.Target.RGBA8
    return OpenedImage(texture.width, texture.height, lambda: np.array(texture.transcode(target).data))


def _reason(error: Exception, encoded: bytes) -> str:
    if encoded[4:12] in (b"ftypavif", b"ftypavis") and not features.check("avif"):
        return _NO_AVIF
    if isinstance(error, UnidentifiedImageError):
        return "it is not an image of a known format"
    return f"it cannot be decoded ({error or type(error).__name__})"
