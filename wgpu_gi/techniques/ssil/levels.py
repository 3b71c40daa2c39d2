"""The levels of the picture that SSIL works on: surfels chosen by vote, and what light they send.

Soler et al. 2010, "A Deferred Shading Algorithm for Real-Time Indirect Illumination", section 4, eq. 5.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...gpu.graph import Graph
from ...gpu.handles import Buffer, Texture, View
from ...gpu.wgsl.load import load
from ..shared.gbuffer import FOUR_FLOATS, Gbuffer
from ..shared.scene_inputs import SceneInputs

LIGHT = np.dtype((np.uint32, 2))  # codes of wgsl/common/light_code.wgsl
REFLECT_ROW = int(load("ssil/reflect.wgsl").constants["ROW"])


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


def declare_sent(
    graph: Graph, scene: SceneInputs, gbuffer: Gbuffer, levels: Levels, direct: Buffer | None
) -> tuple[Buffer, Buffer]:
    """Declare what the first level that is gathered at sends out, and the brightest of it.

    Without `direct`, it is what it would send out of an irradiance of 1.
    """
    name = "reflectors" if direct is None else "light"
    width, height = levels.surfels[levels.first].size
    light = graph.buffer(f"ssil/{name}", dtype=LIGHT, count=width * height)
    peak = graph.buffer(f"ssil/{name}_peak", dtype=np.uint32, count=2)
    shader = "ssil/light.wgsl"
    graph.compute(
        f"ssil/{name}",
        shader,
        over=(width, height),
        reads={
            "surfaces": gbuffer.surfaces,
            "distance": gbuffer.distance,
            "direct": direct or graph.neutral("buffer"),
        },
        writes={"light": light, "peak": peak},
        constants={**scene.constants(shader), "SQUARE": 1 << levels.first, "REFLECTORS": direct is None},
        clear=[peak],
    )
    return light, peak


def declare_reflected(
    graph: Graph,
    reflectors: Buffer,
    irradiance: Buffer,
    first_peak: Buffer,
    least_light: float,
    suffix: str,
    before: Buffer | None = None,
) -> tuple[Buffer, Buffer]:
    """Declare what the first level sends on of an irradiance, and the brightest of it; together with `before`.

    It counts as none where it is at most the share `least_light` of the brightest of the first bounce.
    """
    light = graph.buffer(f"ssil/light{suffix}", dtype=LIGHT, count=reflectors.count)
    peak = graph.buffer(f"ssil/light_peak{suffix}", dtype=np.uint32, count=2)
    graph.compute(
        f"ssil/reflect{suffix}",
        "ssil/reflect.wgsl",
        over=(REFLECT_ROW, -(-light.count // REFLECT_ROW)),
        reads={
            "reflectors": reflectors,
            "irradiance": irradiance,
            "before": graph.neutral("buffer") if before is None else before,
            "first_peak": first_peak,
        },
        writes={"light": light, "peak": peak},
        constants={"ADDED": before is not None},
        params={"least_light": least_light},
        clear=[peak],
    )
    return light, peak


def declare_again(
    graph: Graph, gbuffer: Gbuffer, levels: Levels, sent: Buffer, reflectors: Buffer, motion: Buffer, before: View
) -> tuple[Buffer, Buffer]:
    """Declare what the first level sends together with what it got in the frame before, and the brightest radiance."""
    light = graph.buffer("ssil/light_again", dtype=LIGHT, count=reflectors.count)
    peak = graph.buffer("ssil/light_peak_again", dtype=np.uint32, count=2, history=True)
    graph.compute(
        "ssil/again",
        "ssil/again.wgsl",
        over=levels.surfels[levels.first],
        reads={
            "surfels": levels.surfels[levels.first],
            "distance": gbuffer.distance,
            "reflectors": reflectors,
            "sent": sent,
            "motion": motion,
            "before": before,
            "peak_before": peak.previous,
        },
        writes={"light": light, "peak": peak},
        constants={"SQUARE": 1 << levels.first},
        clear=[peak],
    )
    return light, peak


def declare_light_levels(graph: Graph, levels: Levels, light: Buffer, suffix: str) -> list[Buffer]:
    """Declare the light of the coarser levels; return that of all that are gathered at, the finest first."""
    found = [light]
    for k in levels.gathered[1:]:
        width, height = levels.surfels[k].size
        coarser = graph.buffer(f"ssil/light_{k}{suffix}", dtype=LIGHT, count=width * height)
        graph.compute(
            f"ssil/sum_{k}{suffix}",
            "ssil/sum.wgsl",
            over=(width, height),
            reads={"finer": found[-1]},
            writes={"light": coarser},
            params={"finer_size": levels.surfels[k - 1].size, "size": (width, height)},
        )
        found.append(coarser)
    return found


def level_buffer(graph: Graph, name: str, size: tuple[int, int], history: bool = False) -> Buffer:
    """Declare four floats for each pixel of a level."""
    count = size[0] * size[1]
    return graph.buffer(name, dtype=FOUR_FLOATS, count=count, width=size[0], nonnegative=True, history=history)
