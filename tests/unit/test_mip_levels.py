"""Mip levels: means of light, the share that an alpha test passes, and the variance of normals."""

from __future__ import annotations

import numpy as np
import pytest

from wgpu_gi.pictures.color import LINEAR_OF_CODE
from wgpu_gi.upload.mip_levels import level_count, level_size, mip_levels


@pytest.mark.parametrize("size", [(1, 1), (2, 2), (3, 3), (16, 16), (37, 5), (1, 9), (64, 48), (100, 75)])
def test_each_level_has_the_mean_of_the_picture(size):
    """The exact area filter keeps the mean at every size, odd ones, too; of light, not of codes."""
    pixels = np.random.default_rng(0).integers(0, 256, (*size[::-1], 4)).astype(np.uint8)
    for content in ("color", "data"):
        levels = mip_levels(pixels, content)
        assert len(levels) == level_count(*size) + 1 and levels[-1].shape == (1, 1, 4)
        decode = LINEAR_OF_CODE if content == "color" else np.arange(256) / 255
        for number, level in enumerate(levels):
            assert level.shape[1::-1] == level_size(*size, number)
            slack = 0.006  # half a code, at the steepest part of the curve
            assert np.allclose(decode[level[..., :3]].mean((0, 1)), decode[pixels[..., :3]].mean((0, 1)), atol=slack)


def test_odd_sides_are_averaged_by_the_lengths_that_texels_cover():
    row = np.array([0, 90, 180], np.uint8)
    pixels = np.broadcast_to(row[None, :, None], (1, 3, 4)).copy()
    assert mip_levels(pixels, "data")[1][0, 0, 0] == 90
    row = np.array([10, 50, 100, 150, 250], np.uint8)
    pixels = np.broadcast_to(row[None, :, None], (1, 5, 4)).copy()
    expected = (10 + 50 + 100 / 2) / 2.5, (100 / 2 + 150 + 250) / 2.5
    assert np.allclose(mip_levels(pixels, "data")[1][0, :, 0], expected, atol=0.5)


def leaves(side=256, period=16, radius=5.5):
    """Return green discs, which cover a third of a black and open picture."""
    y, x = np.mgrid[:side, :side] % period - (period - 1) / 2
    pixels = np.zeros((side, side, 4), np.uint8)
    pixels[x**2 + y**2 < radius**2] = (40, 160, 40, 255)
    return pixels


def passing(level, cutoff, fine=8):
    """Return the share of a repeated level that passes an alpha test of its bilinear samples."""
    alpha = level[..., 3] / 255.0
    for axis in (0, 1):
        parts = [alpha * (1 - k / fine) + np.roll(alpha, -1, axis) * (k / fine) for k in range(fine)]
        alpha = np.concatenate(parts, axis)
    return (alpha >= cutoff).mean()


@pytest.mark.parametrize("cutoff", [0.3, 0.7])
def test_an_alpha_test_passes_the_same_share_of_each_level(cutoff):
    pixels = leaves()
    levels = mip_levels(pixels, "mask", cutoff)
    share = passing(pixels, cutoff)
    assert 3 <= len(levels) < 9  # levels end before the discs are smaller than texels
    for level in levels[1:]:
        assert abs(passing(level, cutoff) - share) < 0.25 * share
    # Without care, the discs would vanish or grow.
    plain = passing(mip_levels(pixels, "color")[3], cutoff)
    assert plain < 0.5 * share if cutoff > 0.5 else plain > 1.5 * share


def test_levels_of_blended_colours_keep_the_mean_of_alpha_and_of_what_shows():
    """What shows is alpha times the colour; levels of one texel round both to 8 bits."""
    pixels = np.array([[[250, 0, 0, 255], [0, 0, 250, 51]], [[0, 250, 0, 0], [0, 0, 250, 0]]], np.uint8)
    _, level = mip_levels(pixels, "blend")
    assert level[0, 0, 3] == round((255 + 51) / 4)
    shown = LINEAR_OF_CODE[level[0, 0, :3]] * level[0, 0, 3] / 255
    expected = (LINEAR_OF_CODE[pixels[..., :3]] * (pixels[..., 3:] / 255)).mean((0, 1))
    assert np.allclose(shown, expected, atol=4e-3)


def test_open_texels_do_not_darken_the_colour_of_a_mask():
    for level in mip_levels(leaves(), "mask")[1:]:
        seen = level[level[..., 3] >= 128]
        assert np.abs(seen[:, :3].astype(int) - (40, 160, 40)).max() <= 6


def test_normals_lose_their_slopes_to_variance():
    """A map of slopes +-0.2 becomes flat; its variance per axis is that of the vectors."""
    y, x = np.mgrid[:64, :64]
    slope = np.where((x + y) % 2 == 0, 0.2, -0.2)
    vectors = np.stack([slope, 0 * slope, np.ones_like(slope)], -1) / np.sqrt(1.04)
    pixels = np.full((64, 64, 4), 7, np.uint8)
    pixels[..., :3] = np.round((vectors * 0.5 + 0.5) * 255)
    levels = mip_levels(pixels, "normal")
    assert (levels[0][..., 3] == 255).all()
    for level in levels[1:]:
        normal = level[..., :3] / 255.0 * 2 - 1
        assert np.allclose(normal, (0, 0, 1), atol=0.01)
        sigma = 1 - level[..., 3] / 255.0
        assert np.allclose(sigma, np.sqrt(0.2**2 / 2), atol=0.005)  # the variance is along x; half of it per axis


def test_flat_normals_have_no_variance_at_any_length():
    for code in ((128, 128, 255), (200, 128, 200), (10, 20, 60)):
        pixels = np.full((8, 8, 4), (*code, 255), np.uint8)
        for level in mip_levels(pixels, "normal"):
            assert (level[..., 3] >= 254).all()
