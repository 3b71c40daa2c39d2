"""The scene's buffers and textures as handles of a graph, by the WGSL names of `wgsl/scene/`."""

from __future__ import annotations

from dataclasses import dataclass

from ..gpu.graph import Graph
from ..gpu.handles import Shared
from ..gpu.wgsl import load
from ..scene.upload import SceneUpload

SURFACE_INPUTS = ("materials", "atlas_srgb", "atlas_linear", "nodes", "triangles", "indices", "vertices", "instances")
LIGHT_INPUTS = ("lights", "environment", "environment_cdf")


@dataclass
class SceneInputs:
    """`surfaces` is what rays need to hit and shade, `lights` what light sampling needs; both go into `reads=`."""

    surfaces: dict[str, Shared]
    lights: dict[str, Shared]
    features: dict[str, bool]

    def constants(self, shader: str) -> dict[str, bool]:
        """Return the HAS_ constants that `shader` declares: code for what the scene lacks is compiled out."""
        return {name: value for name, value in self.features.items() if name in load(shader).overrides}


def share_scene(graph: Graph, upload: SceneUpload) -> SceneInputs:
    """Make an uploaded scene known to the graph; call it again after each `upload.update`."""
    handles = {name: graph.share(f"scene/{name}", *upload.resources[name]) for name in SURFACE_INPUTS + LIGHT_INPUTS}
    return SceneInputs(
        {name: handles[name] for name in SURFACE_INPUTS},
        {name: handles[name] for name in LIGHT_INPUTS},
        dict(upload.features),
    )
