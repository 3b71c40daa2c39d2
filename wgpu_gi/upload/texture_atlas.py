"""The texture atlas: packs all images of a scene, with their mip levels, into layers of one texture array.

WebGPU has no arrays of textures of different sizes. Shelves by decreasing height, each filled first fit (Jylaenki 2010,
"A Thousand Ways to Pack the Bin", section 2). Each level has a border of one texel, filled by the texture's wrap modes:
bilinear filters read no other image. An image takes two rectangles: its finest level, and its chain: level 1, and to
its right a column of all coarser levels. The chain's layout is a closed form (`level_corner`), which shaders repeat.
An image of 16 bits a channel has its low bytes below its high bytes, in both rectangles.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..scene.files.image_scaling import fitting_size, scaled_down
from ..scene.scene import Image, Wrap
from ..webgpu_limits import MAX_TEXTURE_SIDE
from .mip_levels import LIGHT, Content, level_count, level_size, mip_levels

MIN_PAGE = 256  # texels a side: a smaller texture saves no memory worth mentioning
MAX_LAYERS = 256  # WebGPU's default limit of array layers
BORDER = 1  # texels around each level
MAX_IMAGE_SIDE = MAX_TEXTURE_SIDE - 2 * BORDER
LEVEL_ROWS = 3  # rows of the chain's column for each level, beyond those of its texels: two of borders, one of rounding
OPEN_SHELVES = 64  # the last ones, which are searched for room: keeps packing linear
SIDES = (1.0, 1.25, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0)  # pages that are tried, over the side of a rectangle

_PAD_MODES: dict[Wrap, Any] = {"repeat": "wrap", "clamp": "edge", "mirror": "symmetric"}  # of numpy.pad


class AtlasImage(NamedTuple):
    """An image as shaders read it: what it holds, how it is wrapped, and whether it has mip levels.

    `cutoff`: of the alpha test of a mask; 0 of other contents.
    """

    image: Image
    content: Content
    wrap_u: Wrap
    wrap_v: Wrap
    has_levels: bool
    cutoff: float = 0.0

    @property
    def is_deep(self) -> bool:
        """Whether it keeps 16 bits a channel, if there is room."""
        return self.content == "normal" and self.image.pixels.dtype == np.uint16


class Place(NamedTuple):
    """Where an image lies, in texels without borders, and its size there.

    `chain`: layer and corner of level 1. `levels`: number of levels below the finest. `deep`: it has low bytes.
    """

    layer: int
    x: int
    y: int
    width: int
    height: int
    deep: bool
    levels: int
    chain: tuple[int, int, int]


@dataclass
class Atlas:
    """The place of each image. Layers are square, `page` texels a side."""

    page: int
    layers: int
    places: dict[AtlasImage, Place]


def pack_atlas(images: Iterable[AtlasImage]) -> Atlas:
    """Place images and their mip levels.

    Images get smaller places where they exceed the side of a texture, or all together its layers.
    """
    images = list(dict.fromkeys(images))
    limit = MAX_IMAGE_SIDE
    while True:
        atlas = _pack(images, limit)
        if atlas.layers <= MAX_LAYERS:
            return atlas
        limit = (limit + 2 * BORDER) // 2 - 2 * BORDER


def atlas_rectangles(image: AtlasImage, place: Place) -> tuple[Place, list[tuple[tuple[int, int, int], NDArray]]]:
    """Return the place with the number of levels that the image has, and its texels: (layer, x, y) and (h, w, 4) uint8.

    A mask may have fewer levels than its place has room for.
    """
    light = image.content in LIGHT
    pixels = image.image.pixels if place.deep else image.image.eight_bit
    pixels = np.ascontiguousarray(scaled_down(pixels, (place.width, place.height), light))
    levels = mip_levels(pixels, image.content, image.cutoff) if place.levels or image.content == "normal" else [pixels]
    levels = levels[: place.levels + 1]
    modes = _PAD_MODES[image.wrap_u], _PAD_MODES[image.wrap_v]
    first = _bordered(levels[0], modes)
    found = [((place.layer, place.x - BORDER, place.y - BORDER), _octets(first, place.deep))]
    if len(levels) > 1:
        width, height = chain_size(place.width, place.height, place.levels)
        chain = np.zeros((height, width, 4), pixels.dtype)
        for number, level in enumerate(levels[1:], 1):
            x, y = level_corner(place.width, place.height, number)
            chain[y : y + len(level) + 2 * BORDER, x : x + level.shape[1] + 2 * BORDER] = _bordered(level, modes)
        layer, x, y = place.chain
        found.append(((layer, x - BORDER, y - BORDER), _octets(chain, place.deep)))
    return place._replace(levels=len(levels) - 1), found


def level_corner(width: int, height: int, level: int) -> tuple[int, int]:
    """Return where a level from 1 on begins in its chain, texels: levels from 2 on lie in a column beside level 1.

    Level k begins h1 - floor(h1 / 2^(k-2)) + 3 (k - 2) rows below level 2, h1 being the height of level 1: the rows of
    all levels between are at most that many, as floor(n / 2) <= n - floor(n / 2).
    """
    if level == 1:
        return 0, 0
    across, down = level_size(width, height, 1)
    return across + 2 * BORDER, down - (down >> (level - 2)) + LEVEL_ROWS * (level - 2)


def chain_size(width: int, height: int, levels: int) -> tuple[int, int]:
    """Return width and height of a chain in texels, with borders; half of it if the image is deep."""
    (first, down), (second, _) = level_size(width, height, 1), level_size(width, height, 2)
    return first + 2 * BORDER + (levels > 1) * (second + 2 * BORDER), down + LEVEL_ROWS * levels


def _bordered(pixels: NDArray[Any], modes: tuple[Any, Any]) -> NDArray[Any]:
    """Return pixels with a border by the pad modes of both axes."""
    rows = np.pad(pixels, ((BORDER, BORDER), (0, 0), (0, 0)), mode=modes[1])
    return np.pad(rows, ((0, 0), (BORDER, BORDER), (0, 0)), mode=modes[0])


def _octets(pixels: NDArray[Any], deep: bool) -> NDArray[np.uint8]:
    """Return pixels as bytes; if they are deep, the high bytes above the low ones."""
    if deep:
        pixels = np.concatenate([pixels >> 8, pixels & 255])
    return np.ascontiguousarray(pixels, np.uint8)


class _Rectangle(NamedTuple):
    """What one rectangle of the atlas holds: an image's finest level, or its chain."""

    width: int
    height: int
    owner: int
    is_chain: bool


def _pack(images: list[AtlasImage], limit: int) -> Atlas:
    """Place images of at most `limit` texels a side, on pages of the side that wastes least."""
    sizes = [fitting_size(i.image.pixels.shape[1], i.image.pixels.shape[0], limit) for i in images]
    deep = [i.is_deep and 2 * (h + 2 * BORDER) <= MAX_TEXTURE_SIDE for i, (_, h) in zip(images, sizes, strict=True)]
    levels = [level_count(*size) if image.has_levels else 0 for image, size in zip(images, sizes, strict=True)]
    rectangles = []
    for k, (width, height) in enumerate(sizes):
        halves = 1 + deep[k]
        rectangles.append(_Rectangle(width + 2 * BORDER, (height + 2 * BORDER) * halves, k, False))
        if levels[k]:
            across, down = chain_size(width, height, levels[k])
            rectangles.append(_Rectangle(across, down * halves, k, True))
    rectangles.sort(key=lambda r: (r.height, r.width), reverse=True)
    # Try pages that hold the largest rectangle, or the tallest chain, a few times.
    largest = max((max(r.width, r.height) for r in rectangles), default=MIN_PAGE)
    tallest = max((r.height for r in rectangles if r.is_chain), default=MIN_PAGE)
    sides = {int(side * factor) for side in (largest, tallest) for factor in SIDES}
    sides = {min(max(side, largest, MIN_PAGE), MAX_TEXTURE_SIDE) for side in sides}
    area = sum(r.width * r.height for r in rectangles)
    sides = {side for side in sides if side == max(sides) or side * side * MAX_LAYERS >= area}
    shelves = {side: list(_shelve(rectangles, side)) for side in sorted(sides)}
    layers = {side: 1 + max((layer for layer, _, _ in found), default=0) for side, found in shelves.items()}
    fitting = [side for side in sides if layers[side] <= MAX_LAYERS] or [max(sides)]
    page = min(fitting, key=lambda side: (side * side * layers[side], side))
    # Collect the places of both rectangles.
    at: dict[tuple[int, bool], tuple[int, int, int]] = {}
    for r, (layer, x, y) in zip(rectangles, shelves[page], strict=True):
        at[r.owner, r.is_chain] = (layer, x + BORDER, y + BORDER)
    places = {
        image: Place(*at[k, False], *sizes[k], deep[k], levels[k], at.get((k, True), (0, 0, 0)))
        for k, image in enumerate(images)
    }
    return Atlas(page, layers[page], places)


def _shelve(rectangles: list[_Rectangle], page: int) -> Iterator[tuple[int, int, int]]:
    """Yield layer and corner of each rectangle, the tallest first: on the first shelf with room, else on a new one."""
    shelves: list[list[int]] = []  # layer, y, height, used width
    layer = end = 0  # of the shelves so far
    for r in rectangles:
        shelf = next((s for s in shelves[-OPEN_SHELVES:] if s[3] + r.width <= page and r.height <= s[2]), None)
        if shelf is None:
            if end + r.height > page:
                layer, end = layer + 1, 0
            shelf = [layer, end, r.height, 0]
            shelves.append(shelf)
            end += r.height
        yield shelf[0], shelf[3], shelf[1]
        shelf[3] += r.width
