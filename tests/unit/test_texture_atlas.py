"""The texture atlas: images do not overlap and stay inside their layer."""

from __future__ import annotations

import numpy as np
import pytest

from wgpu_gi.scene.scene import Image
from wgpu_gi.upload.texture_atlas import MAX_LAYERS, MIN_PAGE, atlas_pixels, pack_atlas
from wgpu_gi.webgpu_limits import MAX_TEXTURE_SIDE


def blank(width, height, name=""):
    """Return an image without memory of its own."""
    return Image(np.broadcast_to(np.uint8(0), (height, width, 4)), name)


def check(images):
    """Pack images, assert that no texel belongs to two of them, and return the atlas."""
    atlas = pack_atlas(images)
    assert atlas.page & (atlas.page - 1) == 0 and MIN_PAGE <= atlas.page <= MAX_TEXTURE_SIDE
    assert atlas.places.keys() == {id(i) for i in images}
    pages = np.zeros((atlas.layers, atlas.page, atlas.page), bool)
    for image in images:
        layer, x, y, width, height, deep = atlas.places[id(image)]
        assert (height, width) == image.pixels.shape[:2] and not deep
        assert 0 <= layer < atlas.layers and x >= 0 and y >= 0 and x + width <= atlas.page and y + height <= atlas.page
        place = pages[layer, y : y + height, x : x + width]
        assert not place.any()
        place[:] = True
    return atlas, pages


def test_without_images_there_is_one_small_layer():
    atlas = pack_atlas([])
    assert (atlas.page, atlas.layers, atlas.places) == (MIN_PAGE, 1, {})


@pytest.mark.parametrize("seed", range(8))
def test_random_images_do_not_overlap(seed):
    rng = np.random.default_rng(seed)
    largest = [40, 300, 700, 2000][seed % 4]
    sizes = rng.integers(1, largest, (rng.integers(1, 60), 2))
    atlas, pages = check([blank(*size) for size in sizes.tolist()])
    if atlas.layers > 2:
        assert pages.mean() > 0.3  # little is wasted


def test_images_of_one_size_fill_the_layers():
    atlas, pages = check([blank(512, 512) for _ in range(64)])
    assert pages.all() and atlas.layers <= 16


def test_odd_shapes():
    check([blank(1, 1)])
    check([blank(256, 256), blank(1, 1)])
    check([blank(257, 1)])
    check([blank(1000, 1), blank(1, 1000), blank(1000, 1000), blank(999, 2), blank(24, 24)])
    atlas = pack_atlas([blank(MAX_TEXTURE_SIDE, 1), blank(1, MAX_TEXTURE_SIDE)])
    assert atlas.page == MAX_TEXTURE_SIDE


def test_an_image_listed_twice_has_one_place():
    image = blank(10, 10)
    assert pack_atlas([image, image]).places.keys() == {id(image)}


def test_images_that_are_too_large_or_too_many_are_scaled_down():
    place = pack_atlas([blank(2 * MAX_TEXTURE_SIDE, 20)]).places
    assert [tuple(p) for p in place.values()] == [(0, 0, 0, MAX_TEXTURE_SIDE, 10, False)]
    # One layer too many: all images get half the sides, four to a layer.
    images = [blank(MAX_TEXTURE_SIDE, MAX_TEXTURE_SIDE) for _ in range(MAX_LAYERS + 1)]
    atlas = pack_atlas(images)
    assert {place.width for place in atlas.places.values()} == {MAX_TEXTURE_SIDE // 2}
    assert atlas.layers <= MAX_LAYERS
    assert pack_atlas(images[1:]).layers == MAX_LAYERS


def test_images_of_16_bits_lie_as_high_bytes_above_low_bytes():
    pixels = np.random.default_rng(0).integers(0, 65536, (30, 50, 4)).astype(np.uint16)
    deep, flat = Image(pixels), Image(np.full((60, 50, 4), 9, np.uint8))
    places = pack_atlas([flat, deep], {id(deep)}).places
    assert places[id(deep)] == (0, 50, 0, 50, 30, True) and not places[id(flat)].deep
    stored = atlas_pixels(deep, places[id(deep)], srgb=False).astype(int)
    np.testing.assert_array_equal(256 * stored[:30] + stored[30:], pixels)
    # Without room for both halves it has 8 bits.
    tall = Image(np.zeros((MAX_TEXTURE_SIDE, 1, 4), np.uint16))
    place = pack_atlas([tall], {id(tall)}).places[id(tall)]
    assert not place.deep and atlas_pixels(tall, place, srgb=False).dtype == np.uint8
