"""The unoccluded share of the environment's light at each pixel, from a few rays and a blur.

Interleaved like the gathering of virtual point lights (Segovia et al. 2006), so both share one blur.
"""

from __future__ import annotations

import numpy as np

from ...gpu.formats import FOUR_FLOATS
from ...gpu.graph import Graph
from ...gpu.handles import Buffer
from ..shared.denoise import declare_blur
from ..shared.gbuffer import Gbuffer
from ..shared.scene_inputs import SceneInputs
from .environment import EnvironmentSettings

# Side of the squares of pixels that share directions, and of the blur: tools/README.md, "Constants".
INTERLEAVE = 4


def declare_sky_occlusion(
    graph: Graph, settings: EnvironmentSettings, scene: SceneInputs, gbuffer: Gbuffer, seed: int, frames: int
) -> Buffer | None:
    """Declare the unoccluded share of the environment, (r, g, b, -) per pixel; return None if occlusion is off."""
    if not (settings.ambient and settings.rays and scene.features["HAS_ENVIRONMENT"]):
        absent = not scene.features["HAS_ENVIRONMENT"]
        graph.skip("sky/occlusion", "there is no environment" if absent else "environment.rays is 0 or ambient off")
        return None
    width, height = graph.size
    pictured = scene.features["HAS_PICTURED_ENVIRONMENT"]
    arriving = graph.buffer("sky/arriving", dtype=FOUR_FLOATS, count=width * height, width=width, nonnegative=True)
    sent = graph.buffer(
        "sky/sent", dtype=FOUR_FLOATS, count=width * height if pictured else 1, width=width, nonnegative=True
    )
    normals = graph.buffer("sky/normals", dtype=np.uint32, count=width * height, width=width)
    shader = "deferred/sky/occlusion.wgsl"
    graph.compute(
        "sky/occlusion",
        shader,
        indirect=gbuffer.tile_groups,
        reads={
            **scene.surfaces,
            **gbuffer.tiles,
            **scene.lights,
            "visibility": gbuffer.visibility,
            "surfaces": gbuffer.surfaces,
            "distance": gbuffer.distance,
        },
        writes={"arriving": arriving, "normals": normals, "sent": sent},
        params={"seed": seed, "rays": settings.rays},
        constants={**scene.constants(shader), "INTERLEAVE": INTERLEAVE},
        clear=[arriving, sent],
    )
    # With a constant environment, the arriving light is the share itself.
    whole = sent if pictured else None
    return declare_blur(
        graph, "sky", gbuffer, arriving, normals, INTERLEAVE, frames=frames, shares=not pictured, glossy=whole
    )
