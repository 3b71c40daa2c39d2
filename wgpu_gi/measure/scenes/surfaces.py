"""Materials and small textures for generated scenes. Albedos are at most 0.95."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ...scene.scene import Image, Material, Mesh, Texture, Wrap
from .draws import Draws, Rgb

Pixels = NDArray[np.float64]
WRAPS: tuple[Wrap, ...] = ("repeat", "clamp", "mirror")
MOST_SRGB = 0.977  # the sRGB value of an albedo of 0.95

# ------------------------------------------------------------------------------------------------ textures


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


# ------------------------------------------------------------------------------------------------ materials


def rgba(color: Rgb) -> tuple[float, float, float, float]:
    """Return an opaque base colour."""
    return (*color, 1.0)


def grey(value: float) -> Rgb:
    """Return a colour of three equal channels."""
    return value, value, value


def _made(draws: Draws, low: float, high: float, metallic: float, rough_low: float, rough_high: float) -> Material:
    """Return a material with a colour and a roughness from ranges."""
    roughness = draws.uniform(rough_low, rough_high)
    return Material("", rgba(draws.color(low, high)), metallic, roughness)


def _textured(draws: Draws) -> Material:
    return Material("", (1.0, 1.0, 1.0, 1.0), base_color_texture=texture(draws, pattern(draws), "colors"))


def _roughness_map(draws: Draws) -> Material:
    result = _made(draws, 0.3, 0.95, 1.0, 1.0, 1.0)
    result.metallic_roughness_texture = texture(draws, pattern(draws), "roughness and metalness")
    return result


def _bumpy(draws: Draws, metallic: float, rough_low: float) -> Material:
    result = _made(draws, 0.3, 0.9, metallic, rough_low, 1.0)
    result.normal_texture = normal_map(draws)
    result.normal_scale = draws.uniform(0.3, 1.5)
    return result


def _masked(draws: Draws) -> Material:
    result = Material("", rgba(draws.color(0.5, 0.95)), alpha_mode="mask", alpha_cutoff=draws.uniform(0.2, 0.8))
    result.base_color_texture, result.double_sided = holes(draws), True
    return result


def _glow(draws: Draws) -> Material:
    low = draws.log_uniform(0.01, 0.5)
    return Material("", rgba(draws.color(0.1, 0.9)), emission=draws.color(0.0, low), double_sided=draws.chance(0.5))


def screen(draws: Draws, radiance: float) -> Material:
    """Return an emitter with a texture: a pattern, or a few bright texels."""
    bright = few_bright(draws) if draws.chance(0.6) else texture(draws, pattern(draws), "picture", plain=True)
    return Material("screen", rgba(grey(0.05)), emission=grey(radiance), emission_texture=bright)


SURFACES: dict[str, Callable[[Draws], Material]] = {
    "matte": lambda d: Material("", rgba(grey(d.uniform(0.2, 0.8)))),
    "colored": lambda d: _made(d, 0.02, 0.9, 0.0, 1.0, 1.0),
    "white": lambda d: Material("", rgba(grey(0.95))),
    "dark": lambda d: _made(d, 0.01, 0.08, 0.0, 0.8, 1.0),
    "clay": lambda d: _made(d, 0.2, 0.8, 0.0, 0.4, 0.9),
    "glossy": lambda d: _made(d, 0.05, 0.9, 0.0, 0.05, 0.4),
    "polished": lambda d: _made(d, 0.02, 0.8, 0.0, 0.0, 0.03),
    "metal": lambda d: _made(d, 0.4, 0.95, 1.0, 0.15, 0.5),
    "rough_metal": lambda d: _made(d, 0.4, 0.95, 1.0, 0.5, 1.0),
    "mirror": lambda d: _made(d, 0.8, 0.95, 1.0, 0.0, 0.05),
    "dark_metal": lambda d: _made(d, 0.02, 0.3, 1.0, 0.05, 0.6),
    "half_metal": lambda d: _made(d, 0.2, 0.9, d.uniform(0.2, 0.8), 0.1, 0.9),
    "painted": lambda d: Material("painted", rgba(grey(0.95))),
    "textured": _textured,
    "roughness_map": _roughness_map,
    "bumpy": lambda d: _bumpy(d, 0.0, 0.3),
    "bumpy_metal": lambda d: _bumpy(d, 1.0, 0.1),
    "masked": _masked,
    "glow": _glow,
    "screen": lambda d: screen(d, d.log_uniform(0.5, 20.0)),
    "unlit": lambda d: Material("", rgba(d.color(0.05, 0.6)), unlit=True),
}
WALLS = ("matte", "colored", "white", "white", "clay", "textured", "dark", "bumpy", "glossy", "rough_metal")
GLOSSY = ("glossy", "polished", "metal", "rough_metal", "mirror", "dark_metal", "half_metal", "roughness_map", "bumpy",
          "bumpy_metal")  # fmt: skip
TEXTURED = ("textured", "textured", "painted", "roughness_map", "bumpy", "masked", "screen")


def surface(draws: Draws, names: tuple[str, ...] = tuple(SURFACES)) -> Material:
    """Return a material of one of the kinds `names` of SURFACES, which becomes its name."""
    kind = draws.choice(names)
    material = SURFACES[kind](draws)
    material.name = kind
    return material


def paint(draws: Draws, mesh: Mesh) -> Mesh:
    """Give a mesh of the material "painted" random vertex colours, and any mesh seldom a second texture set."""
    if mesh.materials[0].name == "painted":
        colors = np.ones((len(mesh.positions), 4), np.float32)
        colors[:, :3] = draws.array(len(colors), 3)
        mesh.colors = colors
    slot = mesh.materials[0].base_color_texture
    if slot is not None and mesh.texcoords0 is not None and draws.chance(0.2):
        mesh.texcoords1 = (mesh.texcoords0[:, ::-1] * np.float32(0.75)).copy()
        slot.texcoord = 1
    return mesh
