"""Sends a scene to the GPU as storage buffers, tables in textures and texture arrays, and again only what changed.

Each resource has a version that goes up with its contents; the render graph runs what reads it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..errors import GiError
from ..gpu.device import Device
from ..gpu.wgsl.load import load
from ..scene.check import check_camera, check_scene
from ..scene.scene import Instance, Light, Material, Scene, Texture
from .area_cdf import AreaCdf
from .direct_lights import build_direct_lights
from .draw_list import DrawList, RasterMesh, build_draw_list
from .environment_cdf import environment_cdf
from .light_table import LightTable, build_light_table
from .materials import MaterialUpload
from .mesh_data import MeshData
from .resources import GpuResources
from .solid_meshes import SolidMeshes
from .surface_samples import sample_surfaces
from .texture_atlas import MAX_PAGE
from .two_level_bvh import TwoLevelBvh

TABLES = ("nodes", "triangles", "vertices")  # are textures
NEAR = 1e-9  # near plane over the scene's radius: of reversed float depth, it does not change the relative precision
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
        self.diffuse = diffuse
        shader = load("scene/lights.wgsl")
        self._dtypes = {name: shader.struct_dtype(struct) for name, struct in STRUCTS.items()}
        self._view_dtype = shader.struct_dtype("View")
        self._hierarchy = TwoLevelBvh(self._dtypes)
        self._environment: tuple[Any, Any] = (None, None)
        self._table: LightTable | None = None
        self._sources: object = None
        self._cdf: NDArray[np.float32] | None = None
        self._raster_meshes: WeakKeyDictionary[MeshData, RasterMesh] = WeakKeyDictionary()
        self._raster_stale = True
        self._unsent: set[str] = set()  # arrays of the hierarchy; of an update that failed, too
        self._geometry = 0  # grows when meshes or transforms change
        self._direct: tuple[object, NDArray] = (None, np.zeros(0))
        self._before: list[tuple[Instance, NDArray[np.float64]]] = []  # where each was at the last call for motion
        self._samples: tuple[int, NDArray[np.float64]] | None = None
        self.solids = SolidMeshes()
        self._solid_key: tuple[int, str] | None = None
        self.draws: DrawList | None = None
        self.resources = GpuResources(device.gpu, int(device.limits["max-storage-buffer-binding-size"]))
        self._materials = MaterialUpload(self.resources, self._dtypes["materials"], diffuse)
        self.info = np.zeros((), shader.struct_dtype("SceneInfo"))
        self.features: dict[str, bool] = {}

    @property
    def origin(self) -> NDArray[np.float64]:
        """World position of the GPU's zero, metres."""
        return self._hierarchy.origin

    @property
    def box(self) -> NDArray[np.float64]:
        """Lower and upper corner of the scene's bounds relative to the origin, (2, 3) metres."""
        return self._hierarchy.box

    @property
    def geometry(self) -> int:
        """Grows when meshes or transforms change."""
        return self._geometry

    @property
    def light_table(self) -> tuple[NDArray[np.void], int]:
        """The records that light sampling draws from, and how many of them count."""
        assert self._table is not None
        return self._table.lights, self._table.count

    def update(self, scene: Scene) -> None:
        """Send what changed since the last call.

        Raises GiError for values that mean nothing (a singular transform, a negative light) and for scenes beyond the
        device's limits.
        """
        check_scene(scene)
        scene = _without_empty(scene)
        materials = scene.materials
        self._hierarchy.update(scene.instances, {id(m): k for k, m in enumerate(materials)})
        self._unsent |= self._hierarchy.changed
        self._raster_stale |= bool(self._hierarchy.changed & {"triangles", "vertices"})
        self._geometry += bool(self._hierarchy.changed)
        self._materials.send_pictures(materials)
        self._upload_environment(scene)
        # Tabulating many emitters takes time, so only if one of them, or what places them, has changed.
        sources = (_light_values(scene.lights), _emission_values(materials), self.resources["environment_cdf"][1])
        if self._table is None or self._unsent or sources != self._sources:
            self._table = build_light_table(scene, self._hierarchy, self._cdf, self._dtypes["lights"])
            self._sources = sources
            self.resources.records("lights", self._table.lights)
        table = self._table
        self._materials.send_records(materials, table.material_pdf)
        for name in ("nodes", "triangles", "vertices", "instances"):
            if name in self._unsent or name not in self.resources:
                send = self.resources.table if name in TABLES else self.resources.buffer
                send(name, getattr(self._hierarchy, name))
        self._unsent.clear()
        self.features = {
            "HAS_INSTANCES": self._hierarchy.has_instances,
            "HAS_MASKS": any(m.alpha_mode == "mask" for m in materials),
            "HAS_TEXTURES": self._materials.has_textures,
            "HAS_EMISSION_MAPS": any(m.emission_texture for m in materials),
            "HAS_ROUGHNESS_MAPS": not self.diffuse and any(m.metallic_roughness_texture for m in materials),
            "HAS_NORMAL_MAPS": not self.diffuse and any(m.normal_texture for m in materials),
            "HAS_VERTEX_COLORS": any(mesh.colors is not None for mesh in scene.meshes),
            "HAS_COATS": not self.diffuse,
            "HAS_EMISSION": any(max(m.emission) > 0 or m.unlit for m in materials),
            "HAS_EMITTERS": any(max(m.emission) > 0 for m in materials),
            "HAS_ENVIRONMENT": bool(scene.environment and max(scene.environment.color) > 0),
            "HAS_PICTURED_ENVIRONMENT": bool(scene.environment and scene.environment.image is not None),
        }
        self._fill_info(scene, table.count, table.environment_pdf)

    def update_draws(self, scene: Scene) -> DrawList:
        """Send what raster passes need, if it changed; call it after `update`."""
        if self._raster_stale or self.draws is None:
            scene = _without_empty(scene)
            self.draws = build_draw_list(scene.instances, self._hierarchy, self._raster_meshes)
            for name in ("vertices", "sources", "indices", "slots"):
                self.resources.buffer(f"raster_{name}", getattr(self.draws, name))
            self._raster_stale = False
        self.draws.clusters.place(self._hierarchy.instances["world_from_local"])
        return self.draws

    def direct_lights(self, scene: Scene, dtype: np.dtype, samples: int, use_range: bool) -> NDArray[np.void]:
        """Return the lights that deferred techniques loop over; call it after `update`."""
        ranges = [getattr(light, "range", None) for light in scene.lights]
        key = (samples, use_range, ranges, self._geometry, self._sources)
        if key != self._direct[0]:
            lights = build_direct_lights(_without_empty(scene), self._hierarchy, dtype, samples, use_range)
            self._direct = (key, lights)
        return self._direct[1]

    def surface_samples(self, scene: Scene) -> NDArray[np.float64]:
        """Return points spread over the surfaces, relative to the origin; call it after `update`."""
        if self._samples is None or self._samples[0] != self._geometry:
            self._samples = (self._geometry, sample_surfaces(_without_empty(scene).instances, self._hierarchy))
        return self._samples[1]

    def update_areas(self, scene: Scene, table: AreaCdf) -> None:
        """Bring a table of areas up to date; call it after `update`."""
        table.update(_without_empty(scene).instances, self._hierarchy)

    def update_solids(self, choice: str) -> None:
        """Bring up to date which triangles bound solids; call it after `update`."""
        if self._solid_key != (self._geometry, choice):
            self._solid_key = (self._geometry, choice)
            self.solids.update(self._hierarchy.placements(), self._hierarchy.triangles, choice)
            self.resources.buffer("solid_triangles", self.solids.bits)

    def update_motion(self, scene: Scene) -> None:
        """Send where each instance was at the last call; call it after `update`."""
        instances = _without_empty(scene).instances
        now = np.array([i.world_from_local for i in instances], np.float64).reshape(-1, 4, 4)
        # An instance that was not there has not moved.
        known = {id(i): matrix for i, matrix in self._before}
        before = np.array([known.get(id(i), m) for i, m in zip(instances, now, strict=True)]).reshape(-1, 4, 4)
        self._before = list(zip(instances, now, strict=True))
        to_origin, from_origin = np.eye(4), np.eye(4)
        to_origin[:3, 3], from_origin[:3, 3] = -self.origin, self.origin
        change = to_origin @ before @ np.linalg.inv(now) @ from_origin if len(now) else np.eye(4)[None]
        # What stands still moves by nothing, not by the rounding of an inverse.
        change[np.all(before == now, (1, 2)) if len(now) else [True]] = np.eye(4)
        columns = np.zeros((len(change), 4, 4), np.float32)  # a mat4x3f has columns of 16 bytes
        columns[..., :3] = change[:, :3].transpose(0, 2, 1)
        self.resources.records("before_from_now", columns)

    def release(self) -> None:
        """Free all GPU memory; do not use this object any more."""
        self.resources.release()

    def view(
        self, camera: Camera, size: tuple[int, int], jitter: bool, offset: tuple[float, float] = (0.5, 0.5)
    ) -> NDArray[np.void]:
        """Return the View uniform of a camera for a picture of `size` (width, height).

        `jitter` is for rays that each go through a random point of their pixel, `offset` where all others go through
        it. Raises GiError for a camera that sees nothing.
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
        view["jitter"], view["size"], view["offset"] = jitter, size, offset
        radius = max(self._hierarchy.radius, 1e-30)
        # How far the scene reaches along the view.
        far = max(float((self._hierarchy.centre - view["position"]) @ view["forward"]) + radius, radius)
        clip = camera.clip_from_world(size, self.origin, NEAR * radius, far, offset)
        view["clip_from_world"] = clip.T
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

    def _upload_environment(self, scene: Scene) -> None:
        environment = scene.environment
        image = environment.image if environment else None
        color = tuple(environment.color) if environment else None
        # The picture counts by identity: it is immutable once in use. Its table depends on the colour, too.
        new_image = "environment" not in self.resources or self._environment[0] is not image
        new_table = new_image or self._environment[1] != color
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
            self.resources.texture("environment", "rgba32float", pixels)
        if new_table:
            self._cdf = environment_cdf(environment) if environment and max(environment.color) > 0 else None
            table = self._cdf if self._cdf is not None else np.ones((1, 2), np.float32)
            self.resources.texture("environment_cdf", "r32float", table[..., None])
        self._environment = (image, color)


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
    shared = [
        (id(m), tuple(m.emission), m.double_sided, m.unlit, _texture_values(m.emission_texture)) for m in materials
    ]
    # Emitters may be cut out.
    cut = [
        (tuple(m.base_color), m.alpha_mode, m.alpha_cutoff, _texture_values(m.base_color_texture))
        for m in materials
        if max(m.emission) > 0
    ]
    return [*shared, *cut]


def _texture_values(texture: Texture | None) -> tuple[Any, ...]:
    """Return what a texture is, comparable."""
    return () if texture is None else tuple(tuple(v) if isinstance(v, list) else v for v in vars(texture).values())
