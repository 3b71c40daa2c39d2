"""Khronos' material extensions of a glTF file as fields of `Material`: one table for reading and for writing."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import fields
from typing import Any, NamedTuple

from ...float_limits import LARGEST_FACTOR, LARGEST_IOR, MAX_COORDINATE, SMALLEST_DISTANCE
from ..scene import Material, Texture
from .glb import Json
from .json_object import JsonObject

DEFAULTS: dict[str, Any] = {field.name: field.default for field in fields(Material)}  # those of Khronos


class Factor(NamedTuple):
    """A number or a colour of an extension, the field that holds it, and its range."""

    key: str
    field: str
    low: float = 0.0
    high: float = 1.0


class Extension(NamedTuple):
    """The factors of an extension, and its textures: the fields that hold them, by key."""

    factors: tuple[Factor, ...]
    textures: dict[str, str]


EXTENSIONS = {
    "KHR_materials_ior": Extension((Factor("ior", "ior", 0.0, LARGEST_IOR),), {}),
    "KHR_materials_specular": Extension(
        (Factor("specularFactor", "specular"), Factor("specularColorFactor", "specular_color", 0.0, LARGEST_FACTOR)),
        {"specularTexture": "specular_texture", "specularColorTexture": "specular_color_texture"},
    ),
    "KHR_materials_clearcoat": Extension(
        (Factor("clearcoatFactor", "clearcoat"), Factor("clearcoatRoughnessFactor", "clearcoat_roughness")),
        {
            "clearcoatTexture": "clearcoat_texture",
            "clearcoatRoughnessTexture": "clearcoat_roughness_texture",
            "clearcoatNormalTexture": "clearcoat_normal_texture",
        },
    ),
    "KHR_materials_sheen": Extension(
        (Factor("sheenColorFactor", "sheen_color"), Factor("sheenRoughnessFactor", "sheen_roughness")),
        {"sheenColorTexture": "sheen_color_texture", "sheenRoughnessTexture": "sheen_roughness_texture"},
    ),
    "KHR_materials_transmission": Extension(
        (Factor("transmissionFactor", "transmission"),), {"transmissionTexture": "transmission_texture"}
    ),
    "KHR_materials_volume": Extension(
        (
            Factor("thicknessFactor", "thickness", 0.0, MAX_COORDINATE),
            Factor("attenuationDistance", "attenuation_distance", SMALLEST_DISTANCE, math.inf),
            Factor("attenuationColor", "attenuation_color"),
        ),
        {"thicknessTexture": "thickness_texture"},
    ),
    "KHR_materials_anisotropy": Extension(
        (
            Factor("anisotropyStrength", "anisotropy"),
            Factor("anisotropyRotation", "anisotropy_rotation", -math.inf, math.inf),
        ),
        {"anisotropyTexture": "anisotropy_texture"},
    ),
}
CLEARCOAT_NORMAL = "clearcoatNormalTexture"  # its scale is a field of the material


def layer_infos(material: JsonObject) -> dict[str, JsonObject]:
    """Return the textureInfo objects of a material's extensions by their key, which is unique."""
    found: dict[str, JsonObject] = {}
    for name, extension in EXTENSIONS.items():
        owner = material.extension(name)
        if owner is not None:
            found |= {key: owner.child(key) for key in extension.textures if key in owner}
    return found


def read_layers(
    material: JsonObject, textures: dict[str, Texture | None], excluded: Sequence[str] = ()
) -> dict[str, Any]:
    """Return the fields of a material's extensions but the excluded ones; `textures` by the keys of `layer_infos`."""
    result: dict[str, Any] = {}
    for name, extension in EXTENSIONS.items():
        owner = material.extension(name)
        if owner is None or name in excluded:
            continue
        for factor in extension.factors:
            result[factor.field] = _read_factor(owner, factor)
        for key, field in extension.textures.items():
            result[field] = textures.get(key)
        if CLEARCOAT_NORMAL in owner:
            scale = owner.child(CLEARCOAT_NORMAL).number("scale", 1.0, -LARGEST_FACTOR, LARGEST_FACTOR)
            result["clearcoat_normal_scale"] = scale
    return result


def _read_factor(owner: JsonObject, factor: Factor) -> Any:
    """Return a factor, limited to its range with a note."""
    default = DEFAULTS[factor.field]
    if isinstance(default, tuple):
        return owner.vector(factor.key, default, factor.low, factor.high)
    if default is None:
        # Exporters write the largest float for an infinite distance.
        distance = owner.number(factor.key, math.inf, factor.low)
        return distance if distance <= MAX_COORDINATE else None
    value = owner.number(factor.key, default, factor.low, factor.high)
    if factor.field == "ior" and 0.0 < value < 1.0:
        owner.damage(f"ior must be 0 or at least 1, not {value:g}; it was set to 1")
        return 1.0
    return value


def described_layers(material: Material, texture_info: Callable[[Texture], Json]) -> dict[str, Json]:
    """Return the extensions that express a material's fields, by name, without what is as by default."""
    result: dict[str, Json] = {}
    for name, extension in EXTENSIONS.items():
        values: Json = {}
        for factor in extension.factors:
            value = getattr(material, factor.field)
            if isinstance(DEFAULTS[factor.field], tuple):
                value = tuple(map(float, value))
            if value != DEFAULTS[factor.field] and value != math.inf:
                values[factor.key] = list(value) if isinstance(value, tuple) else float(value)
        for key, field in extension.textures.items():
            texture = getattr(material, field)
            if texture is not None:
                values[key] = texture_info(texture)
                if key == CLEARCOAT_NORMAL:
                    values[key] |= {"scale": float(material.clearcoat_normal_scale)}
        if values:
            result[name] = values
    return result
