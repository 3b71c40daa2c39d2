"""The directions that no picture decides, traced through the scene's hierarchy.

A departure from Ritschel et al. 2009, "Approximating Dynamic Global Illumination in Image Space", where light from
beyond the pictures, and from behind what they show, is unknown. The search lists such directions; a ray each finds the
environment, or the light that the surface it hits reflects.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...gpu.graph import Graph
from ...gpu.handles import Buffer, Resource
from ...gpu.wgsl.load import load
from ..shared.radiance_cache import declare_hits
from .offscreen import declare_cached_light
from .search_request import SearchRequest, SearchResult, moves

SHADER, CACHED = "ssdo/rays.wgsl", "ssdo/offscreen/rays.wgsl"
ESCAPED = "ssdo/escaped.wgsl"
UNDECIDED_WORD, SEARCHED_WORD = 3, 4  # of the list: numbers of undecided and of all directions
LIST_START = int(load("ssdo/undecided_list.wgsl").constants["LIST_START"])


def undecided_list(graph: Graph, name: str, directions: int) -> Buffer:
    """Return the list of undecided directions, at most `directions`, after the workgroups that cover it."""
    return graph.buffer(f"{name}_undecided", dtype=np.uint32, count=LIST_START + directions)


def declare_rays(
    request: SearchRequest,
    search: SearchResult,
    name: str,
    undecided: Buffer,
    hits: Buffer,
    share: Buffer | None,
    unoccluded: Buffer | None = None,
    *,
    unrepresented: bool = False,
) -> None:
    """Declare the rays of the directions in `undecided`, into `hits`, and the light of those that escape, into `share`.

    share: of the search's grid; of unrepresented pixels, of all pixels, and then `unoccluded` has their light without
    occlusion if the search samples the environment. None: there is no environment. unrepresented: the directions leave
    unrepresented pixels.
    """
    graph, scene, ambient = request.graph, request.scene, request.ambient
    reads: dict[str, Resource] = {"undecided": undecided, **_pixels(request, search, unrepresented)}
    constants: dict[str, float] = {
        "DIRECTIONS": request.directions,
        "LOBES": request.lobes,
        "STRIDE": search.stride,
        "MOVES": moves(search.stride, request.number),
        "UNREPRESENTED": unrepresented,
        "SAMPLE_ENVIRONMENT": request.samples_environment,
        "DIRECTIONAL": request.directional,
    }
    uniforms = {"view": request.sources.view_of(request.number)}
    cached = request.cache is not None and request.needs_light
    shader = CACHED if cached else SHADER
    found = declare_hits(graph, f"{name}_cache_hits", hits.count) if cached else None
    graph.compute(
        f"{name}_rays",
        shader,
        indirect=undecided,
        reads={
            **scene.surfaces,
            **({"environment_cdf": scene.lights["environment_cdf"]} if cached else scene.lights),
            **ambient.reads,
            **reads,
            "distance": request.sources.gbuffer(request.number).distance,
        },
        writes={"hits": hits, **({} if found is None else {"cache_hits": found})},
        params=None if cached else {"seed": request.seed},
        constants={
            **scene.constants(shader),
            **ambient.constants(shader),
            **constants,
            "NEEDS_LIGHT": request.needs_light,
        },
        uniforms=uniforms,
    )
    graph.count(f"{name}_rays", undecided, UNDECIDED_WORD, SEARCHED_WORD, "directions")
    if request.cache is not None and found is not None:
        declare_cached_light(request, request.cache, name, undecided, hits, found)
    if share is not None:
        whole = graph.neutral("buffer") if unoccluded is None else unoccluded
        reads |= {"hits": hits, "unoccluded": whole}
        _declare_escaped(request, name, undecided, share, reads, constants, uniforms)


def _declare_escaped(
    request: SearchRequest,
    name: str,
    undecided: Buffer,
    share: Buffer,
    reads: Mapping[str, Resource],
    constants: Mapping[str, float],
    uniforms: Mapping[str, str],
) -> None:
    """Declare the light of the directions that escape, added to `share`."""
    scene, ambient = request.scene, request.ambient
    request.graph.compute(
        f"{name}_escaped",
        ESCAPED,
        indirect=undecided,
        reads={**ambient.reads, "environment_cdf": scene.lights["environment_cdf"], **reads},
        writes={"occlusion": share},
        params={"lobe": request.lobe},
        constants={**scene.constants(ESCAPED), **ambient.constants(ESCAPED), **constants},
        uniforms=uniforms,
    )


def _pixels(request: SearchRequest, search: SearchResult, unrepresented: bool) -> Mapping[str, Resource]:
    """Return the bindings of the pixels that the directions leave."""
    reads: dict[str, Resource] = {"surfaces": request.sources.gbuffer(request.number).surfaces}
    if not unrepresented:
        neutral = request.graph.neutral("buffer")
        return {**reads, "unrepresented": neutral, "unrepresented_groups": neutral}
    assert search.guide is not None
    return {**reads, **search.guide.list_reads}
