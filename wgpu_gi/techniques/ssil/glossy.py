"""Reflections of coats: the last bounce of SSIL, by rays along directions drawn from the coat.

Soler et al. 2010, "A Deferred Shading Algorithm for Real-Time Indirect Illumination", section 4, "Screen-space
importance sampling". Departure: the paper draws pixels around the projected mirror direction. Few of them lie in a
narrow lobe, their discs widen it, and what they send to the camera is not what they send to the coat; so directions are
drawn from the BRDF, and rays find what they hit.
"""

from __future__ import annotations

import numpy as np

from ...gpu.formats import FOUR_FLOATS
from ...gpu.graph import Graph
from ...gpu.handles import Buffer
from ..deferred.inputs import DeferredInputs
from ..shared.bounds import NOTHING, scattered_more
from ..shared.denoise import declare_blur
from ..shared.gbuffer import Gbuffer

SHADER = "ssil/glossy.wgsl"
BLOCK = 4  # side of the squares of pixels over which the light is averaged: that of `glossy.wgsl`


def declare_glossy(
    graph: Graph,
    scene: DeferredInputs,
    gbuffer: Gbuffer,
    before: Buffer | None,
    directions: int,
    seed: int,
    *,
    offscreen: bool,
) -> Buffer | None:
    """Declare the coats' reflection of all pixels, W/(m2 sr) over their tint; None without coats or directions.

    Hits reflect the scene's lights and the irradiance of the bounces `before`, W/m2, of all pixels. offscreen: hits
    that no pixel shows count, too.
    """
    if not scene.features["HAS_COATS"] or not directions:
        bound = NOTHING if directions else scattered_more(scene, 1)
        graph.skip("ssil/glossy", "every material is Lambert" if directions else "ssil.glossy_samples is 0", bound)
        return None
    width, height = graph.size
    glossy = graph.buffer("ssil/glossy", dtype=FOUR_FLOATS, count=width * height, width=width, nonnegative=True)
    normals = graph.buffer("ssil/glossy_normals", dtype=np.uint32, count=width * height, width=width)
    graph.compute(
        "ssil/glossy",
        SHADER,
        over=(width, height),
        reads={
            **scene.surfaces,
            **scene.lights,
            "surfaces": gbuffer.surfaces,
            "distance": gbuffer.distance,
            "before": graph.neutral("buffer") if before is None else before,
        },
        writes={"glossy": glossy, "normals": normals},
        params={"seed": seed},
        constants={
            **scene.constants(SHADER),
            "DIRECTIONS": directions,
            "HAS_BEFORE": before is not None,
            "OFFSCREEN": offscreen,
        },
    )
    return declare_blur(graph, "ssil/glossy", gbuffer, glossy, normals, BLOCK, lobes=True)
