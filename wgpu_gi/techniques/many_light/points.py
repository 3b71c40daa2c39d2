"""Points on all surfaces in proportion to area, for imperfect shadow maps and for light paths from the sky.

Ritschel et al. 2008, "Imperfect Shadow Maps for Efficient Computation of Indirect Illumination". Departure: points form
a low-discrepancy sequence over the area. The GPU makes those of shadow maps when geometry or materials change, those
of light paths in each frame of a still picture.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...gpu.graph import Graph
from ...gpu.handles import Buffer, Handle
from ..shared.sampling import STILL_SEQUENCE
from .inputs import ManyLightInputs

WORD = np.dtype((np.uint32, 4))  # half a point


@dataclass
class Points:
    """Points in the layout of `many_light/points/table.wgsl`; every prefix is spread evenly over the area."""

    buffer: Buffer
    count: int


def declare_points(graph: Graph, scene: ManyLightInputs, count: int, albedo: Handle) -> Points:
    """Declare `count` points on the scene's surfaces; `albedo`: reflectance table of coated surfaces."""
    row = 1 << 15
    over = (min(count, row), -(-count // row))
    return _declare(graph, scene, "points", "many_light/points/sample.wgsl", over, count, albedo, {})


def declare_sky_points(graph: Graph, scene: ManyLightInputs, count: int, albedo: Handle, seed: int) -> Points:
    """Declare the starts of `count` light paths from the environment, other points in each frame."""
    shader = "many_light/vpl/sky_points.wgsl"
    return _declare(graph, scene, "vpl/sky_points", shader, (count, 1), count, albedo, {"seed": seed}, STILL_SEQUENCE)


def _declare(
    graph: Graph,
    scene: ManyLightInputs,
    name: str,
    shader: str,
    over: tuple[int, int],
    count: int,
    albedo: Handle,
    params: dict[str, int],
    uniforms: dict[str, str] | None = None,
) -> Points:
    """Declare a pass that draws `count` points."""
    buffer = graph.buffer(name, dtype=WORD, count=2 * count)
    graph.compute(
        name,
        shader,
        over=over,
        reads={
            **scene.surfaces,
            "area_instances": scene.vpl.area_instances,
            "area_cdf": scene.vpl.area_cdf,
            "ambient_albedo": albedo,
        },
        writes={"points": buffer},
        params=params,
        constants=scene.constants(shader),
        uniforms=uniforms,
    )
    return Points(buffer, count)
