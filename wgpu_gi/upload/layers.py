"""Which of Khronos' material extensions a scene uses, as the HAS_ constants of `wgsl/common/layers.wgsl`."""

from __future__ import annotations

from collections.abc import Sequence

from ..gpu.wgsl.load import load
from ..scene.scene import Material

CLEAR_ROUGHNESS = float(load("common/layers.wgsl").constants["CLEAR_ROUGHNESS"])
IOR, SPECULAR, SPECULAR_COLOR = 1.5, 1.0, (1.0, 1.0, 1.0)  # of plain glTF materials


def layer_features(materials: Sequence[Material]) -> dict[str, bool]:
    """Return the features of layers that any material has; shaders leave out the others."""
    found = {
        "HAS_SPECULAR": any(map(_has_specular, materials)),
        "HAS_CLEARCOAT": any(m.clearcoat > 0 for m in materials),
        "HAS_SHEEN": any(max(m.sheen_color) > 0 for m in materials),
        "HAS_ANISOTROPY": any(m.anisotropy > 0 for m in materials),
        "HAS_TRANSMISSION": any(m.transmission > 0 for m in materials),
        "HAS_VOLUMES": any(m.transmission > 0 and m.thickness > 0 for m in materials),
    }
    return {**found, "HAS_LAYERS": any(found.values())}


def is_clear(material: Material) -> bool:
    """Tell whether parts of a material may be thin, smooth glass, which rays pass straight on."""
    is_smooth = material.roughness <= CLEAR_ROUGHNESS or material.metallic_roughness_texture is not None
    return material.transmission > 0 and material.thickness == 0 and is_smooth and not material.unlit


def _has_specular(m: Material) -> bool:
    """Tell whether a dielectric reflects otherwise than at an index of refraction of 1.5."""
    has_texture = m.specular_texture is not None or m.specular_color_texture is not None
    return has_texture or m.ior != IOR or m.specular != SPECULAR or tuple(m.specular_color) != SPECULAR_COLOR
