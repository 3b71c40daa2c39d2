"""Reflections of coats: the last bounce of SSIL, by importance sampling in screen space.

Soler et al. 2010, "A Deferred Shading Algorithm for Real-Time Indirect Illumination", section 4, "Screen-space
importance sampling". Departure: pixels of the first level gather from every level, so reflections of far light stay
sharp.
"""

from __future__ import annotations

from ...gpu.graph import Graph
from ...gpu.handles import Buffer
from ..shared.gbuffer import Gbuffer
from ..shared.scene_inputs import SceneInputs
from .levels import Levels, level_buffer
from .voxels import NO_GRID, Voxels


def declare_glossy(
    graph: Graph,
    scene: SceneInputs,
    gbuffer: Gbuffer,
    levels: Levels,
    voxels: Voxels | None,
    light: Buffer,
    samples: int,
    radius: float,
    seed: int,
) -> Buffer | None:
    """Declare the coats' reflection at the first level, W/(m2 sr) over their tint; None without coats or samples.

    light: codes of all levels. samples: number per pixel and level. radius: of the samples, pixels of the level.
    """
    if not scene.features["HAS_COATS"] or not samples:
        graph.skip("ssil/glossy", "every material is Lambert" if samples else "ssil.glossy_samples is 0")
        return None
    size = levels.surfels[levels.first].size
    glossy = level_buffer(graph, "ssil/glossy", size)
    shader = f"ssil/glossy_{'none' if voxels is None else 'voxels'}.wgsl"
    for k in levels.gathered:
        graph.compute(
            f"ssil/glossy_{k}",
            shader,
            over=size,
            reads={
                "surfaces": gbuffer.surfaces,
                "distance": gbuffer.distance,
                "surfels": levels.surfels[k],
                "light": light,
                **(voxels.reads(k) if voxels is not None else {}),
            },
            writes={"glossy": glossy},
            params={
                "size": size,
                "seed": seed,
                "radius": radius,
                "light_offset": levels.pixels_before(k),
                "shift": k - levels.first,
                **(NO_GRID if voxels is None else voxels.params(k)),
            },
            constants={
                **scene.constants(shader),
                **(voxels.constants if voxels is not None else {}),
                "SAMPLES": samples,
                "SQUARE": 1 << levels.first,
                "FINEST": k == levels.first,
            },
        )
    return glossy
