"""Reflections: coats with a narrow lobe take their light from a ray instead of from all virtual point lights.

A lobe much narrower than the distance between VPLs finds dots or, widened to the VPLs' discs (Hasan et al. 2009), loses
light and detail. A departure from Linke 2016, whose surfaces are matte.
"""

from __future__ import annotations

from ...gpu.graph import Graph
from ...gpu.handles import Handle
from ..shared.bounds import ELSEWHERE, NOTHING
from ..shared.denoise import grid_size
from ..shared.gbuffer import Gbuffer
from ..shared.scene_inputs import SceneInputs
from .gather import Gathered, GatherSettings
from .vpl import Vpls

SHADER = "many_light/gather/reflections.wgsl"


def declare_reflections(
    graph: Graph,
    settings: GatherSettings,
    scene: SceneInputs,
    gbuffer: Gbuffer,
    albedo: Handle,
    vpls: Vpls,
    gathered: Gathered,
    bounces: int | None,
    seed: int,
) -> None:
    """Declare the pass that replaces the light of narrow coats; `albedo`: reflectance table of coated surfaces."""
    if gathered.glossy is None or settings.reflections <= 0:
        absent = "no material is coated" if gathered.glossy is None else "gather.reflections is 0"
        graph.skip("gather/reflections", absent, NOTHING if gathered.glossy is None else ELSEWHERE)
        return
    graph.compute(
        "gather/reflections",
        SHADER,
        over=grid_size(graph, gathered.stride),
        reads={
            **scene.surfaces,
            **scene.lights,
            "surfaces": gbuffer.surfaces,
            "distance": gbuffer.distance,
            "ambient_albedo": albedo,
            "vpl_table": vpls.table,
        },
        writes={"glossy": gathered.glossy},
        params={"vpl_count": vpls.count, "seed": seed, "widest": settings.reflections**2},
        constants={**scene.constants(SHADER), **vpls.constants, **gathered.grid, "REFLECTS_VPLS": bounces != 1},
    )
