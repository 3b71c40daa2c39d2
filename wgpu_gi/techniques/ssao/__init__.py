"""SSAO (`--gi ssao`): the environment's light times a grey share, the ambient occlusion found in screen space.

Mittring 2007, "Finding Next Gen: CryEngine 2", section 8.5.4.3. Departure: occluders come from SSDO's search, with its
settings (`ssdo`), so both differ only by directional light.
"""

from __future__ import annotations

from dataclasses import replace

from ...gpu.graph import Graph
from ..deferred.base import declare_base
from ..deferred.direct import declare_direct
from ..deferred.transmission import with_transmission
from ..shared.stage import BOUNCES, DIRECT, DIRECT_FACTORS
from ..shared.technique import Light, Technique
from ..ssdo.inputs import SsdoInputs
from ..ssdo.occlusion import History, declare_occlusion
from ..ssdo.sources import declare_sources
from ..ssdo.update import OcclusionOptions, occlusion_inputs

TECHNIQUE = Technique(
    sentence="ambient occlusion in screen space, the baseline for SSDO",
    bounces=0,
    most_bounces=0,
    is_random=True,
    screen_space=True,
    options=OcclusionOptions,
    inputs=occlusion_inputs,
    stages=(replace(DIRECT, factors=DIRECT_FACTORS | {"ssdo.directions": 4.0}), BOUNCES),
)


def declare_ssao(graph: Graph, settings: OcclusionOptions, scene: SsdoInputs) -> Light:
    """Declare direct light, W/(m2 sr), with the environment occluded by a grey share."""
    sources = declare_sources(graph, scene)
    base = declare_base(graph, settings, scene, gbuffer=sources.layers[0], lobes=True)
    history = History(settings.temporal, base.motion)
    occlusion = declare_occlusion(
        graph,
        settings.ssdo,
        scene,
        sources,
        base.ambient,
        history,
        settings.seed,
        scene.frames,
        directional=False,
        reflects=False,
    )
    direct = declare_direct(
        graph,
        settings.direct,
        scene,
        base.gbuffer,
        base.shadow_maps,
        base.ambient,
        settings.seed,
        occlusion.sky,
        sources.layers,
    )
    light = Light(
        base.gbuffer.emission, direct, views={"motion": base.motion}, distance=base.gbuffer.distance, tint=base.tint
    )
    return with_transmission(graph, scene, base.gbuffer, light, 0, settings.seed)
