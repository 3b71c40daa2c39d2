"""The near field of virtual point lights: light of surfaces close by, found in screen space.

Ritschel et al. 2009, "Approximating Dynamic Global Illumination in Image Space", section 5. What the near field finds
is left out of what virtual point lights give: of a light whose surface the picture shows, by how near it is, so that
both together are all light, and none of it twice.
"""

from __future__ import annotations

from dataclasses import replace

from ...gpu.graph import Graph
from ...gpu.handles import Buffer
from ..deferred.environment import Ambient
from ..deferred.inputs import DeferredInputs
from ..shared.denoise import declare_blur
from ..shared.gbuffer import FOUR_FLOATS, SURFACE, Gbuffer
from ..shared.upsample import declare_upsampling
from ..ssdo.bounce import declare_reflected, declare_unrepresented_reflected
from ..ssdo.search import INTERLEAVE, Asked, declare_search, declare_unrepresented
from ..ssdo.senders import declare_shown
from ..ssdo.sources import Sources, SsdoSettings
from .gather import Gathered, Near
from .vpl import TABLE_WIDTH, Vpls


def declare_near_shares(graph: Graph, settings: SsdoSettings, gbuffer: Gbuffer, vpls: Vpls) -> Near | None:
    """Declare how much of each VPL's light the near field finds, if it is near; None without a near field."""
    if not settings.near:
        graph.skip("ssdo/vpls", "ssdo.near is off")
        return None
    size = (TABLE_WIDTH, -(-vpls.count // TABLE_WIDTH))
    shares = graph.texture("ssdo/near_shares", "r32float", size=size, nonnegative=True)
    graph.compute(
        "ssdo/vpls",
        "many_light/near/shares.wgsl",
        over=vpls.count,
        reads={"vpl_table": vpls.table, "surfaces": gbuffer.surfaces, "distance": gbuffer.distance},
        writes={"near_shares": shares},
        params={"count": vpls.count},
    )
    return Near(shares, settings.near_reach)


def declare_near(
    graph: Graph,
    settings: SsdoSettings,
    scene: DeferredInputs,
    gbuffer: Gbuffer,
    ambient: Ambient,
    direct: Buffer,
    gathered: Gathered,
    bounces: int | None,
    seed: int,
) -> Gathered:
    """Declare the irradiance with that of the near field; `direct` is the light scattered once, (r, g, b, -)."""
    width, height = graph.size
    sources = Sources([gbuffer], [])
    # Of the environment nothing is asked here.
    dark = Ambient(ambient.reads, dict.fromkeys(ambient.features, False))
    asked = Asked(graph, settings, scene, sources, dark, seed, reach=settings.near_reach)
    search = declare_search(asked)
    declare_unrepresented(asked, search, None)
    senders = graph.buffer("ssdo/senders", dtype=SURFACE, count=width * height)
    declare_shown(graph, scene, gbuffer, direct, senders, gathered.irradiance if bounces != 1 else None)
    near = declare_reflected(graph, settings, scene, sources, search, senders)
    if search.guide is not None:
        radius = INTERLEAVE if settings.blur else 1
        near = declare_blur(graph, "ssdo/near", gbuffer, near, search.normals, radius, stride=search.stride)
        near = declare_upsampling(graph, scene, "ssdo/near", gbuffer, near, search.guide, reflected=False)
        declare_unrepresented_reflected(graph, settings, scene, sources, search, senders, near, reflected=False)
    irradiance = graph.buffer("ssdo/both", dtype=FOUR_FLOATS, count=width * height, width=width, nonnegative=True)
    graph.compute(
        "ssdo/add",
        "ssdo/add.wgsl",
        over=(width, height),
        reads={"gathered": gathered.irradiance, "near": near},
        writes={"irradiance": irradiance},
    )
    return replace(gathered, irradiance=irradiance)
