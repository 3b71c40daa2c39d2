"""Materials for generated scenes. Albedos are at most 0.95."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...scene.scene import Material, Mesh
from .draws import Draws
from .layers import GLASS, LAYERED
from .textures import few_bright, grey, holes, normal_map, pattern, rgba, texture


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
MAKERS = SURFACES | LAYERED | GLASS
WALLS = ("matte", "colored", "white", "white", "clay", "textured", "dark", "bumpy", "glossy", "rough_metal")
GLOSSY = ("glossy", "polished", "metal", "rough_metal", "mirror", "dark_metal", "half_metal", "roughness_map", "bumpy",
          "bumpy_metal")  # fmt: skip
TEXTURED = ("textured", "textured", "painted", "roughness_map", "bumpy", "masked", "screen")


def surface(draws: Draws, names: tuple[str, ...] = tuple(SURFACES)) -> Material:
    """Return a material of one of the kinds `names` of MAKERS, which becomes its name."""
    kind = draws.choice(names)
    material = MAKERS[kind](draws)
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
