"""Sends a scene to the GPU as buffers and textures, and later only what changed.

Each resource has a version that grows with its contents; the render graph runs the passes that read it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera, Window
from ..gpu.device import Device
from ..gpu.wgsl.load import load
from ..scene.check import check_scene
from ..scene.scene import Instance, Light, Material, Scene, values_of
from .area_cdf import AreaCdf
from .deformation import Deformation
from .direct_lights import build_direct_lights
from .draw_list import DrawList, RasterMesh, build_draw_list
from .emitter_tree import NO_EMITTERS, build_emitter_tree
from .environment import EnvironmentUpload
from .figures import Figures, figures_by_mesh
from .instance_motion import InstanceMotion
from .layers import is_clear, layer_features
from .light_table import LightTable, build_light_table
from .light_values import emission_key, emitted_radiance, environment_radiance, light_unit
from .materials import MaterialUpload
from .mesh_data import Topology
from .resources import GpuResources
from .see_through import has_openings, is_see_through
from .solid_meshes import SolidMeshes
from .surface_samples import SurfaceSamples
from .tree_builder import TreeBuilder
from .two_level_bvh import TwoLevelBvh

TABLES = ("nodes", "triangles", "vertices")  # stored in textures, which llvmpipe reads faster than buffers
NEAR = 1e-9  # near plane over the scene's radius; a near plane this close costs reversed float depth no precision
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
        self.scene = Scene()  # of the last update
        shader = load("scene/lights.wgsl")
        self._dtypes = {name: shader.struct_dtype(struct) for name, struct in STRUCTS.items()}
        self._view_dtype = shader.struct_dtype("View")
        self.resources = GpuResources(device.gpu, int(device.limits["max-storage-buffer-binding-size"]))
        self._hierarchy = TwoLevelBvh(self._dtypes, TreeBuilder(device))
        self._geometry = 0
        self._unsent: set[str] = set()  # arrays of the hierarchy that changed, also in an update that failed
        self._materials = MaterialUpload(self.resources, self._dtypes["materials"], diffuse)
        self._environment = EnvironmentUpload(self.resources)
        self._figures = Figures()
        self.deformation = Deformation(device, self.resources)
        self.deformation.reserve(0)
        self._posed = False  # figures have new poses, also in an update that failed
        self._motion = InstanceMotion()
        self._motion_geometry = (-1, -1)  # versions of the geometry at the last two calls of `update_motion`
        # Data computed from the scene, each with a key of its inputs.
        self._table: LightTable | None = None
        self._table_key: object = None
        self._direct: tuple[object, NDArray] = (None, np.zeros(0))
        self._emitters: tuple[object, int] = (None, 0)
        self._sampler = SurfaceSamples()
        self._samples: tuple[int, NDArray[np.float64]] | None = None
        self.solids = SolidMeshes()
        self._solid_key: tuple[int, str] | None = None
        self.draws: DrawList | None = None
        self._raster_meshes: WeakKeyDictionary[Topology, RasterMesh] = WeakKeyDictionary()
        self._raster_stale = True
        self._raster_moved: set[int] = set()  # ids of meshes with other positions than in `draws`
        self._placed = -1  # geometry version of the boxes that draws are culled by
        self.info = np.zeros((), shader.struct_dtype("SceneInfo"))
        self.features: dict[str, bool] = {}

    def set_seed(self, seed: int) -> None:
        """Set the seed of random choices at see-through surfaces; call before the scene is shared with a graph."""
        self.info["seed"] = seed

    @property
    def origin(self) -> NDArray[np.float64]:
        """World position, (3,) metres, that all positions on the GPU are relative to."""
        return self._hierarchy.origin

    @property
    def box(self) -> NDArray[np.float64]:
        """Lower and upper corner of the scene's bounds relative to the origin, (2, 3) metres."""
        return self._hierarchy.box

    @property
    def geometry(self) -> int:
        """A version that grows when meshes or transforms change."""
        return self._geometry

    @property
    def has_figures(self) -> bool:
        """True if the device deforms any mesh."""
        return bool(self._hierarchy.figures)

    @property
    def light_table(self) -> tuple[NDArray[np.void], int]:
        """The records that light sampling chooses from, and how many of them are lights."""
        assert self._table is not None
        return self._table.lights, self._table.count

    def update(self, scene: Scene) -> None:
        """Send what changed since the last call.

        Raises GiError for invalid values (a singular transform, a negative light) and for scenes beyond the device's
        limits.
        """
        check_scene(scene)
        self.scene = scene
        self._figures.update(_without_empty(scene).instances)
        self._posed |= self._figures.changed
        scene = self._shown(scene)
        materials = scene.materials
        # Geometry: hierarchy, triangles, vertices and instances.
        figures = figures_by_mesh(self._figures.known)
        self._hierarchy.update(scene.instances, {id(m): k for k, m in enumerate(materials)}, figures, self._posed)
        self._motion.note_vertices(self._hierarchy)
        self._unsent |= self._hierarchy.changed
        self._raster_stale |= self._hierarchy.changes_draws
        self._raster_moved |= self._hierarchy.moved_meshes
        self._geometry += bool(self._hierarchy.changed)
        # Images: the light table needs their averages.
        self._materials.send_images(materials)
        self._environment.send(scene.environment)
        # The light table, only if a light, an emitter or a transform changed: it takes long with many emitters.
        key = (_light_values(scene.lights), [emission_key(m) for m in materials], self.resources["environment_cdf"][1])
        if self._table is None or self._unsent or key != self._table_key:
            self._table = build_light_table(scene, self._hierarchy, self._environment.cdf, self._dtypes["lights"])
            self._table_key = key
            self.resources.records("lights", self._table.lights)
        # Materials: they hold the pdf of their emitters.
        self._materials.send_records(materials, self._table.material_pdf)
        for name in ("nodes", "triangles", "vertices", "instances"):
            if name in self._unsent or name not in self.resources:
                send = self.resources.table if name in TABLES else self.resources.buffer
                send(name, getattr(self._hierarchy, name))
        # What the device deforms.
        if not figures:
            self.deformation.release()
        if figures and self._unsent & {"triangles", "vertices"}:
            self.deformation.load(self._hierarchy)
        if figures and (self._posed or self.deformation.due):
            self.deformation.pose(self._posed)
        self._posed = False
        self._unsent.clear()
        self.features = self._find_features(scene, materials)
        self._fill_info(scene, self._table)

    def expect_motion(self, instances: list[Instance]) -> None:
        """Prepare for motion of these instances; call before the first `update`.

        What `update` sends then does not depend on whether they have moved before.
        """
        self._hierarchy.expect_motion(instances)

    def forget_layout(self) -> None:
        """Make what the next `update` sends independent of earlier ones; the trees of rigid meshes stay."""
        self._hierarchy.forget_layout()
        self._figures = Figures()

    def first_vertices(self) -> list[int]:
        """Return for each instance on the GPU which entry of the table of vertices its mesh begins at."""
        return [self._hierarchy.placement(i.mesh).vertices.start for i in self._shown(self.scene).instances]

    def update_draws(self, scene: Scene) -> DrawList:
        """Return the draw list of raster passes, sent to the GPU if it changed; call after `update`."""
        instances = self._shown(scene).instances
        if self._raster_stale or self.draws is None:
            self.draws = build_draw_list(instances, self._hierarchy, self._raster_meshes)
            for name in ("vertices", "sources", "indices", "slots"):
                self.resources.buffer(f"raster_{name}", getattr(self.draws, name))
            self._raster_stale, self._placed = False, -1
            self._raster_moved.clear()
        for place in self._hierarchy.placements() if self._raster_moved else ():
            mesh = place.data.mesh
            if id(mesh) in self._raster_moved:
                moved = self.draws.move(place, [k for k, i in enumerate(instances) if i.mesh is mesh])
                self.resources.part("raster_vertices", moved.start, self.draws.vertices[moved])
        self._raster_moved.clear()
        if self._placed != self._geometry:
            posed = {k: f.box for k, i in enumerate(instances) if (f := self._hierarchy.figures.get(id(i.mesh)))}
            self.draws.clusters.place(self._hierarchy.instances["world_from_local"], posed)
            self._placed = self._geometry
        if self._hierarchy.figures:
            self.deformation.draw(self.draws)
        return self.draws

    def direct_lights(self, scene: Scene, dtype: np.dtype, samples: int, use_range: bool) -> NDArray[np.void]:
        """Return the lights that deferred techniques loop over, records of `dtype`; call after `update`."""
        ranges = [getattr(light, "range", None) for light in scene.lights]
        key = (samples, use_range, ranges, self._geometry, self._table_key)
        if key != self._direct[0]:
            lights = build_direct_lights(self._shown(scene), self._hierarchy, dtype, samples, use_range)
            self._direct = (key, lights)
        return self._direct[1]

    def update_emitters(self, scene: Scene) -> int:
        """Send the tree of emitters if it changed; return its number of leaves. Call after `update`."""
        key = (self._geometry, self._table_key)
        if key != self._emitters[0]:
            tree, leaves = build_emitter_tree(self._shown(scene), self._hierarchy)
            self.resources.table("emitters", tree)
            self._emitters = (key, leaves)
        return self._emitters[1]

    def without_emitters(self) -> int:
        """Send an empty tree of emitters; return its number of leaves, 0."""
        self.resources.table("emitters", NO_EMITTERS)
        self._emitters = (None, 0)
        return 0

    def surface_samples(self, scene: Scene) -> NDArray[np.float64]:
        """Return points spread over the surfaces, (n, 3) relative to the origin; call after `update`."""
        if self._samples is None or self._samples[0] != self._geometry:
            self._samples = (self._geometry, self._sampler.draw(self._shown(scene).instances, self._hierarchy))
        return self._samples[1]

    def update_areas(self, scene: Scene, table: AreaCdf) -> None:
        """Update a CDF of areas; call after `update`."""
        table.update(self._shown(scene).instances, self._hierarchy)

    def update_solids(self, choice: str) -> None:
        """Send which triangles bound solids, if changed; `choice` as in `SolidMeshes.update`. Call after `update`."""
        if self._solid_key != (self._geometry, choice):
            self._solid_key = (self._geometry, choice)
            self.solids.update(self._hierarchy.placements(), self._hierarchy.triangles, choice)
            self.resources.buffer("solid_triangles", self.solids.bits)

    def update_motion(self, scene: Scene) -> None:
        """Send how each instance has moved since the last call; call after `update`."""
        # Nothing has moved in this call or the previous one: the GPU already has the identities.
        if self._motion_geometry == (self._geometry, self._geometry):
            return
        self._motion_geometry = (self._motion_geometry[1], self._geometry)
        instances = self._shown(scene).instances
        self.resources.records("before_from_now", self._motion.update(instances, self._hierarchy, self.deformation))

    def forget_motion(self) -> None:
        """Forget where everything was: in the next frame nothing has moved."""
        self._motion.forget()
        self._motion_geometry = (-1, -1)

    def release(self) -> None:
        """Free all GPU memory; do not use this object any more."""
        self.resources.release()
        self.deformation.release()

    def view(
        self,
        camera: Camera,
        size: tuple[int, int],
        jitter: bool,
        offset: tuple[float, float] = (0.5, 0.5),
        transparent: bool = False,
        footprint: float = 0.0,
        anisotropy: int = 1,
        window: Window | None = None,
    ) -> NDArray[np.void]:
        """Return the View uniform of a camera for a picture of `size` (width, height), or for a `window` of that size.

        With `jitter` each ray goes through a random point of its pixel, otherwise all go through `offset`. Textures are
        averaged over a square of `footprint` pixels (0: read at a point), by at most `anisotropy` samples along its
        longer axis.
        `transparent`: the camera does not see the environment, which lights the scene all the same. The camera must be
        one that `check_camera` accepts, or a technique's own.
        """
        view = np.zeros((), self._view_dtype)
        corner, whole = window or Window((0, 0), size)
        # The camera's position and axes; `right` and `up` reach from the middle to the edges of the picture.
        matrix = np.asarray(camera.world_from_view, np.float64)
        half_height = np.tan(camera.yfov / 2)
        if camera.orthographic_height is not None:
            half_height = camera.orthographic_height / 2
        view["position"] = matrix[:3, 3] - self.origin
        view["right"] = matrix[:3, 0] * half_height * whole[0] / whole[1]
        view["up"] = matrix[:3, 1] * half_height
        view["forward"] = -matrix[:3, 2]
        view["orthographic"] = camera.orthographic_height is not None
        view["jitter"], view["size"], view["offset"] = jitter, size, offset
        view["whole"], view["corner"] = whole, corner
        view["background"] = 0.0 if transparent else 1.0
        view["footprint"], view["anisotropy"] = footprint, anisotropy
        # The projection; the far plane, which only orthographic cameras have, lies behind the scene.
        radius = max(self._hierarchy.radius, 1e-30)
        far = max(float((self._hierarchy.centre - view["position"]) @ view["forward"]) + radius, radius)
        clip = camera.clip_from_world(whole, self.origin, NEAR * radius, far, offset)
        view["clip_from_world"] = clip.T
        return view

    def _shown(self, scene: Scene) -> Scene:
        """Return the scene without empty instances, and with stand-ins for figures."""
        kept = _without_empty(scene)
        instances = self._figures.shown(kept.instances)
        return kept if instances is kept.instances else Scene(instances, kept.lights, kept.environment)

    def _find_features(self, scene: Scene, materials: list[Material]) -> dict[str, bool]:
        """Return the HAS_ constants of shaders; pipelines leave out what the scene does not have."""
        emissive = any(emitted_radiance(m).any() for m in materials)
        environment = scene.environment
        layers = layer_features([] if self.diffuse else materials)
        return {
            **layers,
            "HAS_INSTANCES": self._hierarchy.has_instances,
            "HAS_DEFORMATION": bool(self._hierarchy.figures) or self._motion.has_moved_vertices,
            "HAS_BLENDS": any(m.alpha_mode == "blend" for m in materials),
            "HAS_SEE_THROUGH": any(is_see_through(m, self.diffuse) for m in materials),
            "PASSES_GLASS": False,  # set by techniques whose shadow rays do
            "HAS_TINTS": not self.diffuse and any(map(is_clear, materials)),
            "HAS_MASKS": any(map(has_openings, materials)),
            "HAS_CUT_OUTS": any(m.alpha_mode == "mask" for m in materials),
            "HAS_TEXTURES": self._materials.has_textures,
            "HAS_EMISSION_MAPS": any(m.emission_texture for m in materials),
            "HAS_ROUGHNESS_MAPS": not self.diffuse and any(m.metallic_roughness_texture for m in materials),
            "HAS_NORMAL_MAPS": not self.diffuse and any(m.normal_texture for m in materials),
            "HAS_DEEP_MAPS": self._materials.has_deep_maps,
            "HAS_VERTEX_COLORS": any(place.data.mesh.colors is not None for place in self._hierarchy.placements()),
            "HAS_COATS": not self.diffuse,
            "HAS_METALS": not self.diffuse and any(m.metallic > 0 and not m.unlit for m in materials),
            "HAS_EMISSION": emissive or any(m.unlit for m in materials),
            "HAS_EMITTERS": emissive,
            "HAS_PUNCTUAL_LIGHTS": bool(scene.lights),
            "HAS_ENVIRONMENT": bool(environment_radiance(environment).any()),
            "HAS_PICTURED_ENVIRONMENT": bool(environment and environment.image is not None),
        }

    def _fill_info(self, scene: Scene, table: LightTable) -> None:
        """Fill the SceneInfo uniform; call after `_find_features`."""
        info, environment = self.info, scene.environment
        info["frame_low"], info["frame_scale"] = self._hierarchy.world.low, self._hierarchy.world.scale
        info["centre"], info["radius"] = self._hierarchy.centre, self._hierarchy.radius
        info["root"], info["light_count"] = self._hierarchy.root, table.count
        info["environment_color"] = environment_radiance(environment)
        info["environment_pdf"] = table.environment_pdf
        info["environment_rotation"] = environment.rotation / (2 * np.pi) % 1.0 if environment else 0.0
        info["light_unit"] = light_unit(scene)
        info["hittable_light"] = self.features["HAS_EMITTERS"] or self.features["HAS_ENVIRONMENT"]


def _without_empty(scene: Scene) -> Scene:
    """Return the scene without instances that have no triangles."""
    kept = [i for i in scene.instances if len(i.mesh.triangles)]
    return Scene(kept, scene.lights, scene.environment) if len(kept) < len(scene.instances) else scene


def _light_values(lights: Sequence[Light]) -> list[tuple[Any, ...]]:
    """Return the values of punctual lights that the light table depends on, in comparable form."""
    return [
        (type(light), *(np.asarray(v).tobytes() for k, v in values_of(light).items() if k not in ("name", "range")))
        for light in lights
    ]
