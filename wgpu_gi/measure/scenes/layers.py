"""Materials of generated scenes with Khronos' layers: coats, cloth, brushed metal, other dielectrics, and glass."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ...scene.scene import Material, Texture
from .draws import Draws
from .textures import holes, image, normal_map, pattern, rgba, texture

Maker = Callable[[Draws], Material]


def _base(draws: Draws, metallic: float = 0.0, rough_low: float = 0.1) -> Material:
    return Material("", rgba(draws.color(0.05, 0.9)), metallic, draws.uniform(rough_low, 1.0))


def _coated(draws: Draws, metallic: float) -> Material:
    result = _base(draws, metallic)
    result.clearcoat = draws.choice((1.0, draws.uniform(0.1, 1.0)))
    result.clearcoat_roughness = draws.choice((0.0, draws.uniform(0.0, 0.6)))
    return result


def _orange_peel(draws: Draws) -> Material:
    """Return a coated material whose coat, and perhaps whose base, has bumps."""
    result = _coated(draws, draws.choice((0.0, 1.0)))
    result.clearcoat_normal_texture, result.clearcoat_normal_scale = normal_map(draws), draws.uniform(0.1, 0.8)
    if draws.chance(0.5):
        result.normal_texture = normal_map(draws)
    return result


def _cloth(draws: Draws) -> Material:
    result = _base(draws, rough_low=0.6)
    result.sheen_color = draws.color(0.0, 1.0)
    result.sheen_roughness = draws.uniform(0.0, 1.0)
    return result


def _brushed(draws: Draws) -> Material:
    result = _base(draws, draws.choice((1.0, 1.0, 0.0)))
    result.anisotropy = draws.choice((1.0, draws.uniform(0.1, 1.0)))
    result.anisotropy_rotation = draws.uniform(-math.pi, math.pi)
    return result


def _turned(draws: Draws) -> Material:
    """Return a brushed material whose direction goes around the middle of a texture."""
    result = _brushed(draws)
    n = draws.choice((8, 16, 32))
    y, x = (np.mgrid[:n, :n] + 0.5) / n - 0.5
    radius = np.sqrt(x * x + y * y)
    pixels = np.stack([0.5 + 0.5 * y / radius, 0.5 + 0.5 * x / radius, np.full((n, n), draws.uniform(0.5, 1.0))], -1)
    result.anisotropy_texture = texture(draws, pixels, "direction", plain=draws.chance(0.5))
    return result


def _dielectric(draws: Draws) -> Material:
    result = _base(draws, rough_low=0.0)
    result.ior = draws.choice((1.0, draws.uniform(1.0, 2.5), draws.uniform(1.0, 4.0)))
    result.specular = draws.choice((1.0, 0.0, draws.uniform(0.0, 1.0)))
    result.specular_color = draws.color(0.0, 2.0) if draws.chance(0.7) else (1.0, 1.0, 1.0)
    return result


def _mapped(draws: Draws) -> Material:
    """Return a material of some layers, each with textures."""
    result = draws.choice((_orange_peel, _cloth, _dielectric, _everything))(draws)
    for name in ("specular", "specular_color", "clearcoat", "clearcoat_roughness", "sheen_color", "sheen_roughness"):
        if draws.chance(0.6):
            setattr(result, f"{name}_texture", _with_alpha(draws))
    return result


def _with_alpha(draws: Draws) -> Texture:
    pixels = pattern(draws)
    found = texture(draws, pixels, "colors")
    found.image = image(np.concatenate([pixels, pixels[..., :1]], axis=-1), "colors and alpha")
    return found


def _everything(draws: Draws) -> Material:
    """Return a material of all layers that reflect."""
    result = _coated(draws, draws.uniform(0.0, 1.0))
    for other, names in (
        (_cloth(draws), ("sheen_color", "sheen_roughness")),
        (_brushed(draws), ("anisotropy", "anisotropy_rotation")),
        (_dielectric(draws), ("ior", "specular", "specular_color")),
    ):
        for name in names:
            setattr(result, name, getattr(other, name))
    return result


LAYERED: dict[str, Maker] = {
    "coated": lambda d: _coated(d, 0.0),
    "coated_metal": lambda d: _coated(d, 1.0),
    "orange_peel": _orange_peel,
    "cloth": _cloth,
    "brushed": _brushed,
    "turned": _turned,
    "dielectric": _dielectric,
    "mapped": _mapped,
    "everything": _everything,
}


def _pane(draws: Draws, roughness: float) -> Material:
    """Return a thin wall of coloured glass."""
    result = Material("", rgba(draws.color(0.3, 0.95)), 0.0, roughness, double_sided=True)
    result.transmission = draws.choice((1.0, draws.uniform(0.3, 1.0)))
    result.ior = draws.choice((1.5, draws.uniform(1.0, 2.2)))
    return result


def _stained(draws: Draws) -> Material:
    """Return a thin wall whose texture chooses colour and transmission."""
    result = _pane(draws, draws.choice((0.0, draws.uniform(0.0, 0.8))))
    result.base_color_texture = texture(draws, pattern(draws), "stains")
    if draws.chance(0.5):
        result.transmission_texture = texture(draws, pattern(draws), "lead")
    return result


def _blended(draws: Draws) -> Material:
    result = Material("", (*draws.color(0.1, 0.95), draws.choice((0.0, 1.0, draws.uniform(0.05, 0.95)))))
    result.alpha_mode, result.double_sided, result.roughness = "blend", True, draws.uniform(0.0, 1.0)
    return result


def _veil(draws: Draws) -> Material:
    """Return a blended sheet whose texture chooses the opacity."""
    result = _blended(draws)
    result.base_color = (*result.base_color[:3], draws.uniform(0.3, 1.0))
    result.base_color_texture = holes(draws)
    return result


def _solid(draws: Draws, roughness: float) -> Material:
    """Return glass that fills a closed body of unit size."""
    result = Material("", rgba(draws.color(0.7, 0.95)), 0.0, roughness, transmission=1.0, thickness=1.0)
    result.ior = draws.choice((1.5, 1.33, draws.uniform(1.0, 2.4)))
    if draws.chance(0.7):
        result.attenuation_distance, result.attenuation_color = draws.log_uniform(0.05, 2.0), draws.color(0.1, 1.0)
    return result


THIN: dict[str, Maker] = {
    "pane": lambda d: _pane(d, d.choice((0.0, 0.0, d.uniform(0.0, 0.05)))),
    "frosted": lambda d: _pane(d, d.uniform(0.1, 1.0)),
    "stained": _stained,
    "blended": _blended,
    "veil": _veil,
}
SOLID: dict[str, Maker] = {
    "glass": lambda d: _solid(d, 0.0),
    "rough_glass": lambda d: _solid(d, d.uniform(0.05, 0.8)),
}
GLASS = THIN | SOLID
