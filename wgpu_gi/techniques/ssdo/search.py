"""The search for occluders: marches directions through the depth buffers of all sources.

Ritschel et al. 2009, "Approximating Dynamic Global Illumination in Image Space", section 3. Departures: each direction
has several points instead of one, and the first hidden point counts; directions are drawn by the cosine; squares of
pixels share a set of directions (interleaved sampling, Keller and Heidrich 2001), which the blur averages; coated
pixels also search along directions drawn from their coat; rays trace directions that leave the screen (`rays.py`);
at half resolution other pixels start the search in each frame (`wgsl/shared/upsample/grid_pixel.wgsl`).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...gpu.formats import FOUR_FLOATS, TWO_WORDS
from ...gpu.graph import Graph
from ...gpu.handles import Buffer
from ..shared.upsample import Guide, declare_guide
from .rays import declare_rays, undecided_list
from .search_request import SearchRequest, SearchResult
from .settings import SsdoSettings
from .sources import Sources

# Strides of sources other than the first layer, pixels: of senders, and of their sky occlusion. tools/README.md,
# "Constants".
SENDER_STRIDE = 2
SKY_STRIDE = 8


def declare_search(request: SearchRequest, guide: Guide | None = None) -> SearchResult:
    """Declare the share of the environment that reaches a source; for the first layer, also the surfaces found.

    guide: for upsampling the first layer; None: declared here, if needed.
    """
    graph, sources, number = request.graph, request.sources, request.number
    stride = SKY_STRIDE if number else stride_of(request.settings)
    name = request.name
    result = _allocate(request, name, stride)
    unoccluded = result.unoccluded or graph.buffer(f"{name}_no_unoccluded", dtype=FOUR_FLOATS, count=1)
    arguments = request.arguments(stride)
    arguments["reads"] |= grid_reads(sources, number, stride)
    undecided = undecided_list(graph, name, result.hits.count if request.rays else 1)
    graph.compute(
        name,
        **grid_dispatch(graph, sources, number, stride),
        **arguments,
        writes={
            "occlusion": result.light,
            "normals": result.normals,
            "hits": result.hits,
            "unoccluded": unoccluded,
            "undecided": undecided,
        },
        clear=[result.light, unoccluded, undecided],
    )
    if request.rays:
        lit = request.ambient.features["HAS_ENVIRONMENT"]
        declare_rays(request, result, name, undecided, result.hits, result.light if lit else None)
    if number == 0 and stride > 1:
        result.guide = guide or declare_search_guide(request, stride)
        count = result.guide.room * (request.directions + request.lobes)
        result.unrepresented_hits = graph.buffer(f"{request.prefix}unrepresented_hits", dtype=TWO_WORDS, count=count)
    return result


def declare_unrepresented(request: SearchRequest, result: SearchResult, share: Buffer | None) -> None:
    """Declare the hits of directions from unrepresented pixels, and their environment share in `share`, if given."""
    guide, graph = result.guide, request.graph
    if guide is None or result.unrepresented_hits is None:
        return
    name, hits = f"{request.prefix}unrepresented", result.unrepresented_hits
    unused = {
        key: graph.buffer(f"{name}_{key}", dtype=dtype, count=1)
        for key, dtype in (("occlusion", FOUR_FLOATS), ("normals", np.uint32))
    }
    sampled = request.rays and request.samples_environment
    unoccluded = graph.buffer(f"{name}_unoccluded", dtype=FOUR_FLOATS, count=guide.room if sampled else 1)
    undecided = undecided_list(graph, name, hits.count if request.rays else 1)
    arguments = request.arguments(result.stride)
    arguments["constants"] |= {"UNREPRESENTED": True, "STORE_SHARE": share is not None}
    gbuffer = request.sources.gbuffer(0)
    arguments["reads"] |= {"surfaces": gbuffer.surfaces, "distance": gbuffer.distance, **guide.list_reads}
    graph.compute(
        name,
        indirect=guide.groups,
        entry="listed",
        **arguments,
        writes={**unused, "hits": hits, "unoccluded": unoccluded, "undecided": undecided}
        | ({"occlusion": share} if share is not None else {}),
        clear=[undecided],
    )
    if request.rays:
        declare_rays(request, result, name, undecided, hits, share, unoccluded, unrepresented=True)


def stride_of(settings: SsdoSettings) -> int:
    """Return the spacing of the first layer's pixels that start a search, pixels."""
    return 2 if settings.half_resolution else 1


def grid_size(graph: Graph, stride: int) -> tuple[int, int]:
    """Return the width and height of the grid of every `stride`-th pixel."""
    return -(-graph.size[0] // stride), -(-graph.size[1] // stride)


def grid_dispatch(graph: Graph, sources: Sources, number: int, stride: int) -> dict[str, Any]:
    """Return the dispatch of a pass over the grid of a source, and its entry point."""
    if stride == 1:
        return {"indirect": sources.gbuffer(number).tile_groups}
    return {"over": grid_size(graph, stride), "entry": "coarse"}


def grid_reads(sources: Sources, number: int, stride: int) -> dict[str, Any]:
    """Return the G-buffer bindings of a pass over the grid of a source."""
    gbuffer = sources.gbuffer(number)
    tiles = gbuffer.tiles if stride == 1 else {}
    return {**tiles, "surfaces": gbuffer.surfaces, "distance": gbuffer.distance}


def declare_search_guide(request: SearchRequest, stride: int) -> Guide:
    """Declare the guide for upsampling the grid of the first layer."""
    gbuffer, constants = request.sources.gbuffer(0), request.scene.constants("ssdo/guide.wgsl")
    reads = {"surfaces": gbuffer.surfaces, "distance": gbuffer.distance}
    return declare_guide(request.graph, "ssdo", reads, stride=stride, centred=True, constants=constants)


def _allocate(request: SearchRequest, name: str, stride: int) -> SearchResult:
    """Return the buffers of a search."""
    graph = request.graph
    width, height = grid_size(graph, stride)
    count = width * height
    unoccluded: Buffer | None = None
    if request.samples_environment:
        unoccluded = graph.buffer(f"{name}_unoccluded", dtype=FOUR_FLOATS, count=count, width=width, nonnegative=True)
    hits = 1 if request.number and not request.rays else count * (request.directions + request.lobes)
    return SearchResult(
        stride,
        graph.buffer(name, dtype=FOUR_FLOATS, count=count, width=width, nonnegative=True),
        graph.buffer(f"{name}_normals", dtype=np.uint32, count=count, width=width),
        graph.buffer(f"{name}_hits", dtype=TWO_WORDS, count=hits),
        unoccluded,
        directions=request.directions,
        lobes=request.lobes,
        by_rays=request.rays,
    )
