"""Points on all surfaces in proportion to area, for imperfect shadow maps and for light paths from the sky.

Ritschel et al. 2008, "Imperfect Shadow Maps for Efficient Computation of Indirect Illumination". Departure: points form
a low-discrepancy sequence over the area; the GPU makes them when geometry or materials change.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...gpu.graph import Graph
from ...gpu.handles import Buffer, Handle
from .inputs import ManyLightInputs

WORD = np.dtype((np.uint32, 4))  # half a point


@dataclass
class Points:
    """Points in the layout of `many_light/points/table.wgsl`; every prefix is spread evenly over the area."""

    buffer: Buffer
    count: int


def declare_points(graph: Graph, scene: ManyLightInputs, count: int, albedo: Handle) -> Points:
    """Declare `count` points on the scene's surfaces; `albedo`: reflectance table of coated surfaces."""
    buffer = graph.buffer("points", dtype=WORD, count=2 * count)
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
