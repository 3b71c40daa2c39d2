"""What is wrong with a material, its textures or their images, as the end of a sentence that begins with its place."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import Any

from ..float_limits import LARGEST_FACTOR, LARGEST_IOR, LARGEST_LIGHT, MAX_COORDINATE, SMALLEST_DISTANCE
from .parts import Image, Material, Texture
from .rules import Rule, array, choice, fault_of, flag, instance_of, is_number, number, optional, text, vector

_TEXTURES = tuple(field.name for field in fields(Material) if field.name.endswith("_texture"))
_FRACTION = number(0, 1)
_FRACTIONS = vector(3, 0, 1)
_IOR_WORDS = f"0 or a number from 1 to {LARGEST_IOR:g}"
_DISTANCE = number(SMALLEST_DISTANCE, MAX_COORDINATE, "metres")
_MATERIAL = {
    "name": text,
    "base_color": vector(4, 0, 1),
    "metallic": _FRACTION,
    "roughness": _FRACTION,
    "emission": vector(3, 0, LARGEST_LIGHT),
    "alpha_mode": choice("opaque", "mask", "blend"),
    "alpha_cutoff": number(-LARGEST_FACTOR, LARGEST_FACTOR),
    "double_sided": flag,
    "unlit": flag,
    "normal_scale": number(-LARGEST_FACTOR, LARGEST_FACTOR),
    "ior": Rule(lambda v: is_number(v) and (v == 0 or number(1, LARGEST_IOR).allows(v)), _IOR_WORDS),
    "specular": _FRACTION,
    "specular_color": vector(3, 0, LARGEST_FACTOR),
    "clearcoat": _FRACTION,
    "clearcoat_roughness": _FRACTION,
    "clearcoat_normal_scale": number(-LARGEST_FACTOR, LARGEST_FACTOR),
    "sheen_color": _FRACTIONS,
    "sheen_roughness": _FRACTION,
    "transmission": _FRACTION,
    "thickness": number(0, MAX_COORDINATE, "metres"),
    "attenuation_distance": Rule(
        lambda v: v is None or v == math.inf or _DISTANCE.allows(v), f"None or {_DISTANCE.words}"
    ),
    "attenuation_color": _FRACTIONS,
    "anisotropy": _FRACTION,
    "anisotropy_rotation": number(unit="radians"),
    **dict.fromkeys(_TEXTURES, optional(instance_of(Texture))),
}
_PAIR = vector(2, -LARGEST_FACTOR, LARGEST_FACTOR)
_WRAP = choice("repeat", "clamp", "mirror")
_TEXTURE = {
    "image": instance_of(Image),
    "wrap_u": _WRAP,
    "wrap_v": _WRAP,
    "filter": choice("linear", "nearest"),
    "min_filter": optional(choice("linear", "nearest")),
    "mip_filter": choice("linear", "nearest", "none"),
    "texcoord": choice(0, 1),
    "offset": _PAIR,
    "scale": _PAIR,
    "rotation": number(unit="radians"),
}
_IMAGE = {"pixels": array("uint8 or uint16", None, None, 4), "name": text}


def material_fault(material: Material) -> str | None:
    """Return what is wrong with a material; None if nothing is."""
    fault = fault_of(material, _MATERIAL)
    if fault is not None:
        return fault
    for slot in _TEXTURES:
        texture = getattr(material, slot)
        if texture is not None and (fault := _texture_fault(texture)) is not None:
            return f"{slot}.{fault}"
    return None


def _texture_fault(texture: Texture) -> str | None:
    fault = fault_of(texture, _TEXTURE)
    if fault is not None:
        return fault
    image = texture.image
    fault = fault_of(image, _IMAGE)
    if fault is None and min(image.pixels.shape) < 1:
        fault = "pixels must have rows and columns"
    return None if fault is None else f"image.{fault}{named(image)}"


def named(owner: Any) -> str:
    """Return class and name of an object in brackets, nothing without a name."""
    name = getattr(owner, "name", "")
    return f" ({type(owner).__name__.lower()} {name[:60]!r})" if isinstance(name, str) and name else ""
