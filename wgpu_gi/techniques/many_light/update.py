"""Brings what many-light needs of a scene up to date, once per frame."""

from __future__ import annotations

from typing import Protocol

from ...gpu.wgsl.load import load
from ...upload.area_cdf import AreaCdf
from ...upload.rsm_layout import rsm_layout
from ..deferred.update import DeferredOptions, deferred_inputs
from ..shared.technique import Shot
from ..shared.temporal import TemporalSettings
from ..ssdo.settings import SsdoSettings
from .filters import DenoiseSettings
from .gather import GatherSettings
from .inputs import ManyLightInputs, VplInputs
from .ism import IsmSettings
from .rsm import RsmSettings
from .vpl import VplSettings

RESOURCES = ("area_instances", "area_cdf", "rsm_lights")


class ManyLightOptions(DeferredOptions, Protocol):
    """The settings that many-light reads; of `ssdo`, those of the near field."""

    bounces: int | None
    seed: int
    rsm: RsmSettings
    vpl: VplSettings
    ism: IsmSettings
    gather: GatherSettings
    temporal: TemporalSettings
    denoise: DenoiseSettings
    ssdo: SsdoSettings


class AreaState:
    """The table of areas, and the geometry that it was made of."""

    def __init__(self) -> None:
        self.table = AreaCdf(load("many_light/points/sample.wgsl").struct_dtype("AreaInstance"))
        self.rsm_light = load("many_light/rsm/trace.wgsl").struct_dtype("RsmLight")
        self.geometry = -1


def many_light_inputs(shot: Shot, settings: ManyLightOptions) -> ManyLightInputs:
    """Bring areas and the layout of reflective shadow maps up to date; return what passes read."""
    deferred = deferred_inputs(shot, settings)
    upload, state = shot.upload, shot.kept(AreaState)
    # Another kind of materials has another upload, which has no areas yet.
    if state.geometry != upload.geometry or RESOURCES[0] not in upload.resources:
        state.geometry = upload.geometry
        upload.update_areas(shot.scene, state.table)
        upload.resources.records("area_instances", state.table.instances)
        upload.resources.buffer("area_cdf", state.table.cdf)
    layout, texels = rsm_layout(*upload.light_table, settings.rsm.texels, state.rsm_light)
    upload.resources.records("rsm_lights", layout)
    instances, cdf, lights = (shot.graph.share(f"scene/{name}", *upload.resources[name]) for name in RESOURCES)
    return ManyLightInputs(**vars(deferred), vpl=VplInputs(instances, cdf, lights, texels))
