"""Packs all pictures of a scene into pages of one texture array, each at its own resolution.

WebGPU has no arrays of textures, and resizing pictures to one size would change what is seen. Shelves by height, the
oldest and simplest of the packings in Jylaenki 2010, "A Thousand Ways to Pack the Bin".
"""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from ..errors import GiError
from ..pictures.color import LINEAR_OF_CODE
from ..scene.scene import Image

MIN_PAGE = 256
MAX_PAGE = 8192  # default limit of WebGPU for a texture's side
MAX_LAYERS = 256  # and for its layers


@dataclass
class Atlas:
    """Where each picture lies: id(image) -> (layer, x, y); pages are square, `page` texels wide, `layers` of them."""

    page: int
    layers: int
    places: dict[int, tuple[int, int, int]]


def pack_atlas(images: list[Image]) -> Atlas:
    """Place `images` on as few pages as shelves allow. Raises GiError if one of them or their sum is too large."""
    for image in images:
        if image.pixels.ndim != 3 or image.pixels.shape[2] != 4 or image.pixels.dtype != np.uint8:
            raise GiError(f"image {image.name!r}: pixels must be (height, width, 4) uint8")
    largest = max((max(image.pixels.shape[:2]) for image in images), default=1)
    if largest > MAX_PAGE:
        name = next(i.name for i in images if max(i.pixels.shape[:2]) == largest)
        raise GiError(f"image {name!r} is {largest} pixels long; textures hold at most {MAX_PAGE}: scale it down")
    area = sum(image.pixels.shape[0] * image.pixels.shape[1] for image in images)
    # Pages as small as hold the largest picture, but large enough that layers and waste stay few.
    page = MIN_PAGE
    while page < largest or (page < 4096 and page * page * 4 < area):
        page *= 2
    places: dict[int, tuple[int, int, int]] = {}
    layer, x, y, shelf = 0, 0, 0, 0
    for image in sorted(images, key=lambda i: i.pixels.shape[:2], reverse=True):
        height, width = image.pixels.shape[:2]
        if x + width > page:
            x, y, shelf = 0, y + shelf, 0
        if y + height > page:
            layer, x, y, shelf = layer + 1, 0, 0, 0
        places[id(image)] = (layer, x, y)
        x, shelf = x + width, max(shelf, height)
    if layer >= MAX_LAYERS:
        raise GiError(
            f"the textures need {layer + 1} pages of {page} x {page}; {MAX_LAYERS} are possible; scale them down"
        )
    return Atlas(page, layer + 1, places)


_MEANS: WeakKeyDictionary[Image, NDArray[np.float64]] = WeakKeyDictionary()  # pictures are immutable once in use


def mean_linear_color(image: Image) -> NDArray[np.float64]:
    """Return the mean of an sRGB-coded picture's linear colour, (3,)."""
    if image not in _MEANS:
        histograms = [np.bincount(image.pixels[..., c].ravel(), minlength=256) for c in range(3)]
        _MEANS[image] = np.array([h @ LINEAR_OF_CODE for h in histograms]) / max(1, image.pixels[..., 0].size)
    return _MEANS[image]
