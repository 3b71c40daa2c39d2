"""Images of a glTF file: from buffer views, data URIs and files to 8-bit RGBA, several at a time."""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray
from PIL import Image as Pillow
from PIL import UnidentifiedImageError

from ..scene import Image
from .accessors import Accessors
from .document import Document
from .json_object import JsonObject

# An 8192 x 8192 picture, the largest texture that WebGPU promises; decoded it takes 256 MiB.
_MAX_PIXELS = 8192 * 8192


class Images:
    """The decoded images of a document by index; None where one is missing, broken or absurdly large."""

    def __init__(self, document: Document, accessors: Accessors) -> None:
        self._document = document
        self._accessors = accessors
        self._descriptions = document.array("images")
        self._images: dict[int, Image | None] = {}

    def __len__(self) -> int:
        return len(self._descriptions)

    def load(self, indices: Iterable[int]) -> None:
        """Decode the images in parallel; Pillow releases the interpreter lock while it decodes."""
        new = sorted(set(indices) - self._images.keys())
        opened = [self._open(self._descriptions[index]) for index in new]
        with ThreadPoolExecutor() as pool:
            for index, pixels in zip(new, pool.map(_decode, opened), strict=True):
                self._images[index] = self._finish(self._descriptions[index], pixels)

    def get(self, index: int) -> Image | None:
        """Return image `index`, which `load` was asked for."""
        return self._images[index]

    def _open(self, image: JsonObject) -> Pillow.Image | str:
        """Return the picture with only its header read, or a sentence that says why there is none."""
        try:
            if "uri" in image:
                encoded = self._document.read_uri(image)
            else:
                encoded = bytes(self._accessors.view(self._accessors.view_index(image))[0])
        except FileNotFoundError as error:
            return str(error)
        return _read_header(encoded)

    def _finish(self, image: JsonObject, pixels: NDArray[np.uint8] | str) -> Image | None:
        uri = image.text("uri")
        name = image.text("name") or ("" if uri[:5].lower() == "data:" else uri)
        if isinstance(pixels, str):
            self._document.note(f"{image.where} {name[:80]!r} is left out: {pixels}.")
            return None
        return Image(pixels, name)


def _read_header(encoded: bytes) -> Pillow.Image | str:
    try:
        with warnings.catch_warnings():
            # Pillow warns of sizes that the check below refuses.
            warnings.simplefilter("ignore", Pillow.DecompressionBombWarning)
            picture = Pillow.open(io.BytesIO(encoded), formats=("PNG", "JPEG", "WEBP"))
    except Exception as error:  # Pillow raises a dozen kinds of exception on broken files
        return _reason(error)
    if picture.width * picture.height > _MAX_PIXELS:
        return f"{picture.width} x {picture.height} pixels are more than a texture can hold"
    return picture


def _decode(picture: Pillow.Image | str) -> NDArray[np.uint8] | str:
    """Return (height, width, 4) uint8 pixels, or pass on the sentence that says why there are none."""
    if isinstance(picture, str):
        return picture
    try:
        if picture.mode.startswith("I"):
            # 16-bit grey: Pillow would clip it at 255 instead of scaling it.
            grey = (np.asarray(picture).astype(np.int64) >> 8).astype(np.uint8)
            return np.dstack([grey, grey, grey, np.full_like(grey, 255)])
        return np.asarray(picture.convert("RGBA"))
    except Exception as error:  # as above
        return _reason(error)


def _reason(error: Exception) -> str:
    if isinstance(error, UnidentifiedImageError):
        return "it is not a PNG, JPEG or WebP picture"
    if isinstance(error, Pillow.DecompressionBombError):
        return "it has more pixels than a texture can hold"
    return f"it cannot be decoded ({error})"
