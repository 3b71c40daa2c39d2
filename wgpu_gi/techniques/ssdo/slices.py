"""The search by slices of the hemisphere, and the bounce from the surfaces that it finds (`ssdo.sampling=slices`).

Therrien, Levesque and Gilet 2023, "Screen Space Indirect Lighting with Visibility Bitmask". A slice shows as a line of
the picture; each pixel on it covers an arc of the slice's sectors. One slice thus stands for many directions, and only
its azimuth is random. Departures: those of `wgsl/ssdo/slice_march.wgsl`; rays trace off-screen sectors.
With an environment the march runs twice, since what surfaces reflect depends on their share of it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...gpu.formats import FOUR_FLOATS, TWO_WORDS
from ...gpu.handles import Buffer
from .rays import declare_rays, undecided_list
from .search import SENDER_STRIDE, declare_search_guide, grid_dispatch, grid_reads, grid_size, stride_of
from .search_request import INTERLEAVE, SearchRequest, SearchResult, moves

SHADER = "ssdo/slices.wgsl"
RAYS_SHADER = "ssdo/slices_rays.wgsl"


def declare_slices(request: SearchRequest) -> SearchResult:
    """Declare the share of the environment that reaches the first layer; without an environment, its buffers only."""
    graph, name = request.graph, request.name
    stride = stride_of(request.settings)
    width, height = grid_size(graph, stride)
    count = width * height
    result = SearchResult(
        stride,
        graph.buffer(name, dtype=FOUR_FLOATS, count=count, width=width, nonnegative=True),
        graph.buffer(f"{name}_normals", dtype=np.uint32, count=count, width=width),
        graph.buffer(f"{name}_hits", dtype=TWO_WORDS, count=count * request.directions if request.rays else 1),
        None,
        by_rays=request.rays,
        request=request,
    )
    if stride > 1:
        guide = result.guide = declare_search_guide(request, stride)
        room = guide.room * request.directions if request.rays else 1
        result.unrepresented_hits = graph.buffer(f"{request.prefix}unrepresented_hits", dtype=TWO_WORDS, count=room)
    if request.ambient.features["HAS_ENVIRONMENT"]:
        _declare_march(request, result, name, result.light, result.normals, None)
    return result


def declare_unrepresented_slices(request: SearchRequest, result: SearchResult, share: Buffer | None) -> None:
    """Declare the environment's share of unrepresented pixels, in `share`; None: there is no environment."""
    if share is not None:
        _declare_listed_march(request, result, f"{request.prefix}unrepresented", share, None)


def declare_slices_bounce(result: SearchResult, senders: Buffer) -> Buffer:
    """Declare the irradiance of the search grid from the surfaces that slices see, W/m2, before any blur."""
    request = result.request
    assert request is not None
    graph = request.graph
    width, height = grid_size(graph, result.stride)
    irradiance = graph.buffer("ssdo/irradiance", dtype=FOUR_FLOATS, count=width * height, width=width, nonnegative=True)
    normals = result.normals
    if _has_share(request):
        normals = graph.buffer("ssdo/irradiance_normals", dtype=np.uint32, count=1)
    _declare_march(request, result, "ssdo/bounce", irradiance, normals, senders)
    if request.rays:
        graph.compute(
            "ssdo/bounce_ray_light",
            RAYS_SHADER,
            over=(width, height),
            **_ray_light_arguments(request, result, senders),
            writes={"result": irradiance},
        )
    return irradiance


def declare_unrepresented_slices_bounce(
    result: SearchResult, senders: Buffer, light: Buffer, *, reflected: bool
) -> None:
    """Declare the irradiance (`reflected`: radiance) of unrepresented pixels, written into `light` of all pixels."""
    request = result.request
    assert request is not None
    if result.guide is None:
        return
    name = "ssdo/unrepresented_bounce"
    _declare_listed_march(request, result, name, light, senders, reflected=reflected)
    if request.rays:
        arguments = _ray_light_arguments(request, result, senders)
        arguments["reads"] |= {**result.guide.list_reads, "hits": result.unrepresented_hits}
        arguments["constants"] |= {"REFLECTED": reflected}
        request.graph.compute(
            f"{name}_ray_light",
            RAYS_SHADER,
            indirect=result.guide.groups,
            entry="listed",
            **arguments,
            writes={"result": light},
        )


def _has_share(request: SearchRequest) -> bool:
    """Return whether there is an environment, whose share lists the undecided directions; else the bounce does."""
    return request.ambient.features["HAS_ENVIRONMENT"]


def _declare_march(
    request: SearchRequest, result: SearchResult, name: str, light: Buffer, normals: Buffer, senders: Buffer | None
) -> None:
    """Declare the march from the search grid, and the rays of undecided directions if it lists them."""
    graph, sources = request.graph, request.sources
    lists = request.rays and (senders is None or not _has_share(request))
    undecided = undecided_list(graph, name, result.hits.count if lists else 1)
    hits = result.hits if lists else graph.buffer(f"{name}_no_hits", dtype=TWO_WORDS, count=1)
    arguments = _arguments(request, result, senders, lists=lists)
    arguments["reads"] |= grid_reads(sources, 0, result.stride)
    graph.compute(
        name,
        **grid_dispatch(graph, sources, 0, result.stride),
        **arguments,
        writes={"result": light, "normals": normals, "hits": hits, "undecided": undecided},
        clear=[light, undecided],
    )
    if lists:
        declare_rays(request, result, name, undecided, hits, light if senders is None else None)


def _declare_listed_march(
    request: SearchRequest,
    result: SearchResult,
    name: str,
    light: Buffer,
    senders: Buffer | None,
    *,
    reflected: bool = False,
) -> None:
    """Declare the march from unrepresented pixels, into `light` of all pixels, and the rays if it lists directions."""
    guide, graph = result.guide, request.graph
    if guide is None or result.unrepresented_hits is None:
        return
    lists = request.rays and (senders is None or not _has_share(request))
    hits = result.unrepresented_hits if lists else graph.buffer(f"{name}_no_hits", dtype=TWO_WORDS, count=1)
    undecided = undecided_list(graph, name, hits.count if lists else 1)
    arguments = _arguments(request, result, senders, lists=lists)
    arguments["constants"] |= {"UNREPRESENTED": True, "REFLECTED": reflected}
    gbuffer = request.sources.gbuffer(0)
    arguments["reads"] |= {"surfaces": gbuffer.surfaces, "distance": gbuffer.distance, **guide.list_reads}
    graph.compute(
        name,
        indirect=guide.groups,
        entry="listed",
        **arguments,
        writes={
            "result": light,
            "normals": graph.buffer(f"{name}_normals", dtype=np.uint32, count=1),
            "hits": hits,
            "undecided": undecided,
        },
        clear=[undecided],
    )
    if lists:
        share = light if senders is None else None
        declare_rays(request, result, name, undecided, hits, share, unrepresented=True)


def _arguments(request: SearchRequest, result: SearchResult, senders: Buffer | None, *, lists: bool) -> dict[str, Any]:
    """Return the arguments of passes of SHADER; `reads` lacks the G-buffer. senders: None: for the share."""
    settings, sources, graph = request.settings, request.sources, request.graph
    taps = -(-3 * settings.steps // 4)  # tools/README.md, "Constants"
    depths = {name: depth for name, depth in sources.reads(graph).items() if name in {f"depth_{k}" for k in range(5)}}
    return {
        "shader": SHADER,
        "reads": {
            "environment_cdf": request.scene.lights["environment_cdf"],
            **request.ambient.reads,
            **depths,
            "senders": graph.neutral("buffer") if senders is None else senders,
        },
        "params": {
            "seed": request.seed,
            "radius": settings.radius if request.radius is None else request.radius,
            "lobe": request.lobe,
        },
        "constants": {
            **request.scene.constants(SHADER),
            **request.ambient.constants(SHADER),
            **sources.constants,
            "SLICES": request.slices,
            "TAPS": taps,
            "WIDE_TAPS": -(-taps // 2) if sources.widens else 0,
            "INTERLEAVE": INTERLEAVE,
            "STRIDE": result.stride,
            "MOVES": moves(result.stride),
            "DIRECTIONAL": request.directional,
            "KNOWN": request.rays,
            "RAYS": request.rays_per_slice,
            "LISTS": lists,
            "GATHER": senders is not None,
            "SENDER_STRIDE": SENDER_STRIDE,
        },
        "uniforms": {"view_1": sources.uniforms()["view_1"]},
    }


def _ray_light_arguments(request: SearchRequest, result: SearchResult, senders: Buffer) -> dict[str, Any]:
    """Return the arguments of passes of RAYS_SHADER."""
    neutral = request.graph.neutral("buffer")
    return {
        "reads": {
            "surfaces": request.sources.gbuffer(0).surfaces,
            "hits": result.hits,
            "senders": senders,
            "unrepresented": neutral,
            "unrepresented_groups": neutral,
        },
        "constants": {
            **request.scene.constants(RAYS_SHADER),
            **request.sources.constants,
            "ENTRIES": request.directions,
            "STRIDE": result.stride,
            "MOVES": moves(result.stride),
            "SENDER_STRIDE": SENDER_STRIDE,
            "BY_RAYS": True,
        },
    }
