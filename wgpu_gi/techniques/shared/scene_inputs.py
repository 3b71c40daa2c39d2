"""The scene's buffers and textures as handles of a graph, by the WGSL names of `wgsl/scene/`."""

from __future__ import annotations

from dataclasses import dataclass, replace

from ...gpu.graph import Graph
from ...gpu.handles import Shared
from ...gpu.wgsl.load import load
from ...upload.draw_list import DrawList
from ...upload.scene_upload import SceneUpload

SURFACE_INPUTS = ("materials", "atlas_srgb", "atlas_linear", "nodes", "triangles", "vertices", "instances")
LIGHT_INPUTS = ("lights", "environment", "environment_cdf")
RASTER_INPUTS = ("raster_vertices", "raster_sources", "raster_slots")


@dataclass
class DirectInputs:
    """The table of the lights that deferred techniques loop over; their shadow views and the side of the atlas."""

    lights: Shared
    count: int
    bounded: int  # of them end somewhere: spots, and lights with a range
    features: dict[str, bool]  # which kinds there are, as constants of shaders
    views: Shared
    atlas_size: int  # texels; 0: no light casts shadows
    before_from_now: Shared  # the motion of each instance


@dataclass
class VplInputs:
    """Where points go on the surfaces, and how reflective shadow maps are shared out; `rsm_texels` in all."""

    area_instances: Shared
    area_cdf: Shared
    rsm_lights: Shared
    rsm_texels: int


@dataclass
class ScreenInputs:
    """How many layers and further cameras show the scene, and what of those asked for is left out, with the reason."""

    layers: int
    cameras: int
    skipped: tuple[tuple[str, str], ...]


@dataclass
class SolidInputs:
    """Which triangles bound solids, a bit each, and whether there are such and others."""

    triangles: Shared
    has_solids: bool
    has_shells: bool


@dataclass
class SceneInputs:
    """`surfaces` is what rays need to hit and shade, `lights` what light sampling needs; both go into `reads=`.

    `raster` goes there for passes that draw `draws` by `raster_indices`; these and
    `direct` are empty for the path tracer.
    """

    surfaces: dict[str, Shared]
    lights: dict[str, Shared]
    features: dict[str, bool]
    raster: dict[str, Shared]
    raster_indices: Shared | None
    draws: DrawList | None
    upload: SceneUpload  # what all this comes from; its draws and their places may change under a declaration
    direct: DirectInputs | None = None
    vpl: VplInputs | None = None  # of many-light
    screen: ScreenInputs | None = None  # of ssdo
    solids: SolidInputs | None = None  # of SSIL

    def constants(self, shader: str) -> dict[str, bool]:
        """Return the HAS_ constants that `shader` declares: code for what the scene lacks is compiled out."""
        features = self.features | (self.direct.features if self.direct is not None else {})
        return {name: value for name, value in features.items() if name in load(shader).overrides}

    def shape(self) -> tuple[object, ...]:
        """Return all that makes another declaration of the passes; what they bind may have other contents."""
        runs = (self.draws.opaque, self.draws.masked) if self.draws is not None else ()
        lights: tuple[object, ...] = ()
        if self.direct is not None:
            lights = (
                self.direct.count,
                self.direct.bounded,
                self.direct.atlas_size,
                tuple(self.direct.features.items()),
            )
        texels = self.vpl.rsm_texels if self.vpl is not None else 0
        screen = (self.screen.layers, self.screen.cameras, self.screen.skipped) if self.screen is not None else ()
        kinds = (self.solids.has_solids, self.solids.has_shells) if self.solids is not None else ()
        return (tuple(self.features.items()), runs, lights, texels, screen, kinds, self.upload)


def share_scene(graph: Graph, upload: SceneUpload) -> SceneInputs:
    """Make an uploaded scene known to the graph; call it again after each `upload.update`."""

    def share(names: tuple[str, ...]) -> dict[str, Shared]:
        return {name: graph.share(f"scene/{name}", *upload.resources[name]) for name in names}

    drawn = upload.draws is not None
    return SceneInputs(
        share(SURFACE_INPUTS),
        share(LIGHT_INPUTS),
        dict(upload.features),
        share(RASTER_INPUTS) if drawn else {},
        share(("raster_indices",))["raster_indices"] if drawn else None,
        upload.draws,
        upload,
    )


def share_solids(graph: Graph, upload: SceneUpload, scene: SceneInputs) -> SceneInputs:
    """Return the inputs with the triangles that bound solids; call it after `upload.update_solids`."""
    triangles = graph.share("scene/solid_triangles", *upload.resources["solid_triangles"])
    return replace(scene, solids=SolidInputs(triangles, upload.solids.has_solids, upload.solids.has_shells))
