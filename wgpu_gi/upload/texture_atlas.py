"""The texture atlas: packs all images of a scene into layers of one texture array, each at its own resolution.

WebGPU has no arrays of textures of different sizes. Shelf packing by decreasing height (Jylaenki 2010, "A Thousand Ways
to Pack the Bin", section 2). An image of 16 bits a channel is stored as its high bytes above its low bytes.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..scene.files.image_scaling import fitting_size, scaled_down
from ..scene.scene import Image
from ..webgpu_limits import MAX_TEXTURE_SIDE

MIN_PAGE = 256  # texels a side: a smaller texture saves no memory worth mentioning
MAX_LAYERS = 256  # WebGPU's default limit of array layers


class Place(NamedTuple):
    """Where an image lies, in texels, and its size there; `deep`: its low bytes lie below it."""

    layer: int
    x: int
    y: int
    width: int
    height: int
    deep: bool


@dataclass
class Atlas:
    """The place of each image by its id. Layers are square, `page` texels a side."""

    page: int
    layers: int
    places: dict[int, Place]


def pack_atlas(images: list[Image], deep: Collection[int] = ()) -> Atlas:
    """Place `images` on shelves, tallest first; `deep`: ids of those that keep 16 bits.

    Images get smaller places where they exceed the side of a texture, or all together its layers.
    """
    limit = MAX_TEXTURE_SIDE
    atlas = _pack(images, deep, limit, MIN_PAGE)
    while atlas.layers > MAX_LAYERS:
        # Fill the largest pages; if that does not suffice, halve the largest images.
        atlas = _pack(images, deep, limit, MAX_TEXTURE_SIDE)
        limit //= 2
    return atlas


def atlas_pixels(image: Image, place: Place, srgb: bool) -> NDArray[np.uint8]:
    """Return the pixels to copy to a place; `srgb`: they are sRGB codes."""
    size = (place.width, place.height)
    if not place.deep:
        return np.ascontiguousarray(scaled_down(image.eight_bit, size, srgb))
    pixels = scaled_down(image.pixels, size, srgb)
    return np.concatenate([pixels >> 8, pixels & 255]).astype(np.uint8)


def _pack(images: list[Image], deep: Collection[int], limit: int, page: int) -> Atlas:
    """Place images of at most `limit` texels a side on pages of at least `page` texels a side."""
    sizes = {id(image): fitting_size(image.pixels.shape[1], image.pixels.shape[0], limit) for image in images}
    deep = {key for key in deep if key in sizes and 2 * sizes[key][1] <= MAX_TEXTURE_SIDE}
    rows = {key: height * (1 + (key in deep)) for key, (_, height) in sizes.items()}
    largest = max((max(width, rows[key]) for key, (width, _) in sizes.items()), default=1)
    area = sum(width * rows[key] for key, (width, _) in sizes.items())
    # Choose a page that holds the largest image and, up to 4096 texels a side, a quarter of the area of all images.
    while page < largest or (page < 4096 and page * page * 4 < area):
        page *= 2
    # Fill shelves from left to right, layers from top to bottom.
    places: dict[int, Place] = {}
    layer, x, y, shelf = 0, 0, 0, 0
    for key, (width, height) in sorted(sizes.items(), key=lambda item: (rows[item[0]], item[1][0]), reverse=True):
        if x + width > page:
            x, y, shelf = 0, y + shelf, 0
        if y + rows[key] > page:
            layer, x, y, shelf = layer + 1, 0, 0, 0
        places[key] = Place(layer, x, y, width, height, key in deep)
        x, shelf = x + width, max(shelf, rows[key])
    return Atlas(page, layer + 1, places)
