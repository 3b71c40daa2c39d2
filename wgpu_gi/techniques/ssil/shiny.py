"""The light that shiny surfaces send to others, by a ray per pixel.

A departure from Soler et al. 2010, whose senders are matte: a metal or a polished surface sends to the camera what it
does not send to others.
"""

from __future__ import annotations

import numpy as np

from ...gpu.formats import FOUR_FLOATS
from ...gpu.graph import Graph
from ...gpu.handles import Buffer
from ..deferred.inputs import DeferredInputs
from ..shared.bounds import NOTHING, scattered_more
from ..shared.denoise import declare_filter
from ..shared.gbuffer import Gbuffer

SHADER = "ssil/shiny.wgsl"
ADD = "ssil/shiny_add.wgsl"
BLOCK = 4  # side of the squares of pixels over which the light is averaged: that of `shiny.wgsl`


def declare_shines(graph: Graph, scene: DeferredInputs, rays: int) -> Buffer | None:
    """Return a value that becomes 1 if the picture shows a shiny surface; None without coats or rays."""
    if not scene.features["HAS_COATS"] or not rays:
        bound = NOTHING if rays else scattered_more(scene, 1)
        graph.skip("ssil/shiny", "every material is Lambert" if rays else "ssil.glossy_samples is 0", bound)
        return None
    return graph.buffer("ssil/shines", dtype=np.uint32, count=1)


def declare_shiny(
    graph: Graph,
    scene: DeferredInputs,
    gbuffer: Gbuffer,
    shines: Buffer,
    rays: int,
    seed: int,
    indirect: Buffer,
    levels: int,
) -> None:
    """Declare the light of shiny surfaces, added to the picture's `indirect` light, W/(m2 sr).

    rays: per pixel and frame. levels: of the a-trous filter.
    """
    width, height = graph.size
    light = graph.buffer("ssil/shiny", dtype=FOUR_FLOATS, count=width * height, width=width, nonnegative=True)
    normals = graph.buffer("ssil/shiny_normals", dtype=np.uint32, count=width * height, width=width)
    graph.compute(
        "ssil/shiny",
        SHADER,
        over=(width, height),
        reads={
            **scene.surfaces,
            **scene.lights,
            "surfaces": gbuffer.surfaces,
            "distance": gbuffer.distance,
            "shines": shines,
        },
        writes={"shiny": light, "normals": normals},
        params={"seed": seed},
        constants={**scene.constants(SHADER), "DIRECTIONS": rays},
    )
    filtered = declare_filter(graph, "ssil/shiny", gbuffer, light, normals, BLOCK, levels, frames=scene.frames).light
    graph.compute(
        "ssil/shiny_add",
        ADD,
        over=(width, height),
        reads={"surfaces": gbuffer.surfaces, "distance": gbuffer.distance, "shiny": filtered},
        writes={"full": indirect},
        constants=scene.constants(ADD),
    )
