"""The texture atlas: images and their mip levels do not overlap, stay inside their layer, and have borders."""

from __future__ import annotations

import numpy as np
import pytest

from wgpu_gi.scene.scene import Image
from wgpu_gi.upload.mip_levels import level_size, mip_levels
from wgpu_gi.upload.texture_atlas import (
    BORDER,
    MAX_IMAGE_SIDE,
    MAX_LAYERS,
    MIN_PAGE,
    AtlasImage,
    atlas_rectangles,
    level_corner,
    pack_atlas,
)
from wgpu_gi.webgpu_limits import MAX_TEXTURE_SIDE


def blank(width, height, content="color", dtype=np.uint8, levels=True):
    """Return an image without memory of its own."""
    return AtlasImage(Image(np.broadcast_to(dtype(0), (height, width, 4))), content, "repeat", "clamp", levels)


def noise(width, height, content="data", dtype=np.uint8, wrap=("repeat", "repeat")):
    rng = np.random.default_rng(width + height)
    pixels = rng.integers(0, np.iinfo(dtype).max, (height, width, 4)).astype(dtype)
    return AtlasImage(Image(pixels), content, *wrap, True)


def level_place(place, level):
    """Return layer, corner and size of a level in the atlas, without its border."""
    if level == 0:
        return place.layer, place.x, place.y, place.width, place.height
    layer, x, y = place.chain
    across, down = level_corner(place.width, place.height, level)
    return layer, x + across, y + down, *level_size(place.width, place.height, level)


def check(images):
    """Pack images, assert that no texel belongs to two levels, and return the atlas."""
    atlas = pack_atlas(images)
    assert MIN_PAGE <= atlas.page <= MAX_TEXTURE_SIDE and atlas.places.keys() == set(images)
    pages = np.zeros((atlas.layers, atlas.page, atlas.page), bool)
    for image, place in atlas.places.items():
        assert (place.height, place.width) == image.image.pixels.shape[:2] and not place.deep
        for level in range(place.levels + 1):
            layer, x, y, width, height = level_place(place, level)
            x, y, width, height = x - BORDER, y - BORDER, width + 2 * BORDER, height + 2 * BORDER
            assert 0 <= layer < atlas.layers and x >= 0 and y >= 0
            assert x + width <= atlas.page and y + height <= atlas.page
            texels = pages[layer, y : y + height, x : x + width]
            assert not texels.any()
            texels[:] = True
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
        assert pages.mean() > 0.6  # little is wasted


def test_images_of_one_size_leave_little_unused():
    for side in (512, 1024, 2048):
        _, pages = check([blank(side, side) for _ in range(12)])
        assert pages.mean() > 0.75


def test_odd_shapes():
    check([blank(1, 1)])
    check([blank(256, 256), blank(1, 1)])
    check([blank(257, 1)])
    check([blank(1000, 1), blank(1, 1000), blank(1000, 1000), blank(999, 2), blank(24, 24)])
    check([blank(MAX_IMAGE_SIDE, 1), blank(1, MAX_IMAGE_SIDE)])


def test_an_image_with_two_wrap_modes_has_two_places():
    image = blank(10, 10)
    assert pack_atlas([image, image]).places.keys() == {image}
    assert len(pack_atlas([image, image._replace(wrap_u="mirror")]).places) == 2


def test_without_mip_filter_only_the_finest_level_is_stored():
    image = blank(64, 32, levels=False)
    place = pack_atlas([image]).places[image]
    assert place.levels == 0 and len(atlas_rectangles(image, place)[1]) == 1


def test_images_that_are_too_large_or_too_many_are_scaled_down():
    image = blank(2 * MAX_IMAGE_SIDE, 20)
    place = pack_atlas([image]).places[image]
    assert (place.width, place.height) == (MAX_IMAGE_SIDE, 10)
    # Too many layers: all images get smaller, until they fit.
    images = [blank(MAX_IMAGE_SIDE, MAX_IMAGE_SIDE) for _ in range(MAX_LAYERS)]
    atlas = pack_atlas(images)
    assert {place.width for place in atlas.places.values()} == {MAX_TEXTURE_SIDE // 2 - 2 * BORDER}
    assert atlas.layers <= MAX_LAYERS
    assert pack_atlas(images[:128]).places[images[0]].width == MAX_IMAGE_SIDE


@pytest.mark.parametrize("wrap", [("repeat", "clamp"), ("clamp", "mirror"), ("mirror", "repeat")])
@pytest.mark.parametrize("size", [(1, 1), (7, 5), (32, 8), (3, 40)])
def test_every_level_lies_where_the_closed_form_says_with_its_neighbours_around(size, wrap):
    image = noise(*size, wrap=wrap)
    place, rectangles = atlas_rectangles(image, pack_atlas([noise(9, 9), image]).places[image])
    pages = np.zeros((4, 512, 512, 4), np.uint8)
    for (layer, x, y), pixels in rectangles:
        pages[layer, y : y + pixels.shape[0], x : x + pixels.shape[1]] = pixels
    for number, level in enumerate(mip_levels(image.image.pixels, "data")):
        layer, x, y, width, height = level_place(place, number)
        assert level.shape[:2] == (height, width)
        columns, rows = (np.arange(-1, n + 1) for n in (width, height))
        rows, columns = (
            np.clip(k, 0, n - 1)
            if mode == "clamp"
            else k % n
            if mode == "repeat"
            else np.where(k % (2 * n) < n, k % (2 * n), 2 * n - 1 - k % (2 * n))
            for k, n, mode in ((rows, height, wrap[1]), (columns, width, wrap[0]))
        )
        stored = pages[layer, y - 1 : y + height + 1, x - 1 : x + width + 1]
        np.testing.assert_array_equal(stored, level[rows][:, columns])


def test_images_of_16_bits_lie_as_high_bytes_above_low_bytes():
    deep, flat = noise(50, 30, "normal", np.uint16), blank(50, 60, "normal")
    places = pack_atlas([flat, deep]).places
    assert places[deep].deep and not places[flat].deep
    _, ((_, stored), (_, chain)) = atlas_rectangles(deep, places[deep])
    values = 256 * stored[:32].astype(int) + stored[32:]
    np.testing.assert_array_equal(values[1:-1, 1:-1, :3], deep.image.pixels[..., :3])
    levels = mip_levels(deep.image.pixels, "normal")
    half = len(chain) // 2
    values = 256 * chain[:half].astype(int) + chain[half:]
    np.testing.assert_array_equal(values[1:16, 1:26], levels[1])
    # Without room for both halves it has 8 bits.
    tall = AtlasImage(Image(np.zeros((MAX_IMAGE_SIDE, 1, 4), np.uint16)), "normal", "repeat", "repeat", True)
    place = pack_atlas([tall]).places[tall]
    assert not place.deep
    for _, pixels in atlas_rectangles(tall, place)[1]:
        assert pixels.dtype == np.uint8
