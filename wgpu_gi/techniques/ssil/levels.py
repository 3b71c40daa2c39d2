"""Mip levels of the picture's surfaces: surfels, chosen by vote.

Soler et al. 2010, "A Deferred Shading Algorithm for Real-Time Indirect Illumination", section 4, eq. 5. Departures:
those of `wgsl/ssil/vote.wgsl`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from ...gpu.formats import FOUR_FLOATS
from ...gpu.graph import Graph
from ...gpu.handles import Buffer, Texture
from ..shared.gbuffer import Gbuffer
from ..shared.scene_inputs import SceneInputs

LEVEL_SEED = 0x9E3779B9  # an odd constant that sets the levels' random numbers apart


@dataclass
class Levels:
    """A pixel of level k represents a square of 2^k x 2^k pixels of the `picture`, given by its (width, height).

    `count` levels from `first` on gather light. surfels: one texture per level from 0 to `first`;
    `wgsl/ssil/surfel.wgsl` packs the texels. receivers: the surfels of `first` that receive light, on a grid that moves
    from frame to frame.
    """

    picture: tuple[int, int]
    surfels: list[Texture]
    first: int
    count: int
    receivers: Texture

    @property
    def gathered(self) -> range:
        """The levels that gather."""
        return range(self.first, self.first + self.count)

    @property
    def size(self) -> tuple[int, int]:
        """The (width, height) of the first level that gathers."""
        return self.size_of(self.first)

    def size_of(self, level: int) -> tuple[int, int]:
        """Return (width, height) of a level."""
        return level_size(self.picture, level)

    def pixels_before(self, level: int) -> int:
        """Return the start of `level` in a buffer of all levels from `first` on: the number of pixels before it."""
        return sum(math.prod(self.size_of(k)) for k in range(self.first, level))


def level_size(size: tuple[int, int], level: int) -> tuple[int, int]:
    """Return (width, height) of a level of a picture of `size`, rounded up."""
    return -(-size[0] >> level), -(-size[1] >> level)


def declare_levels(graph: Graph, scene: SceneInputs, gbuffer: Gbuffer, first: int, count: int, seed: int) -> Levels:
    """Declare the surfels of levels 0 to `first`; `count` levels from `first` on gather light."""
    surfels = [
        graph.texture(f"ssil/surfels_{k}", "rgba32uint", size=level_size(graph.size, k)) for k in range(first + 1)
    ]
    shader = "ssil/make_surfels.wgsl"
    graph.compute(
        "ssil/surfels",
        shader,
        over=surfels[0],
        reads={"surfaces": gbuffer.surfaces, "distance": gbuffer.distance},
        writes={"surfels": surfels[0]},
        constants=scene.constants(shader),
    )
    receivers = surfels[0]
    for k in range(1, first + 1):
        _declare_vote(
            graph, surfels[k - 1], surfels[k], f"ssil/vote_{k}", {"seed": (seed ^ k * LEVEL_SEED) & 0xFFFFFFFF}
        )
        finer, receivers = receivers, graph.texture(f"ssil/receivers_{k}", "rgba32uint", size=surfels[k].size)
        _declare_vote(graph, finer, receivers, f"ssil/vote_receivers_{k}", {"receivers": 1, "coarser": first - k})
    return Levels(graph.size, surfels, first, count, receivers)


def _declare_vote(graph: Graph, finer: Texture, surfels: Texture, name: str, params: Mapping[str, int]) -> None:
    graph.compute(
        name,
        "ssil/vote.wgsl",
        over=surfels,
        reads={"finer": finer},
        writes={"surfels": surfels},
        params={"seed": 0, "receivers": 0, "coarser": 0, **params},
    )


def level_buffer(graph: Graph, name: str, size: tuple[int, int], history: bool = False) -> Buffer:
    """Declare a buffer of four floats per pixel of a level of `size`."""
    count = size[0] * size[1]
    return graph.buffer(name, dtype=FOUR_FLOATS, count=count, width=size[0], nonnegative=True, history=history)
