"""The layers that materials have beyond base colour, metallic and roughness, by the names of Khronos' extensions."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable

from .parts import Material


def _has_specular(m: Material) -> bool:
    """Tell whether a dielectric reflects otherwise than at an index of refraction of 1.5."""
    has_texture = m.specular_texture is not None or m.specular_color_texture is not None
    return has_texture or (m.ior, m.specular, *m.specular_color) != (1.5, 1.0, 1.0, 1.0, 1.0)


# Whether a material has the layer, and the names of its textures that shaders read.
# Specular stands for KHR_materials_ior, too.
LAYERS: dict[str, tuple[Callable[[Material], bool], tuple[str, ...]]] = {
    "specular": (_has_specular, ("specular", "specular_color")),
    "clearcoat": (lambda m: m.clearcoat > 0, ("clearcoat", "clearcoat_roughness", "clearcoat_normal")),
    "sheen": (lambda m: max(m.sheen_color) > 0, ("sheen_color", "sheen_roughness")),
    "anisotropy": (lambda m: m.anisotropy > 0, ("anisotropy",)),
    "transmission": (lambda m: m.transmission > 0, ("transmission",)),
    "volume": (lambda m: m.transmission > 0 and m.thickness > 0, ()),
}


def layers_of(material: Material) -> list[str]:
    """Return the layers that a material has."""
    return [] if material.unlit else [name for name, (has, _) in LAYERS.items() if has(material)]


def described_materials(materials: Iterable[Material]) -> str:
    """Return the number of materials, and of those with each layer."""
    known = list(materials)
    found = Counter(name for m in known for name in [*layers_of(m), *(["blend"] if m.alpha_mode == "blend" else [])])
    parts = ", ".join(f"{count} {name}" for name, count in found.items())
    return f"{len(known)} ({parts})" if parts else str(len(known))
