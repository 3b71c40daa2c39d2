"""JSON pointers of KHR_animation_pointer: which property of a glTF file each one names, as a field of our scene.

The property may differ by a factor (an orthographic height is twice `ymag`); emission is the product of two properties.
"""

from __future__ import annotations

from dataclasses import dataclass

from .layers import CLEARCOAT_NORMAL, EXTENSIONS


@dataclass(frozen=True)
class Property:
    """What a channel changes: the element `index` of a top-level array, and a field of ours.

    kind: "node", "mesh", "light", "camera" or "material". `part` is the element of a list (a morph weight), `scale` a
    factor from glTF's value to ours. The path "emission_strength" multiplies "emission".
    """

    kind: str
    index: int
    path: str
    width: int | None = 1  # None: as many as there are morph targets
    part: int | None = None
    scale: float = 1.0


_KINDS = {"nodes": "node", "meshes": "mesh", "cameras": "camera", "materials": "material"}
_LIGHTS = "/extensions/KHR_lights_punctual/lights/"
_EXT = "extensions/KHR_materials_"
# Our field, its width and its factor, by what follows the index.
_PATHS: dict[str, dict[str, tuple[str, int | None, float]]] = {
    "node": {
        "translation": ("translation", 3, 1.0),
        "rotation": ("rotation", 4, 1.0),
        "scale": ("scale", 3, 1.0),
        "weights": ("morph_weights", None, 1.0),
    },
    "mesh": {"weights": ("morph_weights", None, 1.0)},
    "light": {
        "color": ("color", 3, 1.0),
        "intensity": ("intensity", 1, 1.0),
        "range": ("range", 1, 1.0),
        "spot/innerConeAngle": ("inner_cone_angle", 1, 1.0),
        "spot/outerConeAngle": ("outer_cone_angle", 1, 1.0),
    },
    "camera": {
        "perspective/yfov": ("yfov", 1, 1.0),
        "orthographic/ymag": ("orthographic_height", 1, 2.0),
    },
    "material": {
        "pbrMetallicRoughness/baseColorFactor": ("base_color", 4, 1.0),
        "pbrMetallicRoughness/metallicFactor": ("metallic", 1, 1.0),
        "pbrMetallicRoughness/roughnessFactor": ("roughness", 1, 1.0),
        "emissiveFactor": ("emission", 3, 1.0),
        "alphaCutoff": ("alpha_cutoff", 1, 1.0),
        "normalTexture/scale": ("normal_scale", 1, 1.0),
        f"{_EXT}emissive_strength/emissiveStrength": ("emission_strength", 1, 1.0),
        f"{_EXT}clearcoat/{CLEARCOAT_NORMAL}/scale": ("clearcoat_normal_scale", 1, 1.0),
        **{
            f"extensions/{extension}/{factor.key}": (factor.field, 3 if "color" in factor.field else 1, 1.0)
            for extension, content in EXTENSIONS.items()
            for factor in content.factors
        },
    },
}


def property_of(pointer: str) -> Property | None:
    """Return the property that a JSON pointer names, if animations may change it; its index may not exist."""
    if pointer.startswith(_LIGHTS):
        kind, rest = "light", pointer.removeprefix(_LIGHTS)
    else:
        array, _, rest = pointer.removeprefix("/").partition("/")
        kind = _KINDS.get(array, "")
    number, _, path = rest.partition("/")
    index = _number(number)
    if not pointer.startswith("/") or kind not in _PATHS or index is None:
        return None
    if path in _PATHS[kind]:
        name, width, scale = _PATHS[kind][path]
        return Property(kind, index, name, width, None, scale)
    weights, _, number = path.partition("/")
    part = _number(number)
    if weights == "weights" and kind in ("node", "mesh") and part is not None:
        return Property(kind, index, "morph_weights", 1, part)
    return None


def _number(text: str) -> int | None:
    """Return a decimal index; None for anything else."""
    return int(text) if text.isascii() and text.isdecimal() and len(text) < 10 else None
