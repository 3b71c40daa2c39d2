"""Converts KHR_materials_pbrSpecularGlossiness to metallic roughness, texel by texel.

A dielectric keeps its specular colour as reflectance at normal incidence, which is exact (KHR_materials_ior, index 0).
Materials with a brighter reflectance anywhere are metals in part: Khronos, KHR_materials_pbrSpecularGlossiness,
examples/convert-between-workflows: both workflows shall have the same diffuse reflectance,
c (1 - F)(1 - m) = d (1 - max s), and the same specular reflectance, F (1 - m) + c m = s, in perceived brightness;
F = 0.04. That is a quadratic equation in m, the metallic.

Departures: where these are dielectric, they reflect 4 %, without colour; their two textures are joined texel by texel
in the size of the larger, with the sampler of the diffuse texture.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...pictures.color import LINEAR_OF_CODE, srgb_from_linear
from ..files.memory import MemoryBudget
from ..scene import Image, Texture
from .json_object import JsonObject

BRIGHTEST_DIELECTRIC = 0.25  # specular reflectance, linear: an index of refraction of 3, above that of diamond
_DIELECTRIC = 0.04  # specular reflectance of a dielectric in metallic roughness
_LEAST = 1e-6  # keeps quotients finite where their weight is zero; more than rounding of the brightness
_BRIGHTNESS = np.array([0.299, 0.587, 0.114])  # weights of squared colour in perceived brightness
_BLOCK = 1 << 16  # texels converted at a time: 13 MiB of intermediates

_Floats = NDArray[np.float64]


class Surface(NamedTuple):
    """Base colour with alpha, metallic, roughness and reflectance, and the textures that they multiply."""

    base_color: tuple[float, ...]
    metallic: float
    roughness: float
    base_color_texture: Texture | None = None
    metallic_roughness_texture: Texture | None = None
    specular_color: tuple[float, float, float] | None = None  # reflectance of a dielectric; None: 4 %
    specular_color_texture: Texture | None = None


@dataclass(frozen=True)
class _Factors:
    """The factors of the extension: linear colours, and glossiness."""

    diffuse: tuple[float, ...]
    specular: tuple[float, ...]
    glossiness: float


class SpecularGlossiness:
    """Converts the materials of a file; materials with equal textures and factors share the new textures."""

    def __init__(self, budget: MemoryBudget) -> None:
        self._budget = budget
        self._images: dict[tuple[int, int, _Factors], tuple[Image, Image]] = {}
        self._sources: list[Image | None] = []  # keeps the images alive whose ids are keys

    def convert(self, extension: JsonObject, diffuse: Texture | None, specular: Texture | None) -> Surface:
        """Return the surface that the extension and its textures describe."""
        factors = _Factors(
            extension.vector("diffuseFactor", (1.0, 1.0, 1.0, 1.0), low=0.0, high=1.0),
            extension.vector("specularFactor", (1.0, 1.0, 1.0), low=0.0, high=1.0),
            extension.number("glossinessFactor", 1.0, low=0.0, high=1.0),
        )
        brightest = 1.0 if specular is None else float(LINEAR_OF_CODE[specular.image.eight_bit[..., :3].max()])
        if brightest * max(factors.specular) <= BRIGHTEST_DIELECTRIC:
            return self._dielectric(factors, diffuse, specular, extension.where)
        template = diffuse or specular
        if template is None:
            color, metallic = metallic_from_specular(np.array(factors.diffuse[:3]), np.array(factors.specular))
            return Surface((*color.tolist(), factors.diffuse[3]), float(metallic), 1.0 - factors.glossiness)
        if diffuse is not None and specular is not None and not _aligned(diffuse, specular):
            extension.notes.add(
                f"{extension.where}: its textures have different coordinates; those of the diffuse one were used."
            )
        base, rough = self._converted(
            None if diffuse is None else diffuse.image,
            None if specular is None else specular.image,
            factors,
            extension.where,
        )
        return Surface((1.0,) * 4, 1.0, 1.0, replace(template, image=base), replace(template, image=rough))

    def _dielectric(self, factors: _Factors, diffuse: Texture | None, specular: Texture | None, where: str) -> Surface:
        """Return a surface with the extension's colours; a texture of its glossiness becomes one of roughness."""
        red, green, blue = factors.specular
        rough = None
        if specular is not None:
            glossiness = specular.image.eight_bit[..., 3]
            self._budget.take(4 * glossiness.size, where)
            pixels = np.full((*glossiness.shape, 4), 255, np.uint8)
            pixels[..., 1] = np.rint(255.0 - glossiness * factors.glossiness)
            rough = replace(specular, image=Image(pixels, f"{specular.image.name} (roughness)"))
        roughness = 1.0 - factors.glossiness if rough is None else 1.0
        return Surface(factors.diffuse, 0.0, roughness, diffuse, rough, (red, green, blue), specular)

    def _converted(
        self, diffuse: Image | None, specular: Image | None, factors: _Factors, where: str
    ) -> tuple[Image, Image]:
        """Return the base colour and the metallic-roughness image of two images, of which one may be absent."""
        key = id(diffuse), id(specular), factors
        if key not in self._images:
            self._sources += [diffuse, specular]
            images = [image.eight_bit for image in (diffuse, specular) if image is not None]
            height, width = (max(pixels.shape[axis] for pixels in images) for axis in (0, 1))
            self._budget.take(4 * len(images) * height * width + 8 * height * width, where)
            sized = [
                None if image is None else _resized(image.eight_bit, height, width) for image in (diffuse, specular)
            ]
            base, rough = _convert_texels(sized[0], sized[1], factors, height * width)
            name = next(image.name for image in (diffuse, specular) if image is not None)
            self._images[key] = (
                Image(base.reshape(height, width, 4), f"{name} (base colour)"),
                Image(rough.reshape(height, width, 4), f"{name} (metallic roughness)"),
            )
        return self._images[key]


def metallic_from_specular(diffuse: _Floats, specular: _Floats) -> tuple[_Floats, _Floats]:
    """Return base colour (..., 3) and metallic (...) of linear diffuse and specular colours (..., 3) in [0, 1]."""
    # Solve for the metallic that gives the brightness of both.
    left = 1.0 - specular.max(axis=-1)
    bright, shine = (np.sqrt((color * color) @ _BRIGHTNESS) for color in (diffuse, specular))
    half_b = (bright * left / (1.0 - _DIELECTRIC) + shine - 2.0 * _DIELECTRIC) / (2.0 * _DIELECTRIC)
    root = np.sqrt(np.maximum(half_b * half_b - (_DIELECTRIC - shine) / _DIELECTRIC, 0.0))
    metallic = np.where(shine < _DIELECTRIC + _LEAST, 0.0, np.clip(root - half_b, 0.0, 1.0))
    # Blend the base colours that give the diffuse and the specular colour.
    m = metallic[..., None]
    of_diffuse = diffuse * left[..., None] / (1.0 - _DIELECTRIC) / np.maximum(1.0 - m, _LEAST)
    of_specular = (specular - _DIELECTRIC * (1.0 - m)) / np.maximum(m, _LEAST)
    return np.clip(of_diffuse + (of_specular - of_diffuse) * m * m, 0.0, 1.0), metallic


def _convert_texels(
    diffuse: NDArray[np.uint8] | None, specular: NDArray[np.uint8] | None, factors: _Factors, count: int
) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Return base colour and metallic-roughness texels (count, 4); G is roughness and B metallic."""
    base, rough = np.full((count, 4), 255, np.uint8), np.full((count, 4), 255, np.uint8)
    white = np.full((1, 4), 255, np.uint8)
    for start in range(0, count, _BLOCK):
        rows = slice(start, start + _BLOCK)
        texels = white if diffuse is None else diffuse[rows]
        shine = white if specular is None else specular[rows]
        color, metallic = metallic_from_specular(
            LINEAR_OF_CODE[texels[:, :3]] * factors.diffuse[:3], LINEAR_OF_CODE[shine[:, :3]] * factors.specular
        )
        base[rows, :3] = np.rint(srgb_from_linear(color) * 255.0)
        base[rows, 3] = np.rint(texels[:, 3] * factors.diffuse[3])
        rough[rows, 1] = np.rint(255.0 - shine[:, 3] * factors.glossiness)
        rough[rows, 2] = np.rint(metallic * 255.0)
    return base, rough


def _resized(pixels: NDArray[np.uint8], height: int, width: int) -> NDArray[np.uint8]:
    """Return the nearest pixels of an image (h, w, 4) at another size, as rows (height * width, 4)."""
    if pixels.shape[:2] != (height, width):
        y, x = (np.arange(n) * old // n for n, old in zip((height, width), pixels.shape, strict=False))
        pixels = pixels[y[:, None], x]
    return pixels.reshape(-1, 4)


def _aligned(first: Texture, second: Texture) -> bool:
    """Tell whether two textures lie on each other."""
    return all(getattr(first, name) == getattr(second, name) for name in ("texcoord", "offset", "scale", "rotation"))
