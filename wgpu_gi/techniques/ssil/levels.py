"""Mip levels of the picture's surfaces: surfels, chosen by vote.

Soler et al. 2010, "A Deferred Shading Algorithm for Real-Time Indirect Illumination", section 4, eq. 5. Departures:
those of `wgsl/ssil/vote.wgsl`.
"""

from __future__ import annotations

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
    """`surfels`: one texture per level k from 0 on; a pixel represents a square of 2^k x 2^k pixels of the picture.

    `wgsl/ssil/surfel.wgsl` packs the texels. Levels from `first` on gather light. receivers: the surfels of `first`
    that receive light, on a grid that moves from frame to frame.
    """

    surfels: list[Texture]
    first: int
    receivers: Texture

    def received_by(self, level: int) -> Texture:
        """Return the surfels of `level` that receive light."""
        return self.receivers if level == self.first else self.surfels[level]

    @property
    def gathered(self) -> range:
        """The levels that gather."""
        return range(self.first, len(self.surfels))

    @property
    def size(self) -> tuple[int, int]:
        """The (width, height) of the first level that gathers."""
        return self.surfels[self.first].size

    def pixels_before(self, level: int) -> int:
        """Return the start of `level` in a buffer of all levels from `first` on: the number of pixels before it."""
        return sum(texture.size[0] * texture.size[1] for texture in self.surfels[self.first : level])


def level_size(size: tuple[int, int], level: int) -> tuple[int, int]:
    """Return (width, height) of a level of a picture of `size`, rounded up."""
    return -(-size[0] >> level), -(-size[1] >> level)


def declare_levels(graph: Graph, scene: SceneInputs, gbuffer: Gbuffer, first: int, count: int, seed: int) -> Levels:
    """Declare the surfels of levels 0 to first + count - 1."""
    surfels = [
        graph.texture(f"ssil/surfels_{k}", "rgba32uint", size=level_size(graph.size, k)) for k in range(first + count)
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
    for k in range(1, len(surfels)):
        _declare_vote(
            graph, surfels[k - 1], surfels[k], f"ssil/vote_{k}", {"seed": (seed ^ k * LEVEL_SEED) & 0xFFFFFFFF}
        )
        if k <= first:
            finer, receivers = receivers, graph.texture(f"ssil/receivers_{k}", "rgba32uint", size=surfels[k].size)
            _declare_vote(graph, finer, receivers, f"ssil/vote_receivers_{k}", {"receivers": 1, "coarser": first - k})
    return Levels(surfels, first, receivers)


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
