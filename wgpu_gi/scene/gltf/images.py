"""The images of a glTF file: from buffer views, data URIs and files to RGBA, decoded in parallel."""

from __future__ import annotations

from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from numpy.typing import NDArray

from ..files.image_files import NO_BASISU, Picture, decode_image, open_image, without_warnings
from ..scene import Image
from .accessors import Accessors
from .document import Document
from .json_object import Damage, JsonObject


class Images:
    """The decoded images of a document by index; None where one is missing or broken."""

    def __init__(self, document: Document, accessors: Accessors) -> None:
        self._document = document
        self._accessors = accessors
        self._descriptions = document.array("images")
        self._images: dict[int, Image | None] = {}
        self._first: dict[tuple[str, bool, bool], int] = {}  # the first image of each source and use

    def __len__(self) -> int:
        return len(self._descriptions)

    def load(self, indices: Iterable[int], colors: set[int], normals: set[int]) -> None:
        """Decode the images in parallel threads, each source once; Pillow releases the interpreter lock meanwhile.

        `colors`: the images that hold sRGB codes. `normals`: those whose 16 bits a channel are kept.
        """
        wanted = sorted(set(indices) - self._images.keys())
        first = {
            index: self._first.setdefault((self._source(index), index in colors, index in normals), index)
            for index in wanted
        }
        new = [index for index in wanted if first[index] == index]
        with without_warnings(), ThreadPoolExecutor() as pool:
            opened = [self._open(self._descriptions[index], index in normals) for index in new]
            decoded = pool.map(decode_image, opened, [index in colors for index in new])
            for index, picture, pixels in zip(new, opened, decoded, strict=True):
                self._images[index] = self._finish(self._descriptions[index], picture, pixels)
        self._images |= {index: self._images[first[index]] for index in wanted}

    def has(self, index: int) -> bool:
        """Tell whether image `index` was loaded."""
        return index in self._images

    def get(self, index: int) -> Image | None:
        """Return image `index`, which must have been loaded."""
        return self._images[index]

    def _source(self, index: int) -> str:
        """Return a text that is equal for images with the same bytes."""
        image = self._descriptions[index]
        return f"uri {image.text('uri')}" if "uri" in image else f"view {image.raw.get('bufferView')!r}"

    def _open(self, image: JsonObject, deep: bool) -> Picture:
        """Return the image with only its header read, or the reason why there is none."""
        try:
            if "uri" in image:
                encoded = self._document.read_uri(image)
            else:
                encoded = bytes(self._accessors.view(self._accessors.view_index(image))[0])
        except Damage as error:
            return str(error).removeprefix(f"{image.where}: ")
        return open_image(encoded, self._document.budget, image.where, deep)

    def _finish(self, image: JsonObject, picture: Picture, pixels: NDArray[Any] | str) -> Image | None:
        """Return the image, or None with a note why there is none."""
        uri = image.text("uri")
        name = image.text("name") or ("" if uri[:5].lower() == "data:" else uri)
        shown = f"{image.where} {name[:80]!r}" if name else image.where
        if isinstance(pixels, str) or isinstance(picture, str):
            sentence = f"{shown} was left out: {pixels}."
            # The file is sound where a package is missing.
            (self._document.notes.add if pixels == NO_BASISU else self._document.notes.damage)(sentence)
            return None
        if picture.note:
            self._document.notes.add(f"{shown}: {picture.note}.")
        return Image(pixels, name)
