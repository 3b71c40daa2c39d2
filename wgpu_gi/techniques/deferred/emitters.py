"""Direct light of emitters: few shadow rays per pixel and frame, to points drawn by the light that they may send.

Conty and Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree Splitting". Departure: samples of the BRDF
find near emitters and reflections (multiple importance sampling, Veach 1997). Each frame of a still picture draws other
points, so their mean converges to the truth. A blur removes the noise of single frames; of a still picture it blurs the
first frame only.
"""

from __future__ import annotations

import numpy as np

from ...gpu.formats import FOUR_FLOATS
from ...gpu.graph import Graph
from ...gpu.handles import Buffer
from ..shared.denoise import declare_blur
from ..shared.gbuffer import Gbuffer
from ..shared.sampling import STILL_SEQUENCE
from .inputs import DeferredInputs

BLUR = 4  # radius, pixels: tools/README.md, "Constants"


def declare_emitters(
    graph: Graph, scene: DeferredInputs, gbuffer: Gbuffer, direct: Buffer, rays: int, seed: int
) -> Buffer:
    """Declare `direct` light plus that of emitters, (r, g, b, 1) per pixel, W/(m2 sr).

    rays: shadow rays per pixel, rounded up to an even number.
    """
    width, height = graph.size
    count = width * height
    # Estimate the light, and its noise.
    light = graph.buffer("emitters/light", dtype=FOUR_FLOATS, count=count, width=width, nonnegative=True)
    normals = graph.buffer("emitters/normals", dtype=np.uint32, count=count, width=width)
    variances = graph.buffer("emitters/variances", count=count, width=width, nonnegative=True)
    shader = "deferred/emitters/light.wgsl"
    graph.compute(
        "emitters/light",
        shader,
        indirect=gbuffer.tile_groups,
        reads={
            **scene.surfaces,
            **gbuffer.tiles,
            "emitters": scene.emitters.table,
            "surfaces": gbuffer.surfaces,
            "distance": gbuffer.distance,
            "visibility": gbuffer.visibility,
        },
        writes={"light": light, "normals": normals, "variances": variances},
        params={"seed": seed},
        constants={**scene.constants(shader), "RAYS": 2 * -(-rays // 2)},
        uniforms=STILL_SEQUENCE,
        clear=[light],
    )
    # Blur it, and add it to the light of other sources.
    blurred = declare_blur(graph, "emitters", gbuffer, light, normals, BLUR, variances=variances)
    total = graph.buffer("emitters/sum", dtype=FOUR_FLOATS, count=count, width=width, nonnegative=True)
    shader = "deferred/emitters/add.wgsl"
    graph.compute(
        "emitters/add",
        shader,
        over=graph.size,
        reads={"direct": direct, "light": blurred, "surfaces": gbuffer.surfaces},
        writes={"sum": total},
        constants=scene.constants(shader),
    )
    return total
