"""Sends a scene to the GPU as storage buffers, tables in textures and texture arrays, and again only what changed.

Each resource has a version that goes up with its contents; the render graph runs what reads it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import wgpu
from numpy.typing import NDArray

from ..camera import Camera
from ..errors import GiError
from ..gpu.device import Device
from ..gpu.wgsl import load
from .atlas import MAX_PAGE, Atlas, pack_atlas
from .check import check_camera, check_scene
from .emitters import LightTable, build_light_table, environment_cdf
from .hierarchy import Hierarchy
from .scene import Image, Light, Material, Scene, Texture

DOUBLE_SIDED, UNLIT, TEXTURED, COATED = 1, 2, 4, 8  # material flags, as wgsl/scene/materials.wgsl
PRESENT, TEXCOORD_1, NEAREST = 1, 2, 4  # texture flags
WRAP_CODES = {"repeat": 0, "clamp": 1, "mirror": 2}
# Tables in textures, and how many texels wide they are (wgsl/scene/geometry.wgsl).
TABLES = ("nodes", "triangles", "vertices")
TABLE_WIDTH = 4096
STRUCTS = {
    "materials": "Material",
    "nodes": "Node",
    "triangles": "Triangle",
    "vertices": "Vertex",
    "instances": "Instance",
    "lights": "Light",
}


class SceneUpload:
    """A scene's GPU copy. Call `update` before each frame.

    `resources` maps WGSL variable names to (wgpu object, version); `info` is the SceneInfo uniform; `features` are the
    shaders' HAS_ constants. `diffuse` treats every material as Lambert.
    """

    def __init__(self, device: Device, diffuse: bool = False) -> None:
        self._gpu = device.gpu
        self._limit = int(device.limits["max-storage-buffer-binding-size"])
        self.diffuse = diffuse
        shader = load("scene/lights.wgsl")
        self._dtypes = {name: shader.struct_dtype(struct) for name, struct in STRUCTS.items()}
        self._view_dtype = shader.struct_dtype("View")
        self._hierarchy = Hierarchy(self._dtypes)
        self._contents: dict[str, bytes] = {}  # of the small buffers, to see whether they changed
        self._images: dict[str, list[Image]] = {}
        self._atlases: dict[str, Atlas] = {}
        self._sent: dict[str, NDArray[np.uint8]] = {}  # the tables as the GPU has them
        self._environment: tuple[Any, Any] = (None, None)
        self._table: LightTable | None = None
        self._sources: object = None
        self._cdf: NDArray[np.float32] | None = None
        self.resources: dict[str, tuple[Any, int]] = {}
        self.info = np.zeros((), shader.struct_dtype("SceneInfo"))
        self.features: dict[str, bool] = {}

    @property
    def origin(self) -> NDArray[np.float64]:
        """World position of the GPU's zero, metres."""
        return self._hierarchy.origin

    def update(self, scene: Scene) -> None:
        """Send what changed since the last call.

        Raises GiError for values that mean nothing (a singular transform, a negative light) and for scenes beyond the
        device's limits.
        """
        check_scene(scene)
        scene = _without_empty(scene)
        materials = scene.materials
        self._hierarchy.update(scene.instances, {id(m): k for k, m in enumerate(materials)})
        self._upload_atlases(materials)
        self._upload_environment(scene)
        # Tabulating many emitters takes time, so only if one of them, or what places them, has changed.
        sources = (_light_values(scene.lights), _emission_values(materials), self.resources["environment_cdf"][1])
        if self._table is None or self._hierarchy.changed or sources != self._sources:
            self._table = build_light_table(scene, self._hierarchy, self._cdf, self._dtypes["lights"])
            self._sources = sources
            self._upload_small("lights", self._table.lights)
        table = self._table
        self._upload_small("materials", self._pack_materials(materials, table.material_pdf))
        for name in ("nodes", "triangles", "vertices", "indices", "instances"):
            if name in self._hierarchy.changed or name not in self.resources:
                upload = self._upload_table if name in TABLES else self._upload
                upload(name, getattr(self._hierarchy, name))
        self.features = {
            "HAS_INSTANCES": self._hierarchy.has_instances,
            "HAS_MASKS": any(m.alpha_mode == "mask" for m in materials),
            "HAS_TEXTURES": any(self._images.values()),
            "HAS_COATS": not self.diffuse,
            "HAS_EMITTERS": any(max(m.emission) > 0 for m in materials),
            "HAS_PICTURED_ENVIRONMENT": bool(scene.environment and scene.environment.image is not None),
        }
        self._fill_info(scene, table.count, table.environment_pdf)

    def release(self) -> None:
        """Free all GPU memory; do not use this object any more."""
        for resource, _ in self.resources.values():
            resource.destroy()
        self.resources = {}

    def view(self, camera: Camera, size: tuple[int, int], jitter: bool) -> NDArray[np.void]:
        """Return the View uniform of a camera for a picture of `size` (width, height).

        Raises GiError for a camera that sees nothing.
        """
        check_camera(camera)
        view = np.zeros((), self._view_dtype)
        matrix = np.asarray(camera.world_from_view, np.float64)
        half_height = np.tan(camera.yfov / 2)
        if camera.orthographic_height is not None:
            half_height = camera.orthographic_height / 2
        view["position"] = matrix[:3, 3] - self.origin
        view["right"] = matrix[:3, 0] * half_height * size[0] / size[1]
        view["up"] = matrix[:3, 1] * half_height
        view["forward"] = -matrix[:3, 2]
        view["orthographic"] = camera.orthographic_height is not None
        view["jitter"], view["size"] = jitter, size
        return view

    def _fill_info(self, scene: Scene, light_count: int, environment_pdf: float) -> None:
        info, environment = self.info, scene.environment
        info["frame_low"], info["frame_scale"] = self._hierarchy.world.low, self._hierarchy.world.scale
        info["centre"], info["radius"] = self._hierarchy.centre, self._hierarchy.radius
        info["root"], info["light_count"] = self._hierarchy.root, light_count
        info["environment_color"] = environment.color if environment else 0.0
        info["environment_pdf"] = environment_pdf
        info["environment_rotation"] = environment.rotation / (2 * np.pi) if environment else 0.0
        shining = any(max(m.emission) > 0 for m in scene.materials)
        info["hittable_light"] = shining or bool(environment and max(environment.color) > 0)

    def _pack_materials(self, materials: list[Material], pdf: dict[int, float]) -> NDArray[np.void]:
        packed = np.zeros(max(len(materials), 1), self._dtypes["materials"])
        for record, m in zip(packed, materials, strict=False):
            record["base_color"], record["emission"] = m.base_color, m.emission
            record["metallic"], record["roughness"], record["normal_scale"] = m.metallic, m.roughness, m.normal_scale
            record["alpha_cutoff"] = m.alpha_cutoff if m.alpha_mode == "mask" else 0.0
            record["emitter_pdf"] = pdf.get(id(m), 0.0)
            flags = DOUBLE_SIDED * m.double_sided | UNLIT * m.unlit | COATED * (not self.diffuse)
            for atlas, textures in self._textures(m).items():
                for slot, texture in textures.items():
                    flags |= TEXTURED
                    _pack_texture(record["textures"][slot], texture, self._atlases[atlas])
            record["flags"] = flags
        return packed

    def _textures(self, m: Material) -> dict[str, dict[int, Texture]]:
        """Return the textures in use by the name of their atlas and their slot in the Material struct."""
        slots: dict[str, dict[int, Texture | None]] = {
            "atlas_srgb": {0: m.base_color_texture, 1: m.emission_texture},
            "atlas_linear": {} if self.diffuse else {2: m.metallic_roughness_texture, 3: m.normal_texture},
        }
        return {atlas: {k: t for k, t in textures.items() if t is not None} for atlas, textures in slots.items()}

    def _upload_atlases(self, materials: list[Material]) -> None:
        for name, texture_format in (("atlas_srgb", "rgba8unorm-srgb"), ("atlas_linear", "rgba8unorm")):
            used = [t.image for m in materials for t in self._textures(m)[name].values()]
            images = list({id(i): i for i in used}.values())
            if name in self._images and [id(i) for i in images] == [id(i) for i in self._images[name]]:
                continue
            self._images[name], atlas = images, pack_atlas(images)
            self._atlases[name] = atlas
            texture = self._gpu.create_texture(
                label=f"scene/{name}",
                size=(atlas.page, atlas.page, atlas.layers),
                format=texture_format,
                usage=wgpu.TextureUsage.TEXTURE_BINDING | wgpu.TextureUsage.COPY_DST,
            )
            for image in images:
                layer, x, y = atlas.places[id(image)]
                height, width = image.pixels.shape[:2]
                self._gpu.queue.write_texture(
                    {"texture": texture, "origin": (x, y, layer)},
                    np.ascontiguousarray(image.pixels),
                    {"bytes_per_row": 4 * width, "rows_per_image": height},
                    (width, height, 1),
                )
            self._set(name, texture)

    def _upload_environment(self, scene: Scene) -> None:
        environment = scene.environment
        image = environment.image if environment else None
        color = tuple(environment.color) if environment else None
        # The picture counts by identity: it is immutable once in use. Its table depends on the colour, too.
        new_image = "environment" not in self.resources or self._environment[0] is not image
        new_table = new_image or self._environment[1] != color
        self._environment = (image, color)
        if image is not None and max(image.shape[:2]) > MAX_PAGE:
            raise GiError(
                f"the environment is {image.shape[1]} x {image.shape[0]} pixels; textures hold at most {MAX_PAGE} a"
                " side: scale it down"
            )
        if new_image:
            pixels = np.zeros((1, 1, 4), np.float32)
            if image is not None:
                pixels = np.ones((*image.shape[:2], 4), np.float32)
                pixels[..., :3] = image
            self._upload_texture("environment", "rgba32float", pixels)
        if new_table:
            self._cdf = environment_cdf(environment) if environment and max(environment.color) > 0 else None
            table = self._cdf if self._cdf is not None else np.ones((1, 2), np.float32)
            self._upload_texture("environment_cdf", "r32float", table[..., None])

    def _upload_texture(self, name: str, texture_format: str, pixels: NDArray[np.float32]) -> None:
        height, width, channels = pixels.shape
        texture = self._gpu.create_texture(
            label=f"scene/{name}",
            size=(width, height, 1),
            format=texture_format,
            usage=wgpu.TextureUsage.TEXTURE_BINDING | wgpu.TextureUsage.COPY_DST,
        )
        layout = {"bytes_per_row": 4 * channels * width, "rows_per_image": height}
        self._gpu.queue.write_texture({"texture": texture}, np.ascontiguousarray(pixels), layout, (width, height, 1))
        self._set(name, texture)

    def _upload_small(self, name: str, array: NDArray[np.void]) -> None:
        contents = array.tobytes()
        if self._contents.get(name) != contents:
            self._contents[name] = contents
            self._upload(name, array)

    def _upload(self, name: str, array: NDArray) -> None:
        """Write into the buffer there is if it fits exactly, else into a new one."""
        if array.nbytes > self._limit:
            raise GiError(
                f"the scene's {name} take {array.nbytes / 2**20:.0f} MiB; this device binds at most"
                f" {self._limit / 2**20:.0f} MiB: use fewer triangles"
            )
        old, version = self.resources.get(name, (None, 0))
        if old is not None and old.size == array.nbytes:
            self._gpu.queue.write_buffer(old, 0, array)
            self.resources[name] = (old, version + 1)
            return
        usage = wgpu.BufferUsage.STORAGE | wgpu.BufferUsage.COPY_DST
        if name == "indices":
            usage |= wgpu.BufferUsage.INDEX
        buffer = self._gpu.create_buffer(label=f"scene/{name}", size=array.nbytes, usage=usage)
        self._gpu.queue.write_buffer(buffer, 0, array)
        self._set(name, buffer)

    def _upload_table(self, name: str, array: NDArray) -> None:
        """Write records as texels of 16 bytes into a texture: from the first row that differs to the last."""
        texels = array.nbytes // 16
        rows = -(-texels // TABLE_WIDTH)
        if rows > MAX_PAGE:
            raise GiError(
                f"the scene's {name} take {rows} rows of a texture; {MAX_PAGE} are possible: use fewer triangles"
            )
        pixels = np.zeros((rows, TABLE_WIDTH * 16), np.uint8)
        pixels.ravel()[: array.nbytes] = np.ascontiguousarray(array).view(np.uint8).ravel()
        first, last = 0, rows - 1
        if name in self.resources and self._sent[name].shape == pixels.shape:
            different = np.flatnonzero((pixels != self._sent[name]).any(1))
            if not len(different):
                return
            first, last = int(different[0]), int(different[-1])
            texture, version = self.resources[name]
            self.resources[name] = (texture, version + 1)
        else:
            usage = wgpu.TextureUsage.STORAGE_BINDING | wgpu.TextureUsage.COPY_DST
            size = (TABLE_WIDTH, rows, 1)
            texture = self._gpu.create_texture(label=f"scene/{name}", size=size, format="rgba32uint", usage=usage)
            self._set(name, texture)
        self._sent[name] = pixels
        self._gpu.queue.write_texture(
            {"texture": texture, "origin": (0, first, 0)},
            pixels[first : last + 1],
            {"bytes_per_row": TABLE_WIDTH * 16, "rows_per_image": last + 1 - first},
            (TABLE_WIDTH, last + 1 - first, 1),
        )

    def _set(self, name: str, resource: Any) -> None:
        old, version = self.resources.get(name, (None, 0))
        self.resources[name] = (resource, version + 1)
        if old is not None:
            old.destroy()


def _pack_texture(slot: NDArray[np.void], texture: Texture, atlas: Atlas) -> None:
    """Fill a TextureSlot."""
    layer, x, y = atlas.places[id(texture.image)]
    height, width = texture.image.pixels.shape[:2]
    slot["corner"], slot["size"], slot["layer"] = (x, y), (width, height), layer
    wrap = WRAP_CODES[texture.wrap_u] << 4 | WRAP_CODES[texture.wrap_v] << 6
    slot["flags"] = PRESENT | TEXCOORD_1 * texture.texcoord | NEAREST * (texture.filter == "nearest") | wrap
    # KHR_texture_transform: uv' = translation * rotation * scale * uv
    sine, cosine = np.sin(texture.rotation), np.cos(texture.rotation)
    slot["transform_u"] = (cosine * texture.scale[0], sine * texture.scale[1], texture.offset[0])
    slot["transform_v"] = (-sine * texture.scale[0], cosine * texture.scale[1], texture.offset[1])


def _without_empty(scene: Scene) -> Scene:
    """Return the scene without instances that have nothing to show."""
    kept = [i for i in scene.instances if len(i.mesh.triangles)]
    return Scene(kept, scene.lights, scene.environment) if len(kept) < len(scene.instances) else scene


def _light_values(lights: Sequence[Light]) -> list[tuple[Any, ...]]:
    """Return all that the light table takes from punctual lights, comparable."""
    return [
        (type(light), *(np.asarray(v).tobytes() for k, v in vars(light).items() if k not in ("name", "range")))
        for light in lights
    ]


def _emission_values(materials: list[Material]) -> list[tuple[Any, ...]]:
    """Return all that the light table takes from materials, comparable."""
    return [(id(m), tuple(m.emission), m.double_sided, m.unlit, m.emission_texture) for m in materials]
