"""What changes with the scene for virtual point lights: areas and the layout of reflective shadow maps."""

from __future__ import annotations

from dataclasses import replace

from ...gpu.graph import Graph
from ...gpu.wgsl.load import load
from ...scene.scene import Scene
from ...upload.area_cdf import AreaCdf
from ...upload.rsm_layout import rsm_layout
from ...upload.scene_upload import SceneUpload
from ..shared.scene_inputs import SceneInputs, VplInputs
from .rsm import RsmSettings

NAMES = ("area_instances", "area_cdf", "rsm_lights")


class ManyLightInputs:
    """Keeps them up to date with a scene; one for each renderer."""

    def __init__(self) -> None:
        self._table = AreaCdf(load("many_light/points/sample.wgsl").struct_dtype("AreaInstance"))
        self._rsm_light = load("many_light/rsm/trace.wgsl").struct_dtype("RsmLight")
        self._texels = 0
        self._geometry = -1

    def update(self, upload: SceneUpload, scene: Scene, rsm: RsmSettings) -> None:
        """Send what changed; `upload` is up to date with `scene`."""
        # An upload of another kind of materials begins anew.
        if self._geometry != upload.geometry or NAMES[0] not in upload.resources:
            self._geometry = upload.geometry
            upload.update_areas(scene, self._table)
            upload.resources.records("area_instances", self._table.instances)
            upload.resources.buffer("area_cdf", self._table.cdf)
        layout, self._texels = rsm_layout(*upload.light_table, rsm.texels, self._rsm_light)
        upload.resources.records("rsm_lights", layout)

    def share(self, graph: Graph, upload: SceneUpload, scene: SceneInputs) -> SceneInputs:
        """Return the inputs with those of many-light."""
        instances, cdf, lights = (graph.share(f"scene/{name}", *upload.resources[name]) for name in NAMES)
        return replace(scene, vpl=VplInputs(instances, cdf, lights, self._texels))
