"""The surfels that send the light of each level: chosen by light.

A departure from Soler et al. 2010, "A Deferred Shading Algorithm for Real-Time Indirect Illumination", whose levels
keep the surface with the most votes (eq. 5), whether or not it is the one that sends the light. Pixels that gather are
still chosen by vote (`levels.py`).
"""

from __future__ import annotations

from ...gpu.graph import Graph
from ...gpu.handles import Buffer, Texture
from ..shared.gbuffer import Gbuffer
from ..shared.scene_inputs import SceneInputs
from .levels import LEVEL_SEED, Levels

FIRST = "ssil/first_senders.wgsl"
SENDER_SEED = 0x632BE5AB  # sets the senders' random numbers apart from those of the vote


def declare_first_senders(
    graph: Graph, scene: SceneInputs, gbuffer: Gbuffer, levels: Levels, direct: Buffer, seed: int, *, split: bool
) -> Texture:
    """Declare the senders of `direct` light at the first level. split: shiny surfaces send none."""
    if levels.first == 0:
        return levels.surfels[0]
    senders = graph.texture("ssil/first_senders", "rgba32uint", size=levels.size)
    graph.compute(
        "ssil/first_senders",
        FIRST,
        over=senders,
        reads={"pixels": levels.surfels[0], "direct": direct, "surfaces": gbuffer.surfaces},
        writes={"senders": senders},
        params={"seed": seed ^ SENDER_SEED},
        constants={**scene.constants(FIRST), "SQUARE": 1 << levels.first, "SPLIT": split},
    )
    return senders


def declare_coarser_senders(
    graph: Graph, levels: Levels, first: Texture, light: Buffer, last: int, seed: int, suffix: str
) -> dict[int, Texture]:
    """Declare the senders of `light` (codes of all levels) up to level `last`; return them and those of the `first`."""
    senders = {levels.first: first}
    for k in range(levels.first + 1, last + 1):
        senders[k] = graph.texture(f"ssil/senders_{k}{suffix}", "rgba32uint", size=levels.size_of(k))
        graph.compute(
            f"ssil/senders_{k}{suffix}",
            "ssil/senders.wgsl",
            over=senders[k],
            reads={"finer": senders[k - 1], "light": light},
            writes={"senders": senders[k]},
            params={
                "seed": (seed ^ SENDER_SEED ^ k * LEVEL_SEED) & 0xFFFFFFFF,
                "offset": levels.pixels_before(k - 1),
            },
        )
    return senders
