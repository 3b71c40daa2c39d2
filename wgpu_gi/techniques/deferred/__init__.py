"""The deferred base (`--gi none`): direct light by shadow maps, and the environment's light unoccluded.

The techniques for indirect light start with the same stages: `declare_base`, then `declare_direct`.
"""

from __future__ import annotations

from ...gpu.graph import Graph
from ..shared.composite import NOISE_REACH
from ..shared.stage import BOUNCES, DIRECT
from ..shared.technique import Light, Reach, Technique
from .base import declare_base
from .direct import declare_direct
from .emitters import BLUR
from .inputs import DeferredInputs
from .transmission import with_transmission
from .update import DeferredOptions, deferred_inputs

TECHNIQUE = Technique(
    sentence="direct light only, deferred",
    bounces=0,
    most_bounces=0,
    is_random=False,
    occludes_sky=False,
    options=DeferredOptions,
    inputs=deferred_inputs,
    reach=lambda settings: Reach(BLUR + NOISE_REACH),
    stages=(DIRECT, BOUNCES),
)


def declare_direct_light(graph: Graph, settings: DeferredOptions, scene: DeferredInputs) -> Light:
    """Declare direct light, W/(m2 sr); the environment counts as unoccluded."""
    base = declare_base(graph, settings, scene)
    direct = declare_direct(graph, settings.direct, scene, base.gbuffer, base.shadow_maps, base.ambient, settings.seed)
    light = Light(
        base.gbuffer.emission, direct, views={"motion": base.motion}, distance=base.gbuffer.distance, tint=base.tint
    )
    return with_transmission(graph, scene, base.gbuffer, light, 0, settings.seed)
