"""Writes a `Scene` as a binary glTF 2.0 file (.glb) that `load_gltf` reads back unchanged, with json and struct alone.

Extensions: KHR_lights_punctual, KHR_texture_transform, KHR_materials_emissive_strength, KHR_materials_unlit and those
of `layers.py`. What the file does not hold:
- an environment: `save_glb` writes it beside the file;
- animations, with a GiWarning: everything stands as the scene has it, skinned and morphed meshes in their pose;
- triangles without area, unused vertices, unused materials and meshes without triangles: loaders leave them out;
- an emission or a light's colour above 1: a power of two moves to the strength or intensity, which is exact;
- nodes with shear: their matrices are written, and `load_gltf` reads them, but glTF asks for products of translation,
  rotation and scale;
- vertex colours outside [0, 1], alpha cutoffs below 0 and a light's range of 0 or infinity: loaders set them to 0 or 1,
  to 0, and to none;
- lengths of directions: loaders normalise them, which can change the last bit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...camera import Camera
from ...errors import GiError, warn_of
from ...pictures.atomic_file import atomic_file
from ...pictures.image import save_image
from ..check import check_camera, check_scene
from ..deformation import posed_mesh
from ..files.png_writer import encode_png
from ..load import glows_only, has_light
from ..scene import (
    DirectionalLight,
    Environment,
    Image,
    Instance,
    Light,
    Material,
    Mesh,
    PointLight,
    Scene,
    SpotLight,
    Texture,
)
from .glb import Glb, Json
from .layers import described_layers

_WRAPS = {"repeat": 10497, "clamp": 33071, "mirror": 33648}
_MAG_FILTERS = {"nearest": 9728, "linear": 9729}
_MIN_FILTERS = {
    ("nearest", "none"): 9728,
    ("linear", "none"): 9729,
    ("nearest", "nearest"): 9984,
    ("linear", "nearest"): 9985,
    ("nearest", "linear"): 9986,
    ("linear", "linear"): 9987,
}
_NEAR, _FAR = 0.01, 1000.0  # glTF requires clip planes; our cameras have none


def save_glb(path: str | Path, scene: Scene) -> str | None:
    """Write a scene to a .glb file, and its environment for the option `--env`; return the value of that option.

    The value is "R,G,B" for a constant environment, the path of an .exr beside the file for an image (with colour and
    rotation applied; a turn by parts of a column blends two columns), "0,0,0" for a scene without any light, for which
    loading would add a sky, and None if `--env` is not needed. Files appear complete or not at all. Raises GiError for
    another extension, for values that would not load again, and if a file cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() != ".glb":
        raise GiError(f"{path}: scenes are written as .glb; change the extension")
    check_scene(scene)
    for camera in scene.cameras:
        check_camera(camera)
    data = _Writer(scene).to_bytes()
    environment = _save_environment(path, scene)
    if scene.animations:
        warn_of([f"{path.name} holds the scene as it stands: animations are not written"], stacklevel=2)
    with atomic_file(path) as temporary:
        temporary.write_bytes(data)
    return environment


def _save_environment(path: Path, scene: Scene) -> str | None:
    """Write an image environment beside `path`; return the value of `--env`."""
    environment = scene.environment
    if environment is None:
        return None if has_light(scene) and not glows_only(scene) else "0,0,0"
    if environment.image is None:
        return ",".join(repr(float(value)) for value in environment.color)
    beside = path.with_suffix(".exr")
    save_image(beside, {"radiance": _unrotated(environment)})
    return str(beside)


def _unrotated(environment: Environment) -> NDArray[np.float32]:
    """Return the image of an environment times its colour, turned so that its rotation is 0."""
    image = np.asarray(environment.image, np.float32) * np.asarray(environment.color, np.float32)
    columns = environment.rotation / (2 * math.pi) * image.shape[1]
    whole = round(columns)
    if abs(columns - whole) < 1e-6:
        return np.roll(image, -whole, axis=1)
    low = math.floor(columns)
    share = np.float32(columns - low)
    return np.roll(image, -low, axis=1) * (1 - share) + np.roll(image, -low - 1, axis=1) * share


class _Writer:
    """Converts the objects of a scene to those of a file. Objects that are shared in the scene are written once."""

    def __init__(self, scene: Scene) -> None:
        self._glb = Glb()
        self._scene = scene
        self._posed: list[Mesh] = []

    def to_bytes(self) -> bytes:
        """Return the file, with nodes in the order of the scene, whose lists loaders restore."""
        nodes = [self._instance(instance) for instance in self._scene.instances if len(instance.mesh.triangles)]
        nodes += [self._light(light) for light in self._scene.lights]
        nodes += [self._camera(camera) for camera in self._scene.cameras]
        self._glb.root |= {"scene": 0, "scenes": [{"name": self._scene.name, "nodes": nodes}]}
        return self._glb.to_bytes()

    # -------------------------------------------------------------------------------------------- geometry

    def _instance(self, instance: Instance) -> int:
        """Add a node for an instance, with its mesh in its pose."""
        mesh = posed_mesh(instance)
        self._posed.append(mesh)  # kept alive, since meshes are known by their ids
        index = self._glb.once("meshes", id(mesh), lambda: self._mesh(mesh))
        return self._glb.node(instance.name or mesh.name, instance.world_from_local, {"mesh": index})

    def _mesh(self, mesh: Mesh) -> Json:
        """Return a mesh, with a primitive for each run of triangles of one material."""
        positions = np.asarray(mesh.positions, np.float32)
        extent = {"min": positions.min(0).tolist(), "max": positions.max(0).tolist()}
        attributes = {"POSITION": self._glb.accessor(positions, "<f4", **extent)}
        further = {
            "NORMAL": mesh.normals,
            "TANGENT": mesh.tangents,
            "TEXCOORD_0": mesh.texcoords0,
            "TEXCOORD_1": mesh.texcoords1,
            "COLOR_0": mesh.colors,
        }
        attributes |= {name: self._glb.accessor(v, "<f4") for name, v in further.items() if v is not None}
        slots = mesh.material_of_triangle
        slots = np.zeros(len(mesh.triangles), np.uint32) if slots is None else np.asarray(slots)
        starts = [0, *(np.flatnonzero(np.diff(slots.astype(np.int64))) + 1).tolist(), len(slots)]
        primitives = []
        for start, end in pairwise(starts):
            indices = self._glb.accessor(np.asarray(mesh.triangles)[start:end].reshape(-1), "<u4")
            material = self._material(mesh.materials[int(slots[start])])
            primitives.append({"attributes": attributes, "indices": indices, "material": material})
        return {"name": mesh.name, "primitives": primitives}

    # -------------------------------------------------------------------------------------------- materials

    def _material(self, material: Material) -> int:
        return self._glb.once("materials", id(material), lambda: self._described(material))

    def _described(self, material: Material) -> Json:
        """Return a material of the metallic-roughness model."""
        pbr: Json = {
            "baseColorFactor": list(map(float, material.base_color)),
            "metallicFactor": float(material.metallic),
            "roughnessFactor": float(material.roughness),
        }
        strength = power_of_two_above(material.emission)
        result: Json = {
            "name": material.name,
            "pbrMetallicRoughness": pbr,
            "emissiveFactor": [float(value) / strength for value in material.emission],
            "doubleSided": bool(material.double_sided),
        }
        if material.alpha_mode == "mask":
            result |= {"alphaMode": "MASK", "alphaCutoff": max(float(material.alpha_cutoff), 0.0)}
        elif material.alpha_mode == "blend":
            result["alphaMode"] = "BLEND"
        if strength > 1:
            self._glb.extend(result, "KHR_materials_emissive_strength", {"emissiveStrength": strength})
        if material.unlit:
            self._glb.extend(result, "KHR_materials_unlit", {})
        for name, values in described_layers(material, self._texture_info).items():
            self._glb.extend(result, name, values)
        for owner, key, texture, further in (
            (pbr, "baseColorTexture", material.base_color_texture, {}),
            (pbr, "metallicRoughnessTexture", material.metallic_roughness_texture, {}),
            (result, "normalTexture", material.normal_texture, {"scale": float(material.normal_scale)}),
            (result, "occlusionTexture", material.occlusion_texture, {}),
            (result, "emissiveTexture", material.emission_texture, {}),
        ):
            if texture is not None:
                owner[key] = self._texture_info(texture) | further
        return result

    def _texture_info(self, texture: Texture) -> Json:
        """Return the use of a texture: its index, texture coordinates and transform."""
        minify = _MIN_FILTERS[texture.min_filter or texture.filter, texture.mip_filter]
        sampler = {"magFilter": _MAG_FILTERS[texture.filter], "minFilter": minify}
        sampler |= {"wrapS": _WRAPS[texture.wrap_u], "wrapT": _WRAPS[texture.wrap_v]}
        source = self._glb.once("images", id(texture.image), lambda: self._image(texture.image))
        index = self._glb.once("samplers", tuple(sampler.values()), lambda: sampler)
        info: Json = {
            "index": self._glb.once("textures", (source, index), lambda: {"source": source, "sampler": index}),
            "texCoord": texture.texcoord,
        }
        transform = {"offset": texture.offset, "scale": texture.scale, "rotation": texture.rotation}
        neutral = {"offset": (0.0, 0.0), "scale": (1.0, 1.0), "rotation": 0.0}
        changed = {
            key: np.asarray(value, np.float64).tolist() for key, value in transform.items() if value != neutral[key]
        }
        if changed:
            self._glb.extend(info, "KHR_texture_transform", changed)
        return info

    def _image(self, image: Image) -> Json:
        view = self._glb.view(encode_png(image.pixels))
        return {"name": image.name, "mimeType": "image/png", "bufferView": view}

    # -------------------------------------------------------------------------------------------- lights and cameras

    def _light(self, light: Light) -> int:
        """Add a node and a light of KHR_lights_punctual, which shines along the node's -Z."""
        strength = power_of_two_above(light.color)
        source: Json = {
            "name": light.name,
            "color": [float(value) / strength for value in light.color],
            "intensity": float(light.intensity) * strength,
        }
        matrix = np.eye(4)
        if isinstance(light, DirectionalLight):
            source["type"] = "directional"
        else:
            source["type"] = "point" if isinstance(light, PointLight) else "spot"
            matrix[:3, 3] = light.position
            if light.range is not None and math.isfinite(light.range):
                source["range"] = float(light.range)
        if not isinstance(light, PointLight):
            matrix[:3, :3] = _axes_towards(light.direction)
        if isinstance(light, SpotLight):
            if light.outer_cone_angle > math.pi / 2 + 1e-6:
                raise GiError(f"light {light.name!r}: glTF has no spot lights wider than 90 degrees from their axis")
            source["spot"] = {
                "innerConeAngle": float(light.inner_cone_angle),
                "outerConeAngle": float(light.outer_cone_angle),
            }
        lights = self._glb.extend(self._glb.root, "KHR_lights_punctual", {"lights": []})["lights"]
        lights.append(source)
        reference = {"KHR_lights_punctual": {"light": len(lights) - 1}}
        return self._glb.node(light.name, matrix, {"extensions": reference})

    def _camera(self, camera: Camera) -> int:
        """Add a node and a camera."""
        planes = {"znear": _NEAR, "zfar": _FAR}
        source: Json
        if camera.orthographic_height is None:
            source = {"type": "perspective", "perspective": {"yfov": float(camera.yfov), "znear": _NEAR}}
        else:
            half = float(camera.orthographic_height) / 2
            source = {"type": "orthographic", "orthographic": {"xmag": half, "ymag": half, **planes}}
        index = self._glb.add("cameras", source | {"name": camera.name})
        return self._glb.node(camera.name, camera.world_from_view, {"camera": index})


def power_of_two_above(values: Sequence[float]) -> float:
    """Return the least power of two, at least 1, that no value exceeds; dividing by it is exact."""
    mantissa, exponent = math.frexp(max(values))
    return max(1.0, math.ldexp(1.0, exponent if mantissa > 0.5 else exponent - 1))


def _axes_towards(direction: Sequence[float]) -> NDArray[np.float64]:
    """Return the axes (3, 3) of a node whose -Z is `direction`; the other two are perpendicular to it."""
    back = -np.asarray(direction, np.float64)
    across = np.cross(np.eye(3)[int(np.argmin(np.abs(back)))], back)
    across /= np.linalg.norm(across) or 1.0
    return np.stack([across, np.cross(back, across), back], axis=1)
