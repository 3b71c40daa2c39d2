"""The near field: light of close surfaces, found in screen space and left out of the light of virtual point lights.

Ritschel et al. 2009, "Approximating Dynamic Global Illumination in Image Space", section 5. Departure: both parts add
up to all of the light. A weight by distance and by visibility in the picture divides each VPL's light between them.
"""

from __future__ import annotations

from dataclasses import replace

from ...gpu.formats import FOUR_FLOATS
from ...gpu.graph import Graph
from ...gpu.handles import Buffer
from ..deferred.environment import Ambient
from ..deferred.inputs import DeferredInputs
from ..shared.bounds import ELSEWHERE
from ..shared.denoise import declare_blur
from ..shared.gbuffer import SURFACE, Gbuffer
from ..shared.upsample import declare_upsampling
from ..ssdo.bounce import declare_gathered, declare_gathered_unrepresented
from ..ssdo.search import declare_search, declare_unrepresented
from ..ssdo.search_request import INTERLEAVE, SearchRequest
from ..ssdo.senders import declare_first_layer_senders
from ..ssdo.settings import SsdoSettings
from ..ssdo.sources import Sources
from .gather import Gathered, NearField
from .vpl import TABLE_WIDTH, Vpls


def declare_near_shares(graph: Graph, settings: SsdoSettings, gbuffer: Gbuffer, vpls: Vpls) -> NearField | None:
    """Declare the share of each VPL's light that the near field finds at distance 0; None without a near field."""
    if not settings.near_field:
        graph.skip("near_field/shares", "ssdo.near_field is off", ELSEWHERE)
        return None
    size = (TABLE_WIDTH, -(-vpls.count // TABLE_WIDTH))
    shares = graph.texture("near_field/shares", "r32float", size=size, nonnegative=True)
    shader = "many_light/near_field/shares.wgsl"
    graph.compute(
        "near_field/shares",
        shader,
        over=vpls.count,
        reads={"vpl_table": vpls.table, "surfaces": gbuffer.surfaces, "distance": gbuffer.distance},
        writes={"near_shares": shares},
        params={"count": vpls.count},
        constants={**gbuffer.constants(shader), **vpls.constants},
    )
    return NearField(shares, settings.near_field_radius)


def declare_near_field(
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
    """Declare the irradiance with the near field's added; `direct`: light scattered once, (r, g, b, -), W/(m2 sr)."""
    # Search for senders.
    width, height = graph.size
    sources = Sources([gbuffer], [])
    # The search finds senders only, so leave out the environment.
    dark = Ambient(ambient.reads, dict.fromkeys(ambient.features, False))
    request = SearchRequest(graph, settings, scene, sources, dark, seed, radius=settings.near_field_radius)
    search = declare_search(request)
    declare_unrepresented(request, search, None)
    # Gather from them: at all pixels, or at a coarse grid and upsample.
    senders = graph.buffer("ssdo/senders", dtype=SURFACE, count=width * height)
    indirect = gathered.irradiance if bounces != 1 else None
    declare_first_layer_senders(graph, scene, gbuffer, direct, senders, indirect)
    near = declare_gathered(graph, settings, scene, sources, search, senders)
    if search.guide is not None:
        radius = INTERLEAVE if settings.blur else 1
        near = declare_blur(graph, "ssdo/near", gbuffer, near, search.normals, radius, stride=search.stride)
        near = declare_upsampling(graph, scene, "ssdo/near", gbuffer, near, search.guide, reflected=False)
        declare_gathered_unrepresented(graph, settings, scene, sources, search, senders, near, reflected=False)
    # Add the light of VPLs.
    irradiance = graph.buffer(
        "near_field/irradiance", dtype=FOUR_FLOATS, count=width * height, width=width, nonnegative=True
    )
    graph.compute(
        "near_field/add",
        "many_light/near_field/add.wgsl",
        over=(width, height),
        reads={"gathered": gathered.irradiance, "near": near},
        writes={"irradiance": irradiance},
    )
    return replace(gathered, irradiance=irradiance)
