"""The layers of materials on the GPU: Khronos' extensions of metallic-roughness, as `wgsl/common/layers.wgsl` has them.

A layer counts only if it shows: without clear coat, its roughness and its textures are not sent.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from ..gpu.wgsl.load import load
from ..scene.layers import LAYERS, layers_of
from ..scene.scene import Material, Texture

SHADER = load("scene/materials.wgsl").constants | load("common/layers.wgsl").constants
CLEAR_ROUGHNESS = float(SHADER["CLEAR_ROUGHNESS"])
LEAST_TRANSMITTANCE = 1e-38  # of a volume, over the attenuation distance: its absorption is finite


FEATURES = {name: "HAS_VOLUMES" if name == "volume" else f"HAS_{name.upper()}" for name in LAYERS}


def layer_features(materials: Sequence[Material]) -> dict[str, bool]:
    """Return the features of layers that any material has; shaders leave out the others."""
    found = {name for m in materials for name in layers_of(m)}
    maps = any(True for m in materials for _ in layer_textures(m))
    features = {feature: name in found for name, feature in FEATURES.items()}
    return features | {"HAS_LAYERS": bool(found), "HAS_LAYER_MAPS": maps}


def layer_textures(material: Material) -> Iterator[tuple[int, Texture]]:
    """Yield slot and texture of the layers that a material has."""
    for layer in layers_of(material):
        for name in LAYERS[layer][1]:
            texture = getattr(material, f"{name}_texture")
            if texture is not None:
                yield int(SHADER[f"{name.upper()}_SLOT"]), texture


def is_clear(material: Material) -> bool:
    """Tell whether parts of a material may be thin, smooth glass, which rays pass straight on."""
    is_smooth = material.roughness <= CLEAR_ROUGHNESS or material.metallic_roughness_texture is not None
    return material.transmission > 0 and material.thickness == 0 and is_smooth and not material.unlit


def pack_layers(record: NDArray[np.void], m: Material) -> None:
    """Fill the layers of a Material record of wgsl/scene/materials.wgsl, except its textures."""
    record["dielectric_f0"], record["ior"] = ((m.ior - 1.0) / (m.ior + 1.0)) ** 2, max(m.ior, 1.0)
    record["specular"], record["specular_color"] = m.specular, m.specular_color
    record["clearcoat"], record["clearcoat_roughness"] = m.clearcoat, m.clearcoat_roughness
    record["clearcoat_normal_scale"] = m.clearcoat_normal_scale
    record["sheen"], record["sheen_roughness"] = m.sheen_color, m.sheen_roughness
    record["transmission"], record["thickness"] = m.transmission, m.thickness
    distance = np.inf if m.attenuation_distance is None else m.attenuation_distance
    record["attenuation"] = -np.log(np.maximum(np.asarray(m.attenuation_color), LEAST_TRANSMITTANCE)) / distance
    record["anisotropy"] = m.anisotropy
    record["anisotropy_direction"] = np.cos(m.anisotropy_rotation), np.sin(m.anisotropy_rotation)
