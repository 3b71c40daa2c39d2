"""SSIL (`--gi ssil`): light from all visible surfaces, gathered at several scales, with visibility by rays or voxels.

Soler et al. 2010, "A Deferred Shading Algorithm for Real-Time Indirect Illumination".
"""

from __future__ import annotations

from dataclasses import replace

from ...gpu.graph import Graph
from ..deferred.base import declare_base
from ..deferred.direct import declare_direct
from ..deferred.sky import declare_sky
from ..deferred.transmission import with_transmission
from ..shared.stage import BOUNCES, DIRECT, Stage
from ..shared.technique import Light, Technique
from .inputs import SsilInputs
from .ssil import MOST_BOUNCES, declare_bounces, is_amortised
from .update import SsilOptions, ssil_inputs


def _warm_up(settings: SsilOptions) -> int:
    """Return the number of warm-up frames: amortised bounces need one frame each."""
    return MOST_BOUNCES if is_amortised(settings.ssil, settings.bounces) else 0


def _found(settings: SsilOptions) -> int | None:
    """Return the number of bounces that the settings gather, None for all."""
    if settings.bounces is not None:
        return min(settings.bounces, MOST_BOUNCES)
    return None if is_amortised(settings.ssil, None) else settings.ssil.bounces


STAGES = (
    DIRECT,
    replace(BOUNCES, factors={"ssil.bounces": 2.0}),
    Stage("surfaces out of view", "visible", unless=("ssil.offscreen=cache",), values=("ssil.offscreen=cache",)),
    Stage(
        "visibility",
        exact=("ssil.visibility=exact", "ssil.visibility_bounces=all"),
        values=("ssil.visibility=exact", "ssil.visibility_bounces=all"),
    ),
    Stage("sampling of directions", "mean", factors={"ssil.samples": 4.0}),
    Stage("reconstruction", exact=("denoise.levels=0",), values=("denoise.levels=1", "denoise.levels=0")),
    Stage("resolution", exact=("ssil.start=full", "ssil.levels=5"), values=("ssil.start=full",)),
)

TECHNIQUE = Technique(
    sentence="light from visible surfaces, at several scales, with visibility by rays or voxels",
    bounces=None,
    most_bounces=MOST_BOUNCES,
    is_random=True,
    screen_space=True,
    options=SsilOptions,
    inputs=ssil_inputs,
    stages=STAGES,
    found=_found,
    warm_up=_warm_up,
)


def declare_ssil(graph: Graph, settings: SsilOptions, scene: SsilInputs) -> Light:
    """Declare direct light, and indirect light from visible surfaces, W/(m2 sr)."""
    seed = settings.seed
    base = declare_base(graph, settings, scene)
    gbuffer = base.gbuffer
    sky = declare_sky(graph, settings.environment, scene, gbuffer, base.ambient, seed, scene.frames)
    direct = declare_direct(graph, settings.direct, scene, gbuffer, base.shadow_maps, base.ambient, seed, sky)
    light = Light(gbuffer.emission, direct, views={"motion": base.motion}, distance=gbuffer.distance, tint=base.tint)
    if settings.bounces != 0:
        light.indirect = declare_bounces(
            graph,
            settings.ssil,
            settings.voxels,
            settings.temporal,
            settings.denoise,
            scene,
            gbuffer,
            base.motion,
            direct,
            settings.bounces,
            seed,
        )
    return with_transmission(graph, scene, gbuffer, light, settings.bounces, seed)
