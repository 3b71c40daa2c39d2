"""Points on all surfaces, in proportion to their area, for what is sought or drawn all over the scene."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...gpu.graph import Graph
from ...gpu.handles import Buffer, Handle
from .inputs import ManyLightInputs

POINT = np.dtype((np.uint32, 4))  # two of them


@dataclass
class Points:
    """Points as `many_light/points/table.wgsl` has them; every prefix of `count` is spread evenly over the area."""

    buffer: Buffer
    count: int


def declare_points(graph: Graph, scene: ManyLightInputs, count: int, albedo: Handle) -> Points:
    """Declare `count` points on the scene's surfaces; they are kept while geometry and materials are still."""
    buffer = graph.buffer("points", dtype=POINT, count=2 * count)
    shader = "many_light/points/sample.wgsl"
    row = 1 << 15
    graph.compute(
        "points",
        shader,
        over=(min(count, row), -(-count // row)),
        reads={
            **scene.surfaces,
            "area_instances": scene.vpl.area_instances,
            "area_cdf": scene.vpl.area_cdf,
            "ambient_albedo": albedo,
        },
        writes={"points": buffer},
        constants=scene.constants(shader),
    )
    return Points(buffer, count)
