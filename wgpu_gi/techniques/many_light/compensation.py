"""Bias compensation: adds the light that the bound of near VPLs removes, from near surfaces in screen space.

Novak, Engelhardt and Dachsbacher 2011, "Screen-Space Bias Compensation for Interactive High-Quality Global Illumination
with Virtual Point Lights". Departures: a few pixels around each are sampled, by the light that they may give, instead
of a hierarchy of pictures; the bound is the mean bound of the VPLs that light the pixel, computed while gathering, so
the added light matches the removed light.
"""

from __future__ import annotations

from dataclasses import replace

from ...gpu.formats import FOUR_FLOATS
from ...gpu.graph import Graph
from ...gpu.handles import Buffer
from ..shared.gbuffer import Gbuffer
from ..shared.scene_inputs import SceneInputs
from .gather import Gathered, near_radius

SHADER = "many_light/gather/compensate.wgsl"
SIDE = 4  # of the squares of pixels that share a set of samples; at most the default radius of the blur


def declare_compensation(
    graph: Graph,
    scene: SceneInputs,
    gbuffer: Gbuffer,
    direct: Buffer,
    gathered: Gathered,
    bounces: int | None,
    seed: int,
) -> Gathered:
    """Declare the irradiance with the bound's loss added; `direct`: light scattered once, (r, g, b, -), W/(m2 sr)."""
    if gathered.bound_sums is None:
        graph.skip("gather/compensate", "gather.compensation is off, or gather.clamping is none")
        return gathered
    width, height = graph.size
    irradiance = graph.buffer(
        "gather/compensated", dtype=FOUR_FLOATS, count=width * height, width=width, nonnegative=True
    )
    graph.compute(
        "gather/compensate",
        SHADER,
        over=(width, height),
        reads={
            "surfaces": gbuffer.surfaces,
            "direct": direct,
            "gathered": gathered.irradiance,
            "normals": gathered.normals,
            "bound_sums": gathered.bound_sums,
        },
        writes={"irradiance": irradiance},
        params={"seed": seed, "near_radius": near_radius(gathered.near_field)},
        constants={
            **scene.constants(SHADER),
            "INTERLEAVE": SIDE,
            "MULTIPLE_BOUNCES": bounces != 1,
            "NEAR_FIELD": gathered.near_field is not None,
        },
    )
    return replace(gathered, irradiance=irradiance)
