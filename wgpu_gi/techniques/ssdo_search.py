"""What directions from each pixel meet in screen space, and what of the environment's light gets past it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..gpu.graph import Graph
from ..gpu.handles import Buffer
from ..gpu.wgsl import load
from .environment import Ambient
from .gbuffer import FOUR_FLOATS
from .scene_inputs import SceneInputs
from .ssdo_sources import Sources, SsdoSettings

# Sources other than the picture are lit at one pixel in so many in each row and column; chosen.
SENDER_STRIDE = 2
# and with one in so many points along each direction: errors on a courtyard are not larger for it.
FEWER = 2
INTERLEAVE = 4  # side of the squares of pixels that share directions; chosen
LAST_MAP = int(load("environment/maps.wgsl").constants["LAST_MAP"])

TWO_WORDS = np.dtype((np.uint32, 2))


@dataclass
class Search:
    """What directions meet from the pixels of a grid, one in `stride` in each row and column.

    light: the share of the environment that arrives, (r, g, b, depth of `wgsl/denoise/plane.wgsl`). normals: packed as
    there. hits: what each direction meets and the way there, as `wgsl/ssdo/hit.wgsl` packs them, of the picture itself
    only. sent: what `light` is over, once both are averaged; None if it is a share already.
    """

    stride: int
    light: Buffer
    normals: Buffer
    hits: Buffer
    sent: Buffer | None


def stride_of(settings: SsdoSettings) -> int:
    """Return how far apart the pixels of the picture are that are searched for."""
    return 2 if settings.half else 1


def grid_of(graph: Graph, stride: int) -> tuple[int, int]:
    """Return how many of them there are in a row and in a column."""
    return -(-graph.size[0] // stride), -(-graph.size[1] // stride)


def over_grid(graph: Graph, sources: Sources, number: int, stride: int) -> dict[str, Any]:
    """Return which threads a pass over the grid of a source has."""
    if stride == 1:
        return {"indirect": sources.gbuffer(number).tile_groups}
    return {"over": grid_of(graph, stride), "entry": "coarse"}


def grid_reads(sources: Sources, number: int, stride: int) -> dict[str, Any]:
    """Return what such a pass reads of the G-buffer."""
    gbuffer = sources.gbuffer(number)
    tiles = gbuffer.tiles if stride == 1 else {}
    return {**tiles, "surfaces": gbuffer.surfaces, "distance": gbuffer.distance}


def declare_search(
    graph: Graph,
    settings: SsdoSettings,
    scene: SceneInputs,
    sources: Sources,
    ambient: Ambient,
    seed: int,
    *,
    number: int = 0,
    reach: float | None = None,
) -> Search:
    """Declare what hides the environment from a source, and for the picture itself, number 0, which surfaces do.

    `reach` is instead of that of the settings.
    """
    is_picture = number == 0
    stride = stride_of(settings) if is_picture else SENDER_STRIDE
    directions = settings.directions if is_picture else 1
    by_picture = is_picture and _draws_by_picture(settings, ambient)
    name = f"ssdo/occlusion_{number}" if number else "ssdo/occlusion"
    found = _allocate(graph, name, stride, directions if is_picture else 0, by_picture)
    sent = found.sent or graph.buffer(f"{name}_unsent", dtype=FOUR_FLOATS, count=1)
    shader = "ssdo/occlusion.wgsl"
    graph.compute(
        name,
        shader,
        **over_grid(graph, sources, number, stride),
        reads={
            **grid_reads(sources, number, stride),
            "environment_cdf": scene.lights["environment_cdf"],
            **ambient.reads,
            **sources.reads(graph),
        },
        writes={"occlusion": found.light, "normals": found.normals, "hits": found.hits, "sent": sent},
        params={"seed": seed, "pictures": settings.reach if reach is None else reach},
        constants={
            **scene.constants(shader),
            **ambient.constants(shader),
            **sources.constants,
            "STEPS": settings.steps if is_picture else -(-settings.steps // FEWER),
            "DIRECTIONS": directions,
            "STRIDE": stride,
            "INTERLEAVE": INTERLEAVE,
            "DIRECTIONAL": settings.occlusion == "directional",
            "OUTWARD": sources.is_outward(number),
            "BY_PICTURE": by_picture,
            "HITS": is_picture,
            "LOBE": _lobe_of(directions),
        },
        uniforms={**sources.uniforms(), "view": sources.view_of(number)},
        clear=[found.light, sent],
    )
    return found


def _allocate(graph: Graph, name: str, stride: int, directions: int, by_picture: bool) -> Search:
    """Return the buffers of a search, with so many hits per pixel."""
    width, height = grid_of(graph, stride)
    count = width * height
    sent: Buffer | None = None
    if by_picture:
        sent = graph.buffer(f"{name}_sent", dtype=FOUR_FLOATS, count=count, width=width, nonnegative=True)
    return Search(
        stride,
        graph.buffer(name, dtype=FOUR_FLOATS, count=count, width=width, nonnegative=True),
        graph.buffer(f"{name}_normals", dtype=np.uint32, count=count, width=width),
        graph.buffer(f"{name}_hits", dtype=TWO_WORDS, count=max(count * directions, 1)),
        sent,
    )


def _draws_by_picture(settings: SsdoSettings, ambient: Ambient) -> bool:
    asked = (settings.sampling, settings.occlusion) == ("picture", "directional")
    return asked and ambient.features["HAS_ENVIRONMENT"] and ambient.features["HAS_PICTURED_ENVIRONMENT"]


def _lobe_of(directions: int) -> int:
    """Return the environment's map whose lobe has about the solid angle of one of a square's directions.

    That angle is 4 pi alpha^2, with alpha = 2^-k for map k.
    """
    return min(round(0.5 * math.log2(2 * directions * INTERLEAVE**2)), LAST_MAP)
