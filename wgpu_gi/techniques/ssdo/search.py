"""What directions from each pixel meet in screen space, and what of the environment's light gets past it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...gpu.graph import Graph
from ...gpu.handles import Buffer
from ...gpu.wgsl.load import load
from ..deferred.environment import Ambient
from ..shared.gbuffer import FOUR_FLOATS
from ..shared.scene_inputs import SceneInputs
from ..shared.upsample import Guide, declare_guide
from .sources import Sources, SsdoSettings

# Sources other than the picture are lit at one pixel in so many in each row and column; chosen.
SENDER_STRIDE = 2
# the sky that they see is looked for at one in so many,
SKY_STRIDE = 8
# and with one in so many points along each direction: errors on a courtyard are not larger for it.
FEWER = 2
INTERLEAVE = 4  # side of the squares of pixels that share directions; chosen
LAST_MAP = int(load("deferred/environment/maps.wgsl").constants["LAST_MAP"])

TWO_WORDS = np.dtype((np.uint32, 2))


@dataclass
class Search:
    """What directions meet from the pixels of a grid, one in `stride` in each row and column.

    light: the share of the environment that arrives, (r, g, b, depth of `shared/denoise/plane.wgsl`). normals: packed
    as there. hits: what each direction meets and the way there, packed by `ssdo/hit.wgsl`, of the picture itself only.
    sent: what `light` is over, once both are averaged; None if it is a share already. guide: how the grid's pixels
    count for others. unrepresented_hits: what the directions of pixels meet that the grid does not represent.
    """

    stride: int
    light: Buffer
    normals: Buffer
    hits: Buffer
    sent: Buffer | None
    guide: Guide | None = None
    unrepresented_hits: Buffer | None = None


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


@dataclass
class Asked:
    """What is asked of a search: of which source, `seed`, and a `reach` instead of that of the settings."""

    graph: Graph
    settings: SsdoSettings
    scene: SceneInputs
    sources: Sources
    ambient: Ambient
    seed: int
    number: int = 0
    reach: float | None = None
    directional: bool = True

    @property
    def directions(self) -> int:
        """How many for each pixel."""
        return self.settings.directions if self.number == 0 else 1

    @property
    def by_picture(self) -> bool:
        """Tell whether directions are drawn by the environment's picture, too."""
        pictured = self.ambient.features["HAS_ENVIRONMENT"] and self.ambient.features["HAS_PICTURED_ENVIRONMENT"]
        return self.number == 0 and pictured and self.directional and self.settings.sampling == "picture"

    def arguments(self, stride: int) -> dict[str, Any]:
        """Return what all passes of `wgsl/ssdo/occlusion.wgsl` have in common; reads are without the G-buffer."""
        settings, sources, number, shader = self.settings, self.sources, self.number, "ssdo/occlusion.wgsl"
        return {
            "shader": shader,
            "reads": {
                "environment_cdf": self.scene.lights["environment_cdf"],
                **self.ambient.reads,
                **sources.reads(self.graph),
            },
            "params": {"seed": self.seed, "pictures": settings.reach if self.reach is None else self.reach},
            "constants": {
                **self.scene.constants(shader),
                **self.ambient.constants(shader),
                **sources.constants,
                "STEPS": settings.steps if number == 0 else -(-settings.steps // FEWER),
                "DIRECTIONS": self.directions,
                "STRIDE": stride,
                "INTERLEAVE": INTERLEAVE,
                "DIRECTIONAL": self.directional,
                "OUTWARD": sources.is_outward(number),
                "BY_PICTURE": self.by_picture,
                "HITS": number == 0,
                "LOBE": _lobe_of(self.directions),
            },
            "uniforms": {**sources.uniforms(), "view": sources.view_of(number)},
        }


def declare_search(asked: Asked) -> Search:
    """Declare what hides the environment from a source, and for the picture itself, number 0, which surfaces do."""
    graph, sources, number = asked.graph, asked.sources, asked.number
    stride = SKY_STRIDE if number else stride_of(asked.settings)
    name = f"ssdo/occlusion_{number}" if number else "ssdo/occlusion"
    found = _allocate(asked, name, stride)
    sent = found.sent or graph.buffer(f"{name}_unsent", dtype=FOUR_FLOATS, count=1)
    arguments = asked.arguments(stride)
    arguments["reads"] |= grid_reads(sources, number, stride)
    graph.compute(
        name,
        **over_grid(graph, sources, number, stride),
        **arguments,
        writes={"occlusion": found.light, "normals": found.normals, "hits": found.hits, "sent": sent},
        clear=[found.light, sent],
    )
    if number == 0 and stride > 1:
        guide = _declare_guide(asked, stride)
        room = guide.room * asked.directions
        found.guide = guide
        found.unrepresented_hits = graph.buffer("ssdo/unrepresented_hits", dtype=TWO_WORDS, count=room)
    return found


def _declare_guide(asked: Asked, stride: int) -> Guide:
    gbuffer, constants = asked.sources.gbuffer(0), asked.scene.constants("ssdo/guide.wgsl")
    reads = {"surfaces": gbuffer.surfaces, "distance": gbuffer.distance}
    return declare_guide(asked.graph, "ssdo", reads, stride=stride, centred=False, constants=constants)


def declare_unrepresented(asked: Asked, search: Search, share: Buffer | None) -> None:
    """Declare what directions meet from unrepresented pixels; the `share` of the environment gets theirs, if given."""
    guide, graph = search.guide, asked.graph
    if guide is None or search.unrepresented_hits is None:
        return
    nothing = {
        name: graph.buffer(f"ssdo/unrepresented_{name}", dtype=dtype, count=1)
        for name, dtype in (("occlusion", FOUR_FLOATS), ("normals", np.uint32), ("sent", FOUR_FLOATS))
    }
    arguments = asked.arguments(search.stride)
    arguments["constants"] |= {"UNREPRESENTED": True, "SHARE": share is not None}
    gbuffer = asked.sources.gbuffer(0)
    arguments["reads"] |= {"surfaces": gbuffer.surfaces, "distance": gbuffer.distance, **guide.list_reads}
    graph.compute(
        "ssdo/unrepresented",
        indirect=guide.groups,
        entry="listed",
        **arguments,
        writes={**nothing, "hits": search.unrepresented_hits} | ({"occlusion": share} if share is not None else {}),
    )


def _allocate(asked: Asked, name: str, stride: int) -> Search:
    """Return the buffers of a search."""
    graph = asked.graph
    width, height = grid_of(graph, stride)
    count = width * height
    sent: Buffer | None = None
    if asked.by_picture:
        sent = graph.buffer(f"{name}_sent", dtype=FOUR_FLOATS, count=count, width=width, nonnegative=True)
    hits = 1 if asked.number else count * asked.directions
    return Search(
        stride,
        graph.buffer(name, dtype=FOUR_FLOATS, count=count, width=width, nonnegative=True),
        graph.buffer(f"{name}_normals", dtype=np.uint32, count=count, width=width),
        graph.buffer(f"{name}_hits", dtype=TWO_WORDS, count=hits),
        sent,
    )


def _lobe_of(directions: int) -> int:
    """Return the environment's map whose lobe has about the solid angle of one of a square's directions.

    That angle is 4 pi alpha^2, with alpha = 2^-k for map k.
    """
    return min(round(0.5 * math.log2(2 * directions * INTERLEAVE**2)), LAST_MAP)
