"""The tiles of a picture: they cover it once, and their windows hold the margins."""

from __future__ import annotations

import numpy as np
import pytest

from wgpu_gi.errors import GiError
from wgpu_gi.options import Settings, technique_of
from wgpu_gi.tiles import tile_plan

SIZES = [(1, 1), (96, 54), (640, 360), (700, 500), (8192, 1), (37, 211)]


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("tiles", [1, (32, 32), (50, 7), (1000, 1000), True])
def test_tiles_cover_the_picture_once(size, tiles):
    plan = tile_plan(size, Settings(gi="path"), tiles)
    covered = np.zeros(size[::-1], np.uint8)
    for tile in plan.tiles:
        (x, y), (width, height) = tile.corner, tile.size
        assert width > 0 and height > 0
        covered[y : y + height, x : x + width] += 1
        if isinstance(tiles, tuple):
            assert width <= tiles[0] and height <= tiles[1]
    assert (covered == 1).all()


@pytest.mark.parametrize("gi", ["path", "none", "many-light"])
def test_windows_hold_the_margin_within_the_picture(gi):
    margin, step = technique_of(gi).reach(Settings(gi=gi))
    for size in SIZES:
        for tile in tile_plan(size, Settings(gi=gi), (50, 40)).tiles:
            for k in range(2):
                first, end = tile.window_corner[k], tile.window_corner[k] + tile.window_size[k]
                assert first % step == 0 and 0 <= first <= max(tile.corner[k] - margin, 0)
                assert min(tile.corner[k] + tile.size[k] + margin, size[k]) == end


def test_a_number_of_tiles_makes_a_grid_of_near_squares():
    grids = {4: (2, 2), 6: (3, 2), 7: (7, 1), 16: (4, 4)}
    for number, (columns, rows) in grids.items():
        plan = tile_plan((960, 640), Settings(gi="none"), number)
        assert len(plan.tiles) == number
        assert (len({t.corner[0] for t in plan.tiles}), len({t.corner[1] for t in plan.tiles})) == (columns, rows)


@pytest.mark.parametrize("tiles", [0, -1, False, None, 1.5, "4", (0, 4), (4,), (4, 4, 4), ("a", 1), 10**9, 2000])
def test_wrong_numbers_and_sizes_of_tiles_are_refused(tiles):
    with pytest.raises(GiError, match="tiles must be"):
        tile_plan((20, 10), Settings(gi="path"), tiles)


@pytest.mark.parametrize("size", [(0, 1), (8193, 1), (1,), None, (1.5, 2)])
def test_wrong_sizes_are_refused(size):
    with pytest.raises(GiError, match="size"):
        tile_plan(size, Settings(gi="path"), 1)


@pytest.mark.parametrize(
    ("gi", "change", "words"),
    [
        ("ssdo", {}, "all over the picture"),
        ("ssil", {}, "all over the picture"),
        ("ssao", {}, "all over the picture"),
        ("path", {"path.adaptive": True}, "path.adaptive"),
        ("many-light", {"gather.adaptive": True}, "gather.adaptive"),
        ("many-light", {"ssdo.near_field": True}, "ssdo.near_field"),
        ("none", {"direct.edges": False, "direct.contacts": 8}, "direct.contacts"),
    ],
)
def test_what_needs_the_whole_picture_is_refused(gi, change, words):
    settings = Settings(gi=gi)
    for name, value in change.items():
        section, _, field = name.partition(".")
        setattr(getattr(settings, section), field, value)
    with pytest.raises(GiError, match=words):
        tile_plan((64, 64), settings, 4)
