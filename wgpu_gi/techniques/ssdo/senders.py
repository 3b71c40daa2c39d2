"""The radiance that every source reflects: the first layer is already lit, other sources are lit here.

Ritschel et al. 2009, "Approximating Dynamic Global Illumination in Image Space", sections 3 and 4. Departure: other
sources are lit at every SENDER_STRIDE-th pixel of every SENDER_STRIDE-th row; each represents its neighbours, too.
"""

from __future__ import annotations

from ...gpu.graph import Graph
from ...gpu.handles import Buffer
from ..deferred.environment import Ambient
from ..deferred.inputs import DeferredInputs
from ..deferred.shadow import ShadowMaps
from ..shared.denoise import declare_blur
from ..shared.gbuffer import SURFACE, Gbuffer
from .search import SENDER_STRIDE, SKY_STRIDE, declare_search, grid_size
from .search_request import INTERLEAVE, SearchRequest
from .settings import SsdoSettings
from .sources import Sources

SENDER_RAYS = 2  # to emitters; the gathering averages over senders


def declare_senders(
    graph: Graph,
    settings: SsdoSettings,
    scene: DeferredInputs,
    sources: Sources,
    direct: Buffer,
    maps: ShadowMaps | None,
    ambient: Ambient,
    seed: int,
) -> Buffer:
    """Declare the radiance of light scattered once and the normal of all senders, source by source."""
    width, height = graph.size
    grid = grid_size(graph, SENDER_STRIDE)
    per_source = grid[0] * grid[1]
    senders = graph.buffer("ssdo/senders", dtype=SURFACE, count=width * height + per_source * (sources.count - 1))
    declare_first_layer_senders(graph, scene, sources.layers[0], direct, senders)
    for number in range(1, sources.count):
        first = width * height + per_source * (number - 1)
        sky: Buffer | None = None
        if ambient.features["HAS_ENVIRONMENT"]:
            sky = _declare_sky(graph, settings, scene, sources, ambient, seed, number)
        _declare_lit_senders(graph, scene, sources, number, maps, ambient, sky, senders, first)
        if scene.emitters.leaves:
            _declare_emitters(graph, scene, sources, number, senders, first, seed)
    return senders


def declare_first_layer_senders(
    graph: Graph,
    scene: DeferredInputs,
    gbuffer: Gbuffer,
    direct: Buffer,
    senders: Buffer,
    indirect: Buffer | None = None,
) -> None:
    """Declare the senders of the first layer, at the start of `senders`.

    Their radiance is `direct`, W/(m2 sr), plus their reflection of the irradiance `indirect`, W/m2.
    """
    shader = "ssdo/first_layer_senders.wgsl"
    graph.compute(
        "ssdo/senders",
        shader,
        over=graph.size,
        reads={
            "surfaces": gbuffer.surfaces,
            "direct": direct,
            "indirect": indirect if indirect is not None else graph.neutral("buffer"),
        },
        writes={"senders": senders},
        constants={**scene.constants(shader), "HAS_INDIRECT": indirect is not None},
    )


def _declare_lit_senders(
    graph: Graph,
    scene: DeferredInputs,
    sources: Sources,
    number: int,
    maps: ShadowMaps | None,
    ambient: Ambient,
    sky: Buffer | None,
    senders: Buffer,
    first: int,
) -> None:
    """Declare the senders of another source, from index `first` on; `sky`: the result of `_declare_sky`."""
    gbuffer, shader = sources.gbuffer(number), "ssdo/senders.wgsl"
    graph.compute(
        f"ssdo/senders_{number}",
        shader,
        over=grid_size(graph, SENDER_STRIDE),
        reads={
            **ambient.reads,
            "surfaces": gbuffer.surfaces,
            "distance": gbuffer.distance,
            "coarse": sky if sky is not None else graph.neutral("buffer"),
            "light_table": scene.direct.lights,
            "shadow_atlas": maps.depth if maps else graph.neutral("texture_depth_2d"),
            "shadow_sampler": graph.sampler("linear", "clamp", "greater-equal"),
        },
        writes={"senders": senders},
        params={"first": first},
        constants={
            **scene.constants(shader),
            **ambient.constants(shader),
            "OUTWARD": sources.is_outward(number),
            "STRIDE": SENDER_STRIDE,
            "COARSE_STRIDE": SKY_STRIDE,
        },
        uniforms={"view": sources.view_of(number)},
    )


def _declare_emitters(
    graph: Graph, scene: DeferredInputs, sources: Sources, number: int, senders: Buffer, first: int, seed: int
) -> None:
    """Declare the light of emitters, added to the senders of another source, from index `first` on."""
    gbuffer, shader = sources.gbuffer(number), "ssdo/emitter_senders.wgsl"
    graph.compute(
        f"ssdo/emitters_{number}",
        shader,
        over=grid_size(graph, SENDER_STRIDE),
        reads={
            **scene.surfaces,
            "emitters": scene.emitters.table,
            "surfaces": gbuffer.surfaces,
            "distance": gbuffer.distance,
        },
        writes={"senders": senders},
        params={"first": first, "seed": seed},
        constants={
            **scene.constants(shader),
            "OUTWARD": sources.is_outward(number),
            "STRIDE": SENDER_STRIDE,
            "RAYS": SENDER_RAYS,
        },
        uniforms={"view": sources.view_of(number)},
    )


def _declare_sky(
    graph: Graph,
    settings: SsdoSettings,
    scene: DeferredInputs,
    sources: Sources,
    ambient: Ambient,
    seed: int,
    number: int,
) -> Buffer:
    """Declare the share of the environment's light that reaches another source, at every SKY_STRIDE-th pixel."""
    rays = settings.undecided == "rays"
    search = declare_search(SearchRequest(graph, settings, scene, sources, ambient, seed, number, rays=rays))
    return declare_blur(
        graph,
        f"ssdo/share_{number}",
        sources.gbuffer(number),
        search.light,
        search.normals,
        INTERLEAVE if settings.blur else 1,
        stride=search.stride,
        view=sources.view_of(number),
    )
