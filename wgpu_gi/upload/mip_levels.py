"""Mip levels of a texture: each level halves the one before, by the exact mean of areas.

Williams 1983, "Pyramidal Parametrics". A side of n texels becomes floor(n / 2), at least 1; of odd sides, each new
texel averages three old ones by the lengths that it covers. Colours are averaged as light. An alpha test keeps the
share of the texture that it passes (Castano 2010, "Computing Alpha Mipmaps"). Colours with alpha are weighted by it.
Normals are averaged as vectors, and alpha holds 1 - sigma: sigma^2 is the variance of the slopes per axis, by which
roughness grows (Toksvig 2005, "Mipmapping Normal Maps"). Departures: alpha is mapped by two linear pieces instead of a
factor, which keeps it below 1; the variance is that of the vectors divided by their squared mean, which allows maps
whose vectors are not of unit length.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..pictures.color import LINEAR_OF_CODE, srgb_from_linear

Content = Literal["color", "blend", "mask", "data", "normal"]  # blend, mask: colours with alpha, with an alpha test
LIGHT: tuple[Content, ...] = ("color", "blend", "mask")  # contents that are sRGB-coded
Plane = NDArray[np.float32]

_LINEAR = LINEAR_OF_CODE.astype(np.float32)
# sRGB codes over the square root of light, in which they are nearly even: an entry is 1/60 of a code at most.
_ROOTS = 1 << 14
_CODE_OF_ROOT = np.round(255.0 * srgb_from_linear(np.linspace(0.0, 1.0, _ROOTS + 1) ** 2)).astype(np.uint8)
LEAST_WEIGHT = 1.0 / 255.0  # of a colour with alpha 0: where no texel of an area is opaque, it has their mean colour
COVERAGE_ERROR = 0.2  # of the smaller share, passing or not: a mask's levels end where it is exceeded
SAMPLED = 64  # texels a side: the coverage of smaller levels is counted at FINE x FINE points of each texel
FINE = 4
BISECTIONS = 8  # as alpha has 8 bits


def level_count(width: int, height: int) -> int:
    """Return the number of levels below the finest: the last has one texel."""
    return max(width, height).bit_length() - 1


def level_size(width: int, height: int, level: int) -> tuple[int, int]:
    """Return the size of a level in texels."""
    return max(width >> level, 1), max(height >> level, 1)


def mip_levels(pixels: NDArray[Any], content: Content, cutoff: float = 0.5) -> list[NDArray[Any]]:
    """Return all levels of pixels (height, width, 4) of uint8, or uint16 for normals, the finest first.

    `cutoff`: the alpha that a mask's test passes from. A mask's levels end where no alpha keeps the share that passes:
    its holes are smaller than texels. The alpha of normals is replaced by 1 - sigma, 1 on the finest level.
    """
    count = level_count(pixels.shape[1], pixels.shape[0])
    if content == "normal":
        return _normal_levels(pixels, count)
    light = content in LIGHT
    largest = np.float32(np.iinfo(pixels.dtype).max)
    # Decode; colours with alpha are multiplied by their weight, which comes last.
    plane = np.take(_LINEAR, pixels) if light else pixels.astype(np.float32) * (1 / largest)
    share = 0.0
    if light:
        plane[..., 3] = pixels[..., 3] * (1 / largest)
    if content == "mask":
        share = _coverage(plane[..., 3], cutoff)
    if content in ("blend", "mask"):
        weight = np.maximum(plane[..., 3:], np.float32(LEAST_WEIGHT))
        plane[..., :3] *= weight
        plane = np.concatenate([plane, weight], 2)
    # Halve, and encode each level.
    levels = [pixels]
    for _ in range(count):
        plane = halved(plane)
        colors, alpha = plane[..., :3], plane[..., 3]
        if content in ("blend", "mask"):
            colors = colors / plane[..., 4:]
        if content == "mask":
            alpha = _keep_coverage(alpha, cutoff, share)
            if abs(_coverage(alpha, cutoff) - share) > COVERAGE_ERROR * min(share, 1.0 - share):
                break
        level = np.empty((*plane.shape[:2], 4), pixels.dtype)
        level[..., :3] = _srgb_codes(colors) if light else np.rint(colors * largest)
        level[..., 3] = np.rint(alpha * largest)
        levels.append(level)
    return levels


def halved(plane: Plane) -> Plane:
    """Return (height, width, channels) averaged to half the size on both axes."""
    return _halved_rows(_halved_rows(plane).transpose(1, 0, 2)).transpose(1, 0, 2)


def _halved_rows(plane: Plane) -> Plane:
    """Return the means of pairs of rows; of an odd number of rows, of the lengths that each new row covers."""
    rows = len(plane)
    half = rows // 2
    if rows == 1:
        return plane
    if rows % 2 == 0:
        mean = plane[0::2] + plane[1::2]
        mean *= np.float32(0.5)
        return mean
    # Row i covers (2 + 1 / half) rows from row 2i + i / half on.
    i = np.arange(half, dtype=np.float32)[:, None, None]
    middle = plane[1:-1:2] * np.float32(half)
    return (plane[0:-2:2] * (half - i) + middle + plane[2::2] * (i + 1)) / np.float32(rows)


def _normal_levels(pixels: NDArray[Any], count: int) -> list[NDArray[Any]]:
    """Return the levels of a map of normals; alpha holds 1 - sigma."""
    largest = np.float32(np.iinfo(pixels.dtype).max)
    vectors = pixels[..., :3].astype(np.float32) * np.float32(2.0 / largest) - np.float32(1.0)
    # Average the vectors and their squared lengths.
    plane = np.concatenate([vectors, (vectors * vectors).sum(2, keepdims=True)], 2)
    first = pixels.copy()
    first[..., 3] = np.iinfo(pixels.dtype).max
    levels = [first]
    for _ in range(count):
        plane = halved(plane)
        squared = np.maximum((plane[..., :3] ** 2).sum(2), np.float32(1e-6))
        sigma = np.sqrt(np.maximum(plane[..., 3] - squared, 0.0) / (2.0 * squared))
        unit = plane[..., :3] / np.sqrt(squared)[..., None]
        level = np.empty((*plane.shape[:2], 4), pixels.dtype)
        level[..., :3] = np.round(np.clip(unit * 0.5 + 0.5, 0.0, 1.0) * largest)
        level[..., 3] = np.round((1.0 - np.minimum(sigma, 1.0)) * largest)
        levels.append(level)
    return levels


def _srgb_codes(linear: Plane) -> NDArray[np.uint8]:
    """Return the nearest sRGB codes of linear values in 0..1."""
    roots = np.sqrt(linear) * np.float32(_ROOTS) + np.float32(0.5)
    return np.take(_CODE_OF_ROOT, np.minimum(roots, _ROOTS).astype(np.int16))


def _coverage(alpha: Plane, cutoff: float) -> float:
    """Return the share of a level that passes the alpha test."""
    return float((_filtered(alpha) >= cutoff).mean())


def _keep_coverage(alpha: Plane, cutoff: float, share: float) -> Plane:
    """Return alpha, mapped so that `share` of the level passes the test as nearly as possible."""
    if share in (0.0, 1.0) or not 0.0 < cutoff < 1.0:
        return alpha
    # Find the alpha to move to the cutoff, by bisection: a higher one lets less pass.
    low, high = 0.0, 1.0
    mapped, error = alpha, abs(_coverage(alpha, cutoff) - share)
    for _ in range(BISECTIONS):
        border = (low + high) / 2
        tried = np.interp(alpha, (0.0, border, 1.0), (0.0, cutoff, 1.0)).astype(np.float32)
        passing = _coverage(tried, cutoff)
        if abs(passing - share) < error:
            mapped, error = tried, abs(passing - share)
        low, high = (border, high) if passing > share else (low, border)
    return mapped


def _filtered(alpha: Plane) -> Plane:
    """Return alpha as bilinear filters see it: at FINE x FINE points of each texel, of large levels at the texels."""
    if max(alpha.shape) > SAMPLED:
        return alpha
    at = (np.arange(FINE, dtype=np.float32) + 0.5) / FINE - 0.5
    for axis in (0, 1):
        before, after = np.roll(alpha, 1, axis), np.roll(alpha, -1, axis)
        parts = [alpha * (1 - abs(t)) + (after if t > 0 else before) * abs(t) for t in at]
        alpha = np.stack(parts, axis + 1).reshape([n * FINE if k == axis else n for k, n in enumerate(alpha.shape)])
    return alpha
