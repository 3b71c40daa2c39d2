"""The images of a glTF file: from buffer views, data URIs and files to 8-bit RGBA, decoded in parallel."""

from __future__ import annotations

from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from ..files.image_files import Picture, decode_image, open_image, without_warnings
from ..scene import Image
from .accessors import Accessors
from .document import Document
from .json_object import Damage, JsonObject

_FORMATS = ("PNG", "JPEG", "WEBP")  # Pillow's names of the formats of glTF 2.0 and EXT_texture_webp


class Images:
    """The decoded images of a document by index; None where one is missing, broken or too large."""

    def __init__(self, document: Document, accessors: Accessors) -> None:
        self._document = document
        self._accessors = accessors
        self._descriptions = document.array("images")
        self._images: dict[int, Image | None] = {}
        self._first: dict[str, int] = {}  # the first image of each source

    def __len__(self) -> int:
        return len(self._descriptions)

    def load(self, indices: Iterable[int]) -> None:
        """Decode the images in parallel threads, each source once; Pillow releases the interpreter lock meanwhile."""
        wanted = sorted(set(indices) - self._images.keys())
        first = {index: self._first.setdefault(self._source(index), index) for index in wanted}
        new = [index for index in wanted if first[index] == index]
        with without_warnings(), ThreadPoolExecutor() as pool:
            opened = [self._open(self._descriptions[index]) for index in new]
            for index, pixels in zip(new, pool.map(decode_image, opened), strict=True):
                self._images[index] = self._finish(self._descriptions[index], pixels)
        self._images |= {index: self._images[first[index]] for index in wanted}

    def get(self, index: int) -> Image | None:
        """Return image `index`, which must have been loaded."""
        return self._images[index]

    def _source(self, index: int) -> str:
        """Return a text that is equal for images with the same bytes."""
        image = self._descriptions[index]
        return f"uri {image.text('uri')}" if "uri" in image else f"view {image.raw.get('bufferView')!r}"

    def _open(self, image: JsonObject) -> Picture:
        """Return the image with only its header read, or the reason why there is none."""
        try:
            if "uri" in image:
                encoded = self._document.read_uri(image)
            else:
                encoded = bytes(self._accessors.view(self._accessors.view_index(image))[0])
        except Damage as error:
            return str(error).removeprefix(f"{image.where}: ")
        return open_image(encoded, self._document.budget, image.where, _FORMATS)

    def _finish(self, image: JsonObject, pixels: NDArray[np.uint8] | str) -> Image | None:
        """Return the image, or None with a note why there is none."""
        uri = image.text("uri")
        name = image.text("name") or ("" if uri[:5].lower() == "data:" else uri)
        if isinstance(pixels, str):
            self._document.notes.damage(f"{image.where} {name[:80]!r} was left out: {pixels}.")
            return None
        return Image(pixels, name)
