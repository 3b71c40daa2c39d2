"""Which materials rays may pass straight on: `wgsl/scene/see_through.wgsl`."""

from __future__ import annotations

from ..scene.scene import Material
from .layers import is_clear


def is_see_through(material: Material, diffuse: bool = False) -> bool:
    """Tell whether a material blends or may be thin, smooth glass; `diffuse`: every material is Lambert, glass too."""
    return material.alpha_mode == "blend" or (not diffuse and is_clear(material))


def has_openings(material: Material) -> bool:
    """Tell whether rays must ask a material's alpha or glass before they stop."""
    return material.alpha_mode == "mask" or is_see_through(material) or transmits(material)


def transmits(material: Material) -> bool:
    """Tell whether a material is glass, which shadow rays of deferred techniques pass straight on."""
    return material.transmission > 0 and not material.unlit
