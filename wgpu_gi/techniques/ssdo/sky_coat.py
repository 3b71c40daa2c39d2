"""The environment's light that coats reflect: along the directions of the search that leave the scene.

A departure from Ritschel et al. 2009, "Approximating Dynamic Global Illumination in Image Space", whose surfaces are
matte. Only with rays is it known which directions leave the scene.
"""

from __future__ import annotations

from ...gpu.formats import FOUR_FLOATS
from ...gpu.graph import Graph
from ...gpu.handles import Buffer
from ..deferred.environment import Ambient
from ..deferred.inputs import DeferredInputs
from .search import grid_dispatch, grid_reads, grid_size
from .search_request import INTERLEAVE, SearchResult, moves
from .sources import Sources

SHADER = "ssdo/sky_coat.wgsl"


def declare_sky_coat(
    graph: Graph, scene: DeferredInputs, sources: Sources, ambient: Ambient, search: SearchResult
) -> tuple[Buffer, Buffer | None]:
    """Declare the light of the search's grid, over the coats' tint, (r, g, b, depth), W/(m2 sr).

    Under a constant environment, the second buffer has the light without occlusion, by which it is to be divided.
    """
    width, height = grid_size(graph, search.stride)
    coat = graph.buffer("ssdo/sky_coat", dtype=FOUR_FLOATS, count=width * height, width=width, nonnegative=True)
    pictured = ambient.features["HAS_PICTURED_ENVIRONMENT"]
    count = 1 if pictured else width * height
    whole = graph.buffer("ssdo/sky_coat_unoccluded", dtype=FOUR_FLOATS, count=count, width=width, nonnegative=True)
    graph.compute(
        "ssdo/sky_coat",
        SHADER,
        **grid_dispatch(graph, sources, 0, search.stride),
        reads={**ambient.reads, **grid_reads(sources, 0, search.stride), "hits": search.hits},
        writes={"coat": coat, "unoccluded": whole},
        constants=_constants(scene, ambient, search),
        clear=[coat, whole],
    )
    return coat, None if pictured else whole


def declare_unrepresented_sky_coat(
    graph: Graph, scene: DeferredInputs, sources: Sources, ambient: Ambient, search: SearchResult, coat: Buffer
) -> None:
    """Declare the light of unrepresented pixels, of a constant environment the ratio, in `coat` of all pixels."""
    if search.guide is None or search.unrepresented_hits is None:
        return
    gbuffer = sources.gbuffer(0)
    graph.compute(
        "ssdo/unrepresented_sky_coat",
        SHADER,
        indirect=search.guide.groups,
        entry="listed",
        reads={
            **ambient.reads,
            **search.guide.list_reads,
            "surfaces": gbuffer.surfaces,
            "distance": gbuffer.distance,
            "hits": search.unrepresented_hits,
        },
        writes={"coat": coat, "unoccluded": graph.buffer("ssdo/unrepresented_sky_coat", dtype=FOUR_FLOATS, count=1)},
        constants=_constants(scene, ambient, search),
    )


def _constants(scene: DeferredInputs, ambient: Ambient, search: SearchResult) -> dict[str, float]:
    return {
        **scene.constants(SHADER),
        **ambient.constants(SHADER),
        "DIRECTIONS": search.directions,
        "LOBES": search.lobes,
        "STRIDE": search.stride,
        "MOVES": moves(search.stride),
        "INTERLEAVE": INTERLEAVE,
    }
