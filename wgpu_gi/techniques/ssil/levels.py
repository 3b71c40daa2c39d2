"""The levels of the picture that SSIL works on: surfels chosen by vote.

Soler et al. 2010, "A Deferred Shading Algorithm for Real-Time Indirect Illumination", section 4, eq. 5. Departures:
those of `wgsl/ssil/vote.wgsl`.
"""

from __future__ import annotations

from dataclasses import dataclass

from ...gpu.graph import Graph
from ...gpu.handles import Buffer, Texture
from ..shared.gbuffer import FOUR_FLOATS, Gbuffer
from ..shared.scene_inputs import SceneInputs


@dataclass
class Levels:
    """`surfels` of each level, the whole picture first; level k has a pixel for each square of 2^k pixels.

    Texels are as `wgsl/ssil/surfel.wgsl` packs them. Light is gathered at the levels from `first` on.
    """

    surfels: list[Texture]
    first: int

    @property
    def gathered(self) -> range:
        """The levels that light is gathered at."""
        return range(self.first, len(self.surfels))

    @property
    def size(self) -> tuple[int, int]:
        """Pixels of the first level that light is gathered at."""
        return self.surfels[self.first].size

    def pixels_before(self, level: int) -> int:
        """Return the pixels of the levels from the first on, up to `level`: where it begins in buffers of all."""
        return sum(texture.size[0] * texture.size[1] for texture in self.surfels[self.first : level])


def level_size(size: tuple[int, int], level: int) -> tuple[int, int]:
    """Return the pixels of a level: enough to cover all of the picture."""
    return -(-size[0] >> level), -(-size[1] >> level)


def declare_levels(graph: Graph, scene: SceneInputs, gbuffer: Gbuffer, first: int, count: int) -> Levels:
    """Declare the surfels of all levels up to the last of the `count` from `first` on."""
    surfels = [
        graph.texture(f"ssil/surfels_{k}", "rgba32uint", size=level_size(graph.size, k)) for k in range(first + count)
    ]
    shader = "ssil/first.wgsl"
    graph.compute(
        "ssil/first",
        shader,
        over=surfels[0],
        reads={"surfaces": gbuffer.surfaces, "distance": gbuffer.distance},
        writes={"surfels": surfels[0]},
        constants=scene.constants(shader),
    )
    for k in range(1, len(surfels)):
        graph.compute(
            f"ssil/vote_{k}",
            "ssil/vote.wgsl",
            over=surfels[k],
            reads={"finer": surfels[k - 1]},
            writes={"surfels": surfels[k]},
            params={"corner": 3 * (k % 2)},
        )
    return Levels(surfels, first)


def level_buffer(graph: Graph, name: str, size: tuple[int, int], history: bool = False) -> Buffer:
    """Declare four floats for each pixel of a level."""
    count = size[0] * size[1]
    return graph.buffer(name, dtype=FOUR_FLOATS, count=count, width=size[0], nonnegative=True, history=history)
