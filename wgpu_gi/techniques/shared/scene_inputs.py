"""The scene's buffers and textures as handles of a graph, by the WGSL names of `wgsl/scene/`.

A technique's inputs are a subclass that adds the scene data only this technique needs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ...gpu.graph import Graph
from ...gpu.handles import Shared
from ...gpu.wgsl.load import load
from ...upload.draw_list import DrawList
from ...upload.scene_upload import SceneUpload

SURFACE_INPUTS = ("materials", "atlas_srgb", "atlas_linear", "nodes", "triangles", "vertices", "instances")
LIGHT_INPUTS = ("lights", "environment", "environment_cdf")
RASTER_INPUTS = ("raster_vertices", "raster_sources", "raster_slots")


@dataclass
class SceneInputs:
    """The scene data of rays: `surfaces` to hit and shade, `lights` to sample; both go into `reads=`.

    `features`: values of the shaders' HAS_ constants for this scene. `upload` owns the resources.
    """

    surfaces: dict[str, Any]  # Shared, and the sampler of the atlases
    lights: dict[str, Shared]
    features: dict[str, bool]
    upload: SceneUpload

    @property
    def is_preview(self) -> bool:
        """True if the still picture starts over without this frame."""
        return False

    def constants(self, shader: str) -> dict[str, bool]:
        """Return the HAS_ constants that `shader` declares; code for absent features is compiled out."""
        return declared_features(shader, self.features)

    def shape(self) -> tuple[object, ...]:
        """Return the values whose change forces the passes to be redeclared; contents of bound resources do not."""
        return (tuple(self.features.items()), self.upload, self.upload.has_figures)


@dataclass
class RasterInputs(SceneInputs):
    """Adds the data of raster passes: `raster` goes into `reads=` of passes that draw `draws` by `raster_indices`."""

    raster: dict[str, Shared]
    raster_indices: Shared
    draws: DrawList

    def shape(self) -> tuple[object, ...]:
        """Return the values whose change forces the passes to be redeclared."""
        return (*super().shape(), self.draws.opaque, self.draws.masked)


def declared_features(shader: str, features: dict[str, bool]) -> dict[str, bool]:
    """Return those of the HAS_ constants that `shader` declares."""
    declared = load(shader).overrides
    return {name: value for name, value in features.items() if name in declared}


def declare_deformation(graph: Graph, scene: SceneInputs) -> None:
    """List the deformation of skinned and morphed meshes, which runs before all passes."""
    if scene.upload.has_figures:
        graph.outside("deform", scene.upload.deformation)
    else:
        graph.skip("deform", "no mesh is skinned or morphed", "nothing")


def share_scene(graph: Graph, upload: SceneUpload) -> SceneInputs:
    """Register an uploaded scene with the graph; call it after each `upload.update` and `set_seed`."""
    graph.uniform("scene", upload.info)
    surfaces, lights = (_share(graph, upload, names) for names in (SURFACE_INPUTS, LIGHT_INPUTS))
    surfaces["atlas_sampler"] = graph.sampler("linear")
    return SceneInputs(surfaces, lights, dict(upload.features), upload)


def share_raster(graph: Graph, upload: SceneUpload) -> RasterInputs:
    """Register an uploaded scene and its draws with the graph; call it after each `upload.update_draws`."""
    assert upload.draws is not None
    indices = _share(graph, upload, ("raster_indices",))["raster_indices"]
    scene = share_scene(graph, upload)
    return RasterInputs(
        **vars(scene), raster=_share(graph, upload, RASTER_INPUTS), raster_indices=indices, draws=upload.draws
    )


def _share(graph: Graph, upload: SceneUpload, names: tuple[str, ...]) -> dict[str, Any]:
    return {name: graph.share(f"scene/{name}", *upload.resources[name]) for name in names}
