"""Many-light (`--gi many-light`): virtual point lights, gathered with rays or imperfect shadow maps.

Linke 2016, "Design and Implementation of a Many-Light Method for Real-Time Dynamic Global Illumination".
`declare_many_light` and `_declare_indirect` list its stages in order.
"""

from __future__ import annotations

import math

from ...gpu.graph import Graph
from ...gpu.handles import Buffer
from ..deferred.base import Base, declare_base
from ..deferred.direct import declare_direct
from ..deferred.sky import INTERLEAVE as SKY_INTERLEAVE
from ..deferred.sky import declare_sky
from ..deferred.transmission import with_transmission
from ..shared.composite import NOISE_REACH
from ..shared.denoise import FIRST_STEP
from ..shared.gbuffer import declare_gbuffer
from ..shared.stage import DIRECT, Stage
from ..shared.technique import Light, Reach, Technique
from .compensation import SPACING, declare_compensation
from .denoise import History, declare_denoise
from .gather import declare_gather
from .inputs import ManyLightInputs
from .ism import declare_ism
from .lobes import find_lobes
from .near_field import declare_near_field, declare_near_shares
from .photons import declare_photons
from .points import declare_points
from .reflections import declare_reflections
from .rsm import declare_rsm
from .update import ManyLightOptions, many_light_inputs
from .views import (
    declare_ism_views,
    declare_list_view,
    declare_rejected_view,
    declare_rsm_views,
    declare_vpl_view,
)
from .vpl import declare_candidates, declare_light_paths, declare_vpls, pixels_beside

POINTS = 1 << 17  # on all surfaces, for imperfect shadow maps; tools/README.md, "Constants"

NO_RSM = "there is no reflective shadow map: it needs a point, spot or directional light, and bounces"
NO_ISM = "there are no imperfect shadow maps; they need gather.visibility=ism and light that is reflected"

STAGES = (
    DIRECT,
    Stage(
        "visibility",
        exact=("gather.visibility=exact",),
        cheaper=("gather.visibility=sampled", "gather.rays=4"),
        factors={"gather.rays": 4.0},
        values=("gather.visibility=sampled", "gather.adaptive=true"),
    ),
    Stage("choice of lights", "mean", factors={"vpl.count": 4.0, "vpl.paths": 4.0, "gather.interleave": 0.5}),
    Stage(
        "reconstruction",
        exact=("denoise.radius=1", "denoise.levels=0"),
        values=("denoise.levels=1", "denoise.levels=0"),
    ),
    Stage("resolution", exact=("gather.scale=full",), unless=("gather.scale=moving",), values=("gather.scale=full",)),
    Stage(
        "bound of near lights",
        exact=("gather.compensation=true",),
        unless=("gather.clamping=none",),
        values=("gather.compensation=true",),
    ),
)

# Pixels that light crosses before it is filtered: the kernels of photons, and the neighbours that fill short histories.
PHOTON_REACH, HISTORY_REACH = 24, 14


def _reach(settings: ManyLightOptions) -> Reach:
    """Return what a window must hold: the reach of blur and filter, and whole squares of interleaved sampling."""
    taps = sum(FIRST_STEP << level for level in range(settings.denoise.levels))
    filters = settings.denoise.radius + 1 + taps + PHOTON_REACH + HISTORY_REACH
    # A grid of half resolution has squares twice as large.
    squares = 2 * math.lcm(settings.gather.interleave, SPACING, SKY_INTERLEAVE)
    return Reach(filters + NOISE_REACH, squares)


TECHNIQUE = Technique(
    sentence="virtual point lights, with shadow rays or imperfect shadow maps",
    bounces=None,
    is_random=True,
    options=ManyLightOptions,
    inputs=many_light_inputs,
    stages=STAGES,
    reach=_reach,
    views={
        "rsm/position": NO_RSM,
        "rsm/normal": NO_RSM,
        "rsm/flux": NO_RSM,
        "vpl/flux": "there are no virtual point lights, because no light is reflected",
        "ism/atlas": NO_ISM,
        "ism/samples": NO_ISM,
        "gather/lists": "there are no light lists; they need gather.culling=tiled or clustered and light that is"
        " reflected",
        "temporal/rejected": "no history is kept; it needs temporal.frames=2 or more and light that is reflected",
    },
)


def declare_many_light(graph: Graph, settings: ManyLightOptions, scene: ManyLightInputs) -> Light:
    """Declare direct light, and indirect light from virtual point lights, W/(m2 sr)."""
    reflects = settings.bounces != 0
    gbuffer = declare_gbuffer(graph, scene, pixels=pixels_beside(graph, settings.vpl))[0]
    base = declare_base(graph, settings, scene, gbuffer=gbuffer, albedo=reflects)
    sky = declare_sky(graph, settings.environment, scene, base.gbuffer, base.ambient, settings.seed, scene.frames)
    direct = declare_direct(
        graph, settings.direct, scene, base.gbuffer, base.shadow_maps, base.ambient, settings.seed, sky
    )
    light = Light(
        base.gbuffer.emission, direct, views={"motion": base.motion}, distance=base.gbuffer.distance, tint=base.tint
    )
    if reflects:
        light.indirect = _declare_indirect(graph, settings, scene, base, direct, light.views)
    return with_transmission(graph, scene, base.gbuffer, light, settings.bounces, settings.seed)


def _declare_indirect(
    graph: Graph,
    settings: ManyLightOptions,
    scene: ManyLightInputs,
    base: Base,
    direct: Buffer,
    views: dict[str, Buffer],
) -> Buffer | None:
    """Declare light from virtual point lights and add its debug views; return None where no light is reflected."""
    gbuffer, ambient, seed = base.gbuffer, base.ambient, settings.seed
    # Place virtual point lights on reflective shadow maps, and along light paths for emitters and further bounces.
    albedo = ambient.reads["ambient_albedo"]
    lobes = find_lobes(settings.vpl.lobes, scene)
    rsm = declare_rsm(graph, settings.rsm, scene, lobes, albedo, seed)
    light_paths = declare_light_paths(graph, settings.vpl, scene, lobes, albedo, settings.bounces, seed)
    if rsm is None and light_paths is None:
        return None
    candidates = declare_candidates(graph, settings.vpl, lobes, rsm, light_paths, scene, gbuffer)
    vpls = declare_vpls(graph, settings.vpl, candidates, seed)
    # Gather from them, with rays or imperfect shadow maps.
    ism = None
    if settings.gather.visibility == "ism":
        ism = declare_ism(graph, settings.ism, scene, declare_points(graph, scene, POINTS, albedo), vpls)
    near_field = declare_near_shares(graph, settings.ssdo, gbuffer, vpls)
    gathered = declare_gather(
        graph, settings.gather, scene, gbuffer, vpls, ism, seed, near_field, scene.gather_stride, scene.frames
    )
    views |= declare_vpl_view(graph, vpls) | declare_list_view(graph, gbuffer, gathered, vpls)
    if rsm is not None:
        views |= declare_rsm_views(graph, scene, lobes, rsm)
    if ism is not None:
        views |= declare_ism_views(graph, ism)
    # Add the light that the bound of near VPLs removes, reflections, and the near field in screen space.
    declare_compensation(graph, scene, gbuffer, albedo, vpls, gathered, settings.bounces, seed)
    declare_reflections(graph, settings.gather, scene, gbuffer, albedo, vpls, gathered, settings.bounces, seed)
    declare_photons(graph, settings.vpl, settings.gather, scene, gbuffer, candidates, gathered, seed)
    if near_field is not None:
        gathered = declare_near_field(
            graph, settings.ssdo, scene, gbuffer, ambient, direct, gathered, settings.bounces, seed
        )
    # Average over frames and neighbours.
    history = History(settings.temporal, base.motion) if settings.temporal.frames > 1 else None
    light, rejected = declare_denoise(graph, settings.denoise, scene, gbuffer, gathered, scene.frames, history)
    if rejected is not None:
        views |= declare_rejected_view(graph, rejected)
    return light
