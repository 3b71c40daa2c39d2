"""SSDO (`--gi ssdo`): directional occlusion of the environment and one bounce of light, found in screen space.

Ritschel et al. 2009, "Approximating Dynamic Global Illumination in Image Space". Departures: see `search.py`
(occluders), `occlusion.py` (shadows), `bounce.py` and `senders.py` (one bounce), `cameras.py` (further cameras).
"""

from __future__ import annotations

from dataclasses import replace

from ...gpu.graph import Graph
from ..deferred.base import declare_base
from ..deferred.direct import declare_direct
from ..deferred.transmission import with_transmission
from ..shared.stage import BOUNCES, DIRECT, DIRECT_FACTORS, Stage
from ..shared.technique import Light, Technique
from .bounce import declare_bounce
from .inputs import SsdoInputs
from .occlusion import History, declare_occlusion
from .sources import declare_sources
from .update import SsdoOptions, ssdo_inputs

# Directions that leave so small a radius are undecided, so rays decide all of them.
ALL_BY_RAYS = ("ssdo.radius=0.01", "ssdo.undecided=rays")
STAGES = (
    replace(DIRECT, factors=DIRECT_FACTORS | {"ssdo.directions": 4.0}),
    BOUNCES,
    Stage("visibility", exact=ALL_BY_RAYS, factors={"ssdo.steps": 2.0, "ssdo.layers": 2.0}, values=ALL_BY_RAYS),
    Stage("sampling of directions", "mean", factors={"ssdo.directions": 4.0}),
    Stage(
        "reconstruction",
        exact=("ssdo.blur=false", "denoise.levels=0"),
        values=("denoise.levels=1", "denoise.levels=0", "ssdo.blur=false"),
    ),
    Stage("resolution", exact=("ssdo.half_resolution=false",), values=("ssdo.half_resolution=false",)),
)

TECHNIQUE = Technique(
    sentence="directional occlusion and one bounce in screen space",
    bounces=1,
    most_bounces=1,
    is_random=True,
    screen_space=True,
    options=SsdoOptions,
    inputs=ssdo_inputs,
    stages=STAGES,
    found=lambda settings: int(settings.ssdo.bounce),
)


def declare_ssdo(graph: Graph, settings: SsdoOptions, scene: SsdoInputs) -> Light:
    """Declare direct light with the environment occluded by direction, and one bounce, W/(m2 sr)."""
    s, seed = settings.ssdo, settings.seed
    # Declare the depth layers of the main camera, and further cameras.
    sources = declare_sources(graph, scene)
    base = declare_base(graph, settings, scene, gbuffer=sources.layers[0], lobes=True)
    history = History(settings.temporal, base.motion)
    # Find the first occluder along each direction, which hides the environment.
    bounces = settings.bounces != 0 and s.bounce
    occlusion = declare_occlusion(
        graph,
        s,
        scene,
        sources,
        base.ambient,
        history,
        seed,
        scene.frames,
        reflects=bounces,
        one_bounce=settings.bounces == 1,
    )
    maps, layers = base.shadow_maps, sources.layers
    direct = declare_direct(
        graph, settings.direct, scene, base.gbuffer, maps, base.ambient, seed, occlusion.sky, layers
    )
    light = Light(
        base.gbuffer.emission, direct, views={"motion": base.motion}, distance=base.gbuffer.distance, tint=base.tint
    )
    # Gather one bounce from the same occluders.
    if bounces:
        light.indirect = declare_bounce(
            graph, s, settings.denoise, scene, sources, occlusion, direct, maps, base.ambient, history, seed
        )
    return with_transmission(graph, scene, base.gbuffer, light, settings.bounces, seed)
