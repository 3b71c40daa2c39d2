"""SSDO (`--gi ssdo`): the environment's light past what the picture shows near by, and one bounce, in screen space.

Ritschel et al. 2009, "Approximating Dynamic Global Illumination in Image Space".
"""

from __future__ import annotations

from ...gpu.graph import Graph
from ..deferred.base import declare_base
from ..deferred.direct import declare_direct
from ..shared.technique import Light, Technique
from .bounce import declare_bounce
from .inputs import SsdoInputs
from .occlusion import History, declare_occlusion
from .sources import declare_sources
from .update import SsdoOptions, ssdo_inputs

TECHNIQUE = Technique(
    sentence="directional occlusion and one bounce in screen space",
    bounces=1,
    most_bounces=1,
    is_random=True,
    options=SsdoOptions,
    inputs=ssdo_inputs,
)


def declare_ssdo(graph: Graph, settings: SsdoOptions, scene: SsdoInputs) -> Light:
    """Declare direct light with the environment occluded by direction, and one bounce, W/(m2 sr)."""
    s, seed = settings.ssdo, settings.seed
    # What the camera sees: layers behind one another, and pictures of further cameras.
    sources = declare_sources(graph, scene)
    base = declare_base(graph, settings, scene, gbuffer=sources.layers[0], lobes=True)
    history = History(settings.temporal, base.motion)
    # Occluders along each direction: they hide the environment.
    occlusion = declare_occlusion(graph, s, scene, sources, base.ambient, history, seed, scene.frames)
    atlas, layers = base.shadow_atlas, sources.layers
    direct = declare_direct(graph, settings.direct, scene, base.gbuffer, atlas, base.ambient, occlusion.share, layers)
    light = Light(base.gbuffer.emission, direct, views={"motion": base.motion})
    # The same occluders reflect light.
    if settings.bounces != 0 and s.bounce:
        light.indirect = declare_bounce(graph, s, scene, sources, occlusion, direct, atlas, base.ambient, history, seed)
    return light
