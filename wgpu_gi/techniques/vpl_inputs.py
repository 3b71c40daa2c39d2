"""What changes with the scene for virtual point lights: areas and the layout of reflective shadow maps."""

from __future__ import annotations

from dataclasses import replace

from ..gpu.graph import Graph
from ..gpu.wgsl import load
from ..scene.area_table import AreaTable
from ..scene.rsm_layout import rsm_layout
from ..scene.scene import Scene
from ..scene.upload import SceneUpload
from .rsm import RsmSettings
from .scene_inputs import SceneInputs, VplInputs

NAMES = ("area_instances", "area_cdf", "rsm_lights")


class ManyLightInputs:
    """Keeps them up to date with a scene; one for each renderer."""

    def __init__(self) -> None:
        self._table = AreaTable(load("points/sample.wgsl").struct_dtype("AreaInstance"))
        self._rsm_light = load("rsm/trace.wgsl").struct_dtype("RsmLight")
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
