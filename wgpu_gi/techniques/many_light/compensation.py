"""Bias compensation: adds the light that the bound of near VPLs removes, by a short ray.

Kollig and Keller 2004, "Illumination in the Presence of Weak Singularities". Departures: each VPL has its own bound, so
what it removes at a hit is a mean over VPLs nearby; rays end at a random length, so most are short; the light at a hit
is one sample of the lights and of the VPLs instead of all of them; every third pixel takes a ray in each frame.
"""

from __future__ import annotations

from ...gpu.graph import Graph
from ...gpu.handles import Handle
from ...gpu.wgsl.load import load
from ..shared.bounds import NOTHING, scattered_more
from ..shared.denoise import grid_size
from ..shared.gbuffer import Gbuffer
from ..shared.scene_inputs import SceneInputs
from .gather import Gathered, near_radius
from .vpl import Vpls

SHADER = "many_light/gather/compensate.wgsl"
# Of a path. Random rooms, all bounces: 1 leaves a bias of -0.6 %, 4 gain nothing over 2 but take 5 % more time.
MOST_SEGMENTS = 2
SPACING = int(load(SHADER).constants["SPACING"])


def declare_compensation(
    graph: Graph,
    scene: SceneInputs,
    gbuffer: Gbuffer,
    albedo: Handle,
    vpls: Vpls,
    gathered: Gathered,
    bounces: int | None,
    seed: int,
) -> None:
    """Declare the pass that adds the bound's loss to the irradiance; `albedo`: reflectance table of coated surfaces."""
    if not gathered.compensated:
        if gathered.bounded:
            graph.skip("gather/compensate", "gather.compensation is off", scattered_more(scene, 1))
        else:
            graph.skip("gather/compensate", "gather.clamping is none", NOTHING)
        return
    mean_bound = graph.buffer("gather/mean_bound", count=1)
    graph.compute(
        "gather/mean_bound",
        "many_light/gather/mean_bound.wgsl",
        over=1,
        reads={"vpl_table": vpls.table},
        writes={"mean_bound": mean_bound},
        params={"vpl_count": vpls.count},
        constants=vpls.constants,
    )
    width, height = grid_size(graph, gathered.stride)
    graph.compute(
        "gather/compensate",
        SHADER,
        over=(-(-width // SPACING), height),
        reads={
            **scene.surfaces,
            **scene.lights,
            "surfaces": gbuffer.surfaces,
            "distance": gbuffer.distance,
            "ambient_albedo": albedo,
            "vpl_table": vpls.table,
            "mean_bound": mean_bound,
        },
        writes={"irradiance": gathered.irradiance},
        params={"vpl_count": vpls.count, "seed": seed, "near_radius": near_radius(gathered.near_field)},
        constants={
            **scene.constants(SHADER),
            **vpls.constants,
            **gathered.grid,
            "SEGMENTS": min(bounces or MOST_SEGMENTS, MOST_SEGMENTS),
            "REFLECTS_VPLS": bounces != 1,
            "NEAR_FIELD": gathered.near_field is not None,
        },
    )
