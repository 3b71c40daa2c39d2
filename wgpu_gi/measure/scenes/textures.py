"""Small textures and colours for generated scenes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...scene.scene import Image, Texture, Wrap
from .draws import Draws, Rgb

Pixels = NDArray[np.float64]
WRAPS: tuple[Wrap, ...] = ("repeat", "clamp", "mirror")
MOST_SRGB = 0.977  # the sRGB value of an albedo of 0.95


def image(pixels: Pixels, name: str) -> Image:
    """Return an image of (height, width, 3 or 4) values in [0, 1]; alpha is 1 if it is missing."""
    height, width, channels = pixels.shape
    rgba = np.ones((height, width, 4))
    rgba[..., :channels] = pixels
    return Image(np.round(np.clip(rgba, 0, 1) * 255).astype(np.uint8), name)


def pattern(draws: Draws) -> Pixels:
    """Return a colour picture (n, n, 3): checks, stripes, noise or a gradient."""
    n = draws.choice((2, 8, 16, 32))
    y, x = np.mgrid[:n, :n]
    a, b = np.array(draws.color(0.02, MOST_SRGB)), np.array(draws.color(0.02, MOST_SRGB))
    kind = draws.choice(("checks", "stripes", "noise", "gradient"))
    if kind == "noise":
        return 0.02 + (MOST_SRGB - 0.02) * draws.array(n, n, 3)
    share = {"checks": (x + y) % 2, "stripes": (x // max(n // 8, 1)) % 2, "gradient": y / (n - 1)}[kind]
    return a + (b - a) * share[..., None]


def texture(draws: Draws, pixels: Pixels, name: str, plain: bool = False) -> Texture:
    """Return a texture with a random sampler and transform; `plain` is one that shows the image once."""
    if plain:
        return Texture(image(pixels, name), "clamp", "clamp")
    result = Texture(image(pixels, name), draws.choice(WRAPS), draws.choice(WRAPS))
    result.filter = "nearest" if draws.chance(0.3) else "linear"
    if draws.chance(0.6):
        result.scale = (draws.log_uniform(0.5, 6.0), draws.log_uniform(0.5, 6.0))
        result.offset = (draws.uniform(-1, 1), draws.uniform(-1, 1))
        result.rotation = draws.uniform(-3.0, 3.0) if draws.chance(0.5) else 0.0
    return result


def normal_map(draws: Draws) -> Texture:
    """Return a tangent-space normal map: bumps, a quilt or noise, of slopes up to about 1."""
    n = draws.choice((8, 16, 32))
    y, x = np.mgrid[:n, :n] * (2 * np.pi / n)
    slope = draws.uniform(0.1, 1.0)
    waves = draws.integer(1, 3)
    dx, dy = np.sin(waves * x), np.sin(waves * y)
    if draws.chance(0.3):
        dx, dy = 2 * draws.array(2, n, n) - 1
    normals = np.stack([slope * dx, slope * dy, np.ones_like(dx)], axis=-1)
    normals /= np.sqrt((normals * normals).sum(-1, keepdims=True))
    result = texture(draws, normals / 2 + 0.5, "bumps")
    result.wrap_u = result.wrap_v = "repeat"
    return result


def holes(draws: Draws) -> Texture:
    """Return a colour picture with an alpha of leaves, bars or random holes."""
    n = draws.choice((8, 16, 32))
    y, x = (np.mgrid[:n, :n] + 0.5) / n
    kind = draws.choice(("leaf", "bars", "random"))
    if kind == "leaf":
        alpha = ((x - 0.5) ** 2 / 0.12 + (y - 0.5) ** 2 / 0.24 < 1).astype(np.float64)
    elif kind == "bars":
        alpha = (np.floor(x * 6) % 2).astype(np.float64)
    else:
        alpha = draws.array(n, n)
    color = np.array(draws.color(0.1, MOST_SRGB)) * (0.6 + 0.4 * draws.array(n, n, 1))
    return texture(draws, np.concatenate([color, alpha[..., None]], axis=-1), "holes", plain=draws.chance(0.7))


def few_bright(draws: Draws) -> Texture:
    """Return an emission picture that is black but for one to six bright texels."""
    n = draws.choice((8, 16, 32))
    pixels = np.zeros((n, n, 3))
    for _ in range(draws.integer(1, 6)):
        pixels[draws.integer(0, n - 1), draws.integer(0, n - 1)] = draws.color(0.5, 1.0)
    result = texture(draws, pixels, "bright texels", plain=draws.chance(0.5))
    result.filter = draws.choice(("nearest", "linear"))
    return result


def rgba(color: Rgb) -> tuple[float, float, float, float]:
    """Return an opaque base colour."""
    return (*color, 1.0)


def grey(value: float) -> Rgb:
    """Return a colour of three equal channels."""
    return value, value, value
