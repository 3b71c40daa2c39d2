"""The search for occluders: marches directions through the depth buffers of all sources.

Ritschel et al. 2009, "Approximating Dynamic Global Illumination in Image Space", section 3. Departures: each direction
has several points instead of one, and the first hidden point counts; directions are drawn by the cosine; squares of
pixels share a set of directions (interleaved sampling, Keller and Heidrich 2001), which the blur averages; coated
pixels also search along directions drawn from their coat.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...gpu.formats import FOUR_FLOATS, TWO_WORDS
from ...gpu.graph import Graph
from ...gpu.handles import Buffer
from ...gpu.wgsl.load import load
from ..deferred.environment import Ambient
from ..deferred.inputs import DeferredInputs
from ..shared.upsample import Guide, declare_guide
from .settings import SsdoSettings
from .sources import Sources

SHADER = "ssdo/search.wgsl"
# Strides of sources other than the first layer, pixels: of senders, and of their sky occlusion. The latter takes every
# second step along each direction. tools/README.md, "Constants".
SENDER_STRIDE = 2
SKY_STRIDE = 8
SKY_STEP_SHARE = 2
INTERLEAVE = 4  # side of the squares of pixels that share a set of directions. tools/README.md, "Constants"
LAST_MAP = int(load("deferred/environment/maps.wgsl").constants["LAST_MAP"])


@dataclass
class SearchResult:
    """Hits of the directions from a grid of pixels, every `stride`-th of every `stride`-th row.

    light: unoccluded share of the environment, (r, g, b, depth of `shared/denoise/plane.wgsl`). normals: packed by that
    file. hits: the surfaces found from the first layer, packed by `ssdo/hit_code.wgsl`. unoccluded: the environment's
    light without occlusion; after the blur of both the share is light / unoccluded. None: `light` is already the share.
    guide: for upsampling the grid. unrepresented_hits: hits of the directions from unrepresented pixels. directions,
    lobes: numbers of directions per pixel, drawn by the cosine and, after them, from the coat.
    """

    stride: int
    light: Buffer
    normals: Buffer
    hits: Buffer
    unoccluded: Buffer | None
    guide: Guide | None = None
    unrepresented_hits: Buffer | None = None
    directions: int = 0
    lobes: int = 0


@dataclass
class SearchRequest:
    """A search from the pixels of source `number`.

    radius: largest r_max, in heights of the picture at the pixel; None: from the settings. directional: True: the share
    depends on the environment's colour by direction; False: ambient occlusion. coats: coated pixels also draw as many
    directions from their coat. base: False: only these.
    """

    graph: Graph
    settings: SsdoSettings
    scene: DeferredInputs
    sources: Sources
    ambient: Ambient
    seed: int
    number: int = 0
    radius: float | None = None
    directional: bool = True
    coats: bool = False
    base: bool = True

    @property
    def lobes(self) -> int:
        """Directions per pixel that are drawn from its coat."""
        return self.settings.directions if self.coats and self.number == 0 and self.scene.features["HAS_COATS"] else 0

    @property
    def directions(self) -> int:
        """Directions per pixel."""
        if not self.base:
            return 0
        return self.settings.directions if self.number == 0 else 1

    @property
    def samples_environment(self) -> bool:
        """Whether every other direction is drawn by importance sampling of the environment."""
        pictured = self.ambient.features["HAS_ENVIRONMENT"] and self.ambient.features["HAS_PICTURED_ENVIRONMENT"]
        return self.number == 0 and pictured and self.directional and self.settings.sampling == "environment"

    def arguments(self, stride: int) -> dict[str, Any]:
        """Return the arguments common to all passes of SHADER; `reads` lacks the G-buffer."""
        settings, sources, number = self.settings, self.sources, self.number
        return {
            "shader": SHADER,
            "reads": {
                "environment_cdf": self.scene.lights["environment_cdf"],
                **self.ambient.reads,
                **sources.reads(self.graph),
            },
            "params": {
                "seed": self.seed,
                "lobe": _lobe_of(max(self.directions, 1)),
                "radius": settings.radius if self.radius is None else self.radius,
            },
            "constants": {
                **self.scene.constants(SHADER),
                **self.ambient.constants(SHADER),
                **sources.constants,
                "STEPS": settings.steps if number == 0 else -(-settings.steps // SKY_STEP_SHARE),
                "DIRECTIONS": self.directions,
                "LOBES": self.lobes,
                "STRIDE": stride,
                "INTERLEAVE": INTERLEAVE,
                "DIRECTIONAL": self.directional,
                "OUTWARD": sources.is_outward(number),
                "SAMPLE_ENVIRONMENT": self.samples_environment,
                "HITS": number == 0,
            },
            "uniforms": {**sources.uniforms(), "view": sources.view_of(number)},
        }


def declare_search(request: SearchRequest) -> SearchResult:
    """Declare the share of the environment that reaches a source; for the first layer, also the surfaces found."""
    graph, sources, number = request.graph, request.sources, request.number
    stride = SKY_STRIDE if number else stride_of(request.settings)
    name = f"ssdo/occlusion_{number}" if number else "ssdo/occlusion"
    result = _allocate(request, name, stride)
    unoccluded = result.unoccluded or graph.buffer(f"{name}_no_unoccluded", dtype=FOUR_FLOATS, count=1)
    arguments = request.arguments(stride)
    arguments["reads"] |= grid_reads(sources, number, stride)
    graph.compute(
        name,
        **grid_dispatch(graph, sources, number, stride),
        **arguments,
        writes={
            "occlusion": result.light,
            "normals": result.normals,
            "hits": result.hits,
            "unoccluded": unoccluded,
        },
        clear=[result.light, unoccluded],
    )
    if number == 0 and stride > 1:
        guide = _declare_guide(request, stride)
        count = guide.room * (request.directions + request.lobes)
        result.guide = guide
        result.unrepresented_hits = graph.buffer("ssdo/unrepresented_hits", dtype=TWO_WORDS, count=count)
    return result


def declare_unrepresented(request: SearchRequest, result: SearchResult, share: Buffer | None) -> None:
    """Declare the hits of directions from unrepresented pixels, and their environment share in `share`, if given."""
    guide, graph = result.guide, request.graph
    if guide is None or result.unrepresented_hits is None:
        return
    unused = {
        name: graph.buffer(f"ssdo/unrepresented_{name}", dtype=dtype, count=1)
        for name, dtype in (("occlusion", FOUR_FLOATS), ("normals", np.uint32), ("unoccluded", FOUR_FLOATS))
    }
    arguments = request.arguments(result.stride)
    arguments["constants"] |= {"UNREPRESENTED": True, "STORE_SHARE": share is not None}
    gbuffer = request.sources.gbuffer(0)
    arguments["reads"] |= {"surfaces": gbuffer.surfaces, "distance": gbuffer.distance, **guide.list_reads}
    graph.compute(
        "ssdo/unrepresented",
        indirect=guide.groups,
        entry="listed",
        **arguments,
        writes={**unused, "hits": result.unrepresented_hits} | ({"occlusion": share} if share is not None else {}),
    )


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


def _declare_guide(request: SearchRequest, stride: int) -> Guide:
    gbuffer, constants = request.sources.gbuffer(0), request.scene.constants("ssdo/guide.wgsl")
    reads = {"surfaces": gbuffer.surfaces, "distance": gbuffer.distance}
    return declare_guide(request.graph, "ssdo", reads, stride=stride, centred=False, constants=constants)


def _allocate(request: SearchRequest, name: str, stride: int) -> SearchResult:
    """Return the buffers of a search."""
    graph = request.graph
    width, height = grid_size(graph, stride)
    count = width * height
    unoccluded: Buffer | None = None
    if request.samples_environment:
        unoccluded = graph.buffer(f"{name}_unoccluded", dtype=FOUR_FLOATS, count=count, width=width, nonnegative=True)
    hits = 1 if request.number else count * (request.directions + request.lobes)
    return SearchResult(
        stride,
        graph.buffer(name, dtype=FOUR_FLOATS, count=count, width=width, nonnegative=True),
        graph.buffer(f"{name}_normals", dtype=np.uint32, count=count, width=width),
        graph.buffer(f"{name}_hits", dtype=TWO_WORDS, count=hits),
        unoccluded,
        directions=request.directions,
        lobes=request.lobes,
    )


def _lobe_of(directions: int) -> int:
    """Return the prefiltered map of the environment whose lobe has the solid angle of one of a square's directions.

    That angle is 4 pi alpha^2, with alpha = 2^-k for map k.
    """
    return min(round(0.5 * math.log2(2 * directions * INTERLEAVE**2)), LAST_MAP)
