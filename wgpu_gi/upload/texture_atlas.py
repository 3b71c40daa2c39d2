"""The texture atlas: packs all images of a scene into layers of one texture array, each at its own resolution.

WebGPU has no arrays of textures of different sizes. Shelf packing by decreasing height (Jylaenki 2010, "A Thousand Ways
to Pack the Bin", section 2).
"""

from __future__ import annotations

from dataclasses import dataclass

from ..errors import GiError
from ..scene.scene import Image

MIN_PAGE = 256  # texels a side: a smaller texture saves no memory worth mentioning
MAX_LAYERS = 256  # WebGPU's default limit of array layers


@dataclass
class Atlas:
    """The place of each image: id(image) -> (layer, x, y). Layers are square, `page` texels a side."""

    page: int
    layers: int
    places: dict[int, tuple[int, int, int]]


def pack_atlas(images: list[Image]) -> Atlas:
    """Place `images` on shelves, tallest first. Raises GiError if all together are too large."""
    largest = max((max(image.pixels.shape[:2]) for image in images), default=1)
    area = sum(image.pixels.shape[0] * image.pixels.shape[1] for image in images)
    # Choose a page that holds the largest image and, up to 4096 texels a side, a quarter of the area of all images.
    page = MIN_PAGE
    while page < largest or (page < 4096 and page * page * 4 < area):
        page *= 2
    # Fill shelves from left to right, layers from top to bottom.
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
            f"the textures fill {layer + 1} layers of {page} x {page}; {MAX_LAYERS} are possible: scale them down"
        )
    return Atlas(page, layer + 1, places)
