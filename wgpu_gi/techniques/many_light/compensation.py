"""The light that the bound of near virtual point lights takes, found again by what is near in the picture.

Novak, Engelhardt and Dachsbacher 2011, "Screen-Space Bias Compensation for Interactive High-Quality Global Illumination
with Virtual Point Lights". Departures: a few pixels are drawn about each, by what they may give, instead of a hierarchy
of pictures; the bound is that of the lights themselves, averaged by each pixel as it gathers, so that what is added is
what was taken. A density of lights estimated from the light at each pixel would do without that mean, but does not know
lights of several bounces, nor those of the sky.
"""

from __future__ import annotations

from dataclasses import replace

from ...gpu.graph import Graph
from ...gpu.handles import Buffer
from ..shared.gbuffer import FOUR_FLOATS, Gbuffer
from ..shared.scene_inputs import SceneInputs
from .gather import Gathered, near_reach

SHADER = "many_light/gather/compensate.wgsl"
SIDE = 4  # of the squares whose pixels share a set of others; as blurs have it at least


def declare_compensation(
    graph: Graph,
    scene: SceneInputs,
    gbuffer: Gbuffer,
    direct: Buffer,
    gathered: Gathered,
    bounces: int | None,
    seed: int,
) -> Gathered:
    """Declare the irradiance with what its bound took; `direct` is the light scattered once, (r, g, b, -) per pixel."""
    if gathered.bound_sums is None:
        graph.skip("gather/compensate", "gather.compensation is off, or nothing is bounded")
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
        params={"seed": seed, "near_reach": near_reach(gathered.near)},
        constants={
            **scene.constants(SHADER),
            "INTERLEAVE": SIDE,
            "FURTHER": bounces != 1,
            "NEAR": gathered.near is not None,
        },
    )
    return replace(gathered, irradiance=irradiance)
