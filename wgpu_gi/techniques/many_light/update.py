"""Updates the scene inputs of many-light once per frame."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ...gpu.wgsl.load import load
from ...upload.area_cdf import AreaCdf
from ...upload.light_table import KIND_ENVIRONMENT, KIND_SUN
from ...upload.rsm_layout import rsm_layout
from ..deferred.update import DeferredOptions, deferred_inputs
from ..shared.denoise import DenoiseSettings
from ..shared.technique import Shot
from ..shared.temporal import TemporalSettings
from ..ssdo.settings import SsdoSettings
from .gather import GatherSettings
from .inputs import ManyLightInputs, VplInputs
from .ism import IsmSettings
from .rsm import RsmSettings
from .vpl import VplSettings

# Least pixels of a moving picture that gathers at half resolution. relMSE of single frames, full and half: 1280x720,
# Cornell's point light .0027, .0045, corridor .072, .16, Sponza .17, .39; 320x180, .0038, .011, .10, .24.
COARSE_PIXELS = 1280 * 720
RESOURCES = ("area_instances", "area_cdf", "rsm_lights")


class ManyLightOptions(DeferredOptions, Protocol):
    """The settings that many-light reads; `ssdo` has those of the near field."""

    bounces: int | None
    seed: int
    rsm: RsmSettings
    vpl: VplSettings
    ism: IsmSettings
    gather: GatherSettings
    temporal: TemporalSettings
    denoise: DenoiseSettings
    ssdo: SsdoSettings


class ManyLightState:
    """The table of areas and the layout of reflective shadow maps, with the inputs that they derive from."""

    def __init__(self) -> None:
        self.areas = AreaCdf(load("many_light/points/sample.wgsl").struct_dtype("AreaInstance"))
        self.geometry = -1
        self.rsm_light = load("many_light/rsm/trace.wgsl").struct_dtype("RsmLight")
        self.lights: NDArray[np.void] | None = None
        self.texels = 0  # setting rsm.texels
        self.rsm_texels = 0  # of all maps


def check_light_order(lights: NDArray[np.void], count: int) -> None:
    """Assert the order of the light table that shaders rely on: punctual lights first, the environment last.

    Reflective shadow maps index the first lights; light paths leave the environment out by scaling the random number
    that picks a light (`wgsl/many_light/vpl/light_paths.wgsl`).
    """
    kinds = lights["kind"][:count]
    order = (kinds > KIND_SUN).astype(np.int8) + (kinds == KIND_ENVIRONMENT)
    assert (np.diff(order) >= 0).all(), "the light table must have punctual lights first and the environment last"


def many_light_inputs(shot: Shot, settings: ManyLightOptions) -> ManyLightInputs:
    """Update areas and the layout of reflective shadow maps; return the inputs of the passes."""
    deferred = deferred_inputs(shot, settings)
    upload, state = shot.upload, shot.kept(ManyLightState)
    # A new kind of materials makes a new upload, which has no areas yet.
    if state.geometry != upload.geometry or RESOURCES[0] not in upload.resources:
        state.geometry = upload.geometry
        upload.update_areas(shot.scene, state.areas)
        upload.resources.records("area_instances", state.areas.instances)
        upload.resources.buffer("area_cdf", state.areas.cdf)
    lights, count = upload.light_table
    if state.lights is not lights or state.texels != settings.rsm.texels or RESOURCES[2] not in upload.resources:
        check_light_order(lights, count)
        state.lights, state.texels = lights, settings.rsm.texels
        layout, state.rsm_texels = rsm_layout(lights, count, settings.rsm.texels, state.rsm_light)
        upload.resources.records("rsm_lights", layout)
    instances, cdf, rsm_lights = (shot.graph.share(f"scene/{name}", *upload.resources[name]) for name in RESOURCES)
    vpl = VplInputs(instances, cdf, rsm_lights, state.rsm_texels)
    scale, moves = settings.gather.scale, shot.preview and shot.size[0] * shot.size[1] >= COARSE_PIXELS
    coarse = (scale == "half" or (scale == "moving" and moves)) and not settings.ssdo.near_field
    deferred.preview |= moves and coarse and scale == "moving"
    return ManyLightInputs(**vars(deferred), vpl=vpl, gather_stride=2 if coarse else 1)
