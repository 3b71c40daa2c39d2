"""Converts UsdPreviewSurface materials of a stage (UsdPreviewSurface specification 2.6).

Departures: opacity without a threshold is alpha blending: reflections fade with the surface. Bright constants of the
specular workflow become a metal, with a note. Displacement is not used, with a note.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ...float_limits import LARGEST_IOR, LARGEST_LIGHT
from ..files.raw_mesh import clay
from ..gltf.specular_glossiness import BRIGHTEST_DIELECTRIC, metallic_from_specular
from ..scene import Image, Material
from .stage import Stage, number, triple
from .textures import Sampled, Textures, color_image, plane, resampled

_PREVIEW_SURFACES = ("UsdPreviewSurface", "ND_UsdPreviewSurface_surfaceshader")


@dataclass
class Surface:
    """A material, the names of the texture coordinates of its textures by slot, and whether it reads displayColor."""

    material: Material
    texcoords: dict[str, str] = field(default_factory=dict)
    uses_display_color: bool = False

    @property
    def texcoord_names(self) -> list[str]:
        """Return the names of the sets of texture coordinates, each once."""
        return list(dict.fromkeys(self.texcoords.values()))


class Materials:
    """The materials of a stage, each converted once."""

    def __init__(self, stage: Stage) -> None:
        self._stage = stage
        self._textures = Textures(stage)
        self._surfaces: dict[str, Surface | None] = {}
        self._materials: dict[tuple[int, tuple[str, ...], bool], Material] = {}

    def bound(self, prim: Any) -> Any:
        """Return the material bound to a prim, for previews if there are several; None without one."""
        from pxr import UsdShade

        material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial(UsdShade.Tokens.preview)
        return material if material else None

    def subsets(self, prim: Any) -> list[Any]:
        """Return the subsets of faces with materials of their own."""
        from pxr import UsdGeom, UsdShade

        if not prim.IsA(UsdGeom.Mesh):
            return []
        subsets = UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets()
        return [s for s in subsets if s.GetElementTypeAttr().Get() == UsdGeom.Tokens.face]

    def surface(self, material: Any) -> Surface | None:
        """Return the surface of a material; None, with a note, if it has none that can be shown."""
        if material is None:
            return None
        key = str(material.GetPath())
        if key not in self._surfaces:
            self._surfaces[key] = self._convert(material)
        return self._surfaces[key]

    def material(self, surface: Surface, names: tuple[str, ...], double_sided: bool) -> Material:
        """Return the material of a surface on a mesh whose sets of texture coordinates have these names."""
        key = id(surface), names, double_sided
        if key not in self._materials:
            slots: dict[str, Any] = {}
            for slot, name in surface.texcoords.items():
                texture = getattr(surface.material, slot)
                slots[slot] = replace(texture, texcoord=1 if names.index(name) == 1 else 0)
            self._materials[key] = replace(surface.material, double_sided=double_sided, **slots)
        return self._materials[key]

    def _convert(self, source: Any) -> Surface | None:
        """Convert a material."""
        from pxr import UsdShade

        shader = None
        for context in (UsdShade.Tokens.universalRenderContext, "mtlx"):
            shader, _, _ = source.ComputeSurfaceSource(context)
            if shader:
                break
        identifier = shader.GetIdAttr().Get() if shader else None
        if identifier not in _PREVIEW_SURFACES:
            kind = f"its shader is {str(identifier)[:60]!r}" if shader else "it has no surface"
            self._stage.note(f"{source.GetPath()}: {kind}; display colours are shown in its place")
            return None
        surface = Surface(clay())
        surface.material.name = source.GetPath().name
        inputs = _Inputs(shader, self._textures, self._stage)
        if inputs.sampled("displacement") or inputs.number("displacement", 0.0) > 0:
            self._stage.note(f"{source.GetPath()}: displacement is not used")
        _base_color(surface, inputs, self._stage)
        _metallic_roughness(surface, inputs, self._stage)
        if inputs.number("useSpecularWorkflow", 0) == 1:
            _specular(surface, inputs, self._stage)
        else:
            surface.material.ior = min(max(inputs.number("ior", 1.5), 1.0), LARGEST_IOR)
        _clearcoat(surface, inputs, self._stage)
        _emission(surface, inputs)
        _normal(surface, inputs, self._stage)
        return surface


class _Inputs:
    """The inputs of a shader: constants, or textures that are connected to them."""

    def __init__(self, shader: Any, textures: Textures, stage: Stage) -> None:
        self._shader = shader
        self._textures = textures
        self._stage = stage

    def attribute(self, name: str) -> Any:
        """Return the attribute that gives an input its value, perhaps an output of a shader; None without one."""
        found = self._shader.GetInput(name)
        producers = found.GetValueProducingAttributes() if found else []
        return producers[0] if producers else None

    def number(self, name: str, default: float) -> float:
        """Return a constant of 0 or more."""
        return number(self.attribute(name), self._stage.time, default, low=0.0)

    def color(self, name: str, default: float) -> tuple[float, float, float]:
        """Return a constant colour."""
        return triple(self.attribute(name), self._stage.time, (default,) * 3)

    def sampled(self, name: str, deep: bool = False) -> Sampled | None:
        """Return the texture that is connected to an input, with 16 bits if `deep` and if it has them."""
        return self._textures.sampled(self.attribute(name), deep)

    def reads_display_color(self, name: str) -> bool:
        """Tell whether a reader of the primvar displayColor is connected to an input."""
        return self._textures.reader_of(self.attribute(name)) == "displayColor"


def _place(surface: Surface, slot: str, sampled: Sampled, image: Image) -> None:
    """Give the material a texture."""
    setattr(surface.material, slot, replace(sampled.texture, image=image))
    surface.texcoords[slot] = sampled.texcoords


def _unit(color: tuple[float, ...]) -> tuple[float, float, float]:
    red, green, blue = (min(max(c, 0.0), 1.0) for c in color[:3])
    return red, green, blue


def _base_color(surface: Surface, inputs: _Inputs, stage: Stage) -> None:
    """Set reflectance and opacity."""
    material, where, factor_alpha = surface.material, surface.material.name, 1.0
    color, opacity = inputs.sampled("diffuseColor"), inputs.sampled("opacity")
    factor = _unit(inputs.color("diffuseColor", 0.18))
    if inputs.reads_display_color("diffuseColor"):
        surface.uses_display_color, factor = True, (1.0, 1.0, 1.0)
    image = None
    if color:
        image, factor = color_image(color, stage)
    # A texture of opacity cuts out if there is a threshold, and else blends.
    threshold = min(inputs.number("opacityThreshold", 0.0), 1.0)
    if opacity:
        alpha = plane(opacity)
        if image is None:
            color, image = opacity, Image(np.full((*alpha.shape, 4), 255, np.uint8), f"{where} opacity")
        elif color and (opacity.texture.offset, opacity.texcoords) != (color.texture.offset, color.texcoords):
            stage.note(f"{where}: opacity is placed as diffuseColor is")
        alpha = resampled(alpha, *image.pixels.shape[:2])
        pixels = np.dstack([image.pixels[..., :3], np.round(255 * alpha).astype(np.uint8)])
        stage.budget.take(pixels.nbytes, f"{stage.source}: {where}")
        image = Image(pixels, image.name)
        material.alpha_mode, material.alpha_cutoff = ("mask", threshold) if threshold else ("blend", 0.5)
    elif inputs.number("opacity", 1.0) < threshold or inputs.number("opacity", 1.0) == 0.0:
        material.alpha_mode, factor_alpha = "mask", 0.0
        material.base_color = (*factor, factor_alpha)
        return
    elif inputs.number("opacity", 1.0) < 1.0 and not threshold:
        material.alpha_mode, factor_alpha = "blend", inputs.number("opacity", 1.0)
    if image is not None and color is not None:
        if not opacity and not (image.pixels[..., 3] == 255).all():
            image = Image(
                np.dstack([image.pixels[..., :3], np.full(image.pixels.shape[:2], 255, np.uint8)]), image.name
            )
        _place(surface, "base_color_texture", color, image)
    material.base_color = (*factor, factor_alpha)


def _metallic_roughness(surface: Surface, inputs: _Inputs, stage: Stage) -> None:
    """Set metallic and roughness; textures of the two are joined to one, roughness in green and metallic in blue."""
    material = surface.material
    material.metallic = min(inputs.number("metallic", 0.0), 1.0)
    material.roughness = min(inputs.number("roughness", 0.5), 1.0)
    metallic, roughness = inputs.sampled("metallic"), inputs.sampled("roughness")
    placed = roughness or metallic
    if placed is None:
        return
    planes = [None if sampled is None else plane(sampled) for sampled in (roughness, metallic)]
    height, width = (max(p.shape[axis] for p in planes if p is not None) for axis in (0, 1))
    stage.budget.take(height * width * 12, f"{stage.source}: {material.name}")
    pixels = np.full((height, width, 4), 255, np.uint8)
    for channel, values in zip((1, 2), planes, strict=True):
        if values is not None:
            pixels[..., channel] = np.round(255 * resampled(values, height, width))
    material.roughness = 1.0 if roughness else material.roughness
    material.metallic = 1.0 if metallic else material.metallic
    _place(surface, "metallic_roughness_texture", placed, Image(pixels, f"{material.name} roughness and metallic"))


def _specular(surface: Surface, inputs: _Inputs, stage: Stage) -> None:
    """Set the reflectance at normal incidence of the specular workflow; bright constants become a metal."""
    material = surface.material
    specular = _unit(inputs.color("specularColor", 0.0))
    sampled = inputs.sampled("specularColor")
    material.metallic = 0.0
    if sampled is None and material.base_color_texture is None and max(specular) > BRIGHTEST_DIELECTRIC:
        color, metallic = metallic_from_specular(np.array(material.base_color[:3]), np.array(specular))
        material.base_color = (*_unit(tuple(color.tolist())), material.base_color[3])
        material.metallic = float(metallic)
        stage.note(f"{material.name}: its specular workflow was converted to metallic roughness")
        return
    # An infinite index of refraction reflects all of the specular colour.
    material.ior, material.specular_color = 0.0, specular
    if sampled is not None:
        image, material.specular_color = color_image(sampled, stage)
        _place(surface, "specular_color_texture", sampled, image)


def _clearcoat(surface: Surface, inputs: _Inputs, stage: Stage) -> None:
    """Set the clear coat; its share is in the red of a texture, its roughness in the green."""
    material = surface.material
    material.clearcoat = min(inputs.number("clearcoat", 0.0), 1.0)
    if material.clearcoat == 0 and not inputs.sampled("clearcoat"):
        return
    material.clearcoat_roughness = min(inputs.number("clearcoatRoughness", 0.01), 1.0)
    for name, slot, channel in (("clearcoat", "clearcoat", 0), ("clearcoatRoughness", "clearcoat_roughness", 1)):
        sampled = inputs.sampled(name)
        if sampled is not None:
            values = plane(sampled)
            stage.budget.take(4 * values.size, f"{stage.source}: {material.name}")
            pixels = np.full((*values.shape, 4), 255, np.uint8)
            pixels[..., channel] = np.round(255 * values)
            setattr(material, slot, 1.0)
            _place(surface, f"{slot}_texture", sampled, Image(pixels, f"{material.name} {name}"))


def _emission(surface: Surface, inputs: _Inputs) -> None:
    """Set emitted radiance."""
    sampled = inputs.sampled("emissiveColor")
    factor = inputs.color("emissiveColor", 0.0)
    if sampled:
        factor = (sampled.scale[0], sampled.scale[1], sampled.scale[2])
        _place(surface, "emission_texture", sampled, Image(sampled.pixels, sampled.name))
    red, green, blue = (min(max(c, 0.0), LARGEST_LIGHT) for c in factor)
    surface.material.emission = red, green, blue


def _normal(surface: Surface, inputs: _Inputs, stage: Stage) -> None:
    """Set the normal map; its scale is 2 and its bias -1, which files often leave out."""
    sampled = inputs.sampled("normal", deep=True)
    if sampled is None:
        return
    pixels = sampled.pixels
    if sampled.scale[1] < 0:
        # The map's green points down.
        pixels = pixels.copy()
        pixels[..., 1] = np.iinfo(pixels.dtype).max - pixels[..., 1]
    strength = abs(sampled.scale[0]) / 2 if sampled.scale[0] != 1.0 else 1.0
    surface.material.normal_scale = strength
    _place(surface, "normal_texture", sampled, Image(pixels, sampled.name))
