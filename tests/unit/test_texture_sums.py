"""Means of textures over boxes: against the texels themselves, for every wrap mode, filter and block size."""

from __future__ import annotations

import numpy as np
import pytest

from wgpu_gi.pictures.color import LINEAR_OF_CODE, REC709_LUMINANCE
from wgpu_gi.scene.scene import Image, Texture
from wgpu_gi.upload import texture_sums
from wgpu_gi.upload.texture_sampling import _wrap
from wgpu_gi.upload.texture_sums import TextureSums


def by_texels(texture, low, high):
    """Return the mean over a box of integer texels, [low, high), and its squared luminance."""
    height, width = texture.image.pixels.shape[:2]
    columns = _wrap(np.arange(low[0], high[0]), width, texture.wrap_u)
    rows = _wrap(np.arange(low[1], high[1]), height, texture.wrap_v)
    colors = LINEAR_OF_CODE[texture.image.pixels[rows[:, None], columns, :3]].reshape(-1, 3)
    return np.append(colors.mean(0), ((colors @ REC709_LUMINANCE) ** 2).mean())


@pytest.mark.parametrize("wrap_u", ["repeat", "clamp", "mirror"])
@pytest.mark.parametrize("wrap_v", ["repeat", "clamp", "mirror"])
def test_a_box_of_texels_has_their_mean(wrap_u, wrap_v):
    """Boxes within, across and far outside the picture; their corners lie within texels, so rounding adds none."""
    pixels = np.random.default_rng(0).integers(0, 256, (7, 5, 4)).astype(np.uint8)
    texture = Texture(Image(pixels), wrap_u, wrap_v, filter="nearest")
    rng = np.random.default_rng(1)
    low = rng.integers(-23, 20, (300, 2))
    high = low + rng.integers(1, 19, (300, 2))
    got = TextureSums(texture).means((low + 0.2) / (5, 7), (high - 0.2) / (5, 7))
    expected = [by_texels(texture, *box) for box in zip(low, high, strict=True)]
    assert np.allclose(got, expected, rtol=1e-4)  # sums of integers, 2^24 to 1


@pytest.mark.parametrize("wrap", ["repeat", "clamp", "mirror"])
@pytest.mark.parametrize("filter", ["nearest", "linear"])
@pytest.mark.parametrize("blocks", [1, 3, 100])
def test_a_box_is_dark_only_where_all_its_points_are(monkeypatch, wrap, filter, blocks):
    """No bright texel is missed, whatever the size of blocks; of dark boxes the mean is exactly zero."""
    monkeypatch.setattr(texture_sums, "MAX_BLOCKS", blocks)
    pixels = np.zeros((11, 13, 4), np.uint8)
    pixels[4, 9], pixels[0, 12] = 255, (0, 0, 1, 0)
    texture = Texture(Image(pixels), wrap, wrap, filter=filter)
    rng = np.random.default_rng(2)
    low = rng.uniform(-3, 3, (500, 2))
    high = low + rng.uniform(0, 0.3, (500, 2))
    got = TextureSums(texture).means(low, high)
    reach = 0.0 if filter == "nearest" else 0.5
    first, last = (np.floor(corner * (13, 11) + side).astype(int) for corner, side in ((low, -reach), (high, reach)))
    bright = np.array([by_texels(texture, a, b + 1)[2] > 0 for a, b in zip(first, last, strict=True)])
    assert (got[bright, 2] > 0).all() and bright.any()
    if blocks == 100:
        wider = np.array([by_texels(texture, a - 1, b + 2)[2] > 0 for a, b in zip(first, last, strict=True)])
        assert (got[~wider, :3] == 0).all() and not wider.all()
