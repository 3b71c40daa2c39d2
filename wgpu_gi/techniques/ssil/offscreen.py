"""Light from surfaces that no pixel shows: few rays per pixel of the first level, and a radiance cache.

A departure from Soler et al. 2010, whose light comes from visible surfaces only. Rays that hit a visible surface bring
nothing, since SSIL gathers its light; so both parts sum to the whole light. If a number of bounces above one is given,
surfaces that no pixel shows nevertheless have the light of all bounces.
"""

from __future__ import annotations

import numpy as np

from ...gpu.graph import Graph
from ...gpu.handles import Buffer
from ..shared.denoise import declare_blur
from ..shared.gbuffer import Gbuffer
from ..shared.radiance_cache import RadianceCache, declare_cache, declare_hits, declare_update, most_rays
from .inputs import SsilInputs
from .levels import Levels, level_buffer
from .shade import Upsampling

RAYS = "ssil/offscreen/rays.wgsl"
UNREPRESENTED = "ssil/offscreen/unrepresented.wgsl"
# Radius of the blur, pixels of the first level; the denoiser of all light follows. 160x90, two rays, relMSE without and
# with it: single frames of Cornell's area light 0.130, 0.079; corridor 3.4, 1.9; courtyard 0.099, 0.073; 16 frames
# 0.0120, 0.0105; 0.30, 0.32; 0.031, 0.030. With two a-trous levels: 0.070, 1.9, 0.067; 0.0109, 0.35, 0.030.
RADIUS = 4


def declare_offscreen(
    graph: Graph,
    scene: SsilInputs,
    gbuffer: Gbuffer,
    levels: Levels,
    irradiance: Buffer,
    fine: Upsampling | None,
    rays: int,
    seed: int,
    *,
    one_bounce: bool,
) -> None:
    """Declare light from surfaces that no pixel shows, added to the `irradiance` of the first level and that of `fine`.

    one_bounce: it is the light that these surfaces reflect from sources; otherwise also from all other surfaces.
    """
    # Send the rays, update the cells of their hits, and look these up.
    width, height = levels.size
    rays = min(rays, most_rays(graph, width * height))
    cache = declare_cache(graph)
    hits = declare_hits(graph, "ssil/offscreen_hits", width * height * rays)
    surfels = levels.receivers
    shown = {"visibility": gbuffer.visibility, "distance": gbuffer.distance}
    graph.compute(
        "ssil/offscreen_rays",
        RAYS,
        over=(width, height),
        reads={
            **scene.surfaces,
            **shown,
            "surfels": surfels,
            "fine_surfels": levels.surfels[0],
        },
        writes={"hits": hits, "table": cache.table, "requested": cache.requested},
        params={"seed": seed, "rays": rays},
        constants={**scene.constants(RAYS), "SQUARE": 1 << levels.first},
        clear=[cache.requested],
    )
    declare_update(graph, scene, cache, hits, seed, direct_only=one_bounce)
    light = level_buffer(graph, "ssil/offscreen_light", levels.size)
    normals = graph.buffer("ssil/offscreen_normals", dtype=np.uint32, count=width * height, width=width)
    graph.compute(
        "ssil/offscreen_light",
        "ssil/offscreen/light.wgsl",
        over=(width, height),
        reads={"surfels": surfels, "hits": hits, "cells": cache.cells},
        writes={"irradiance": light, "normals": normals},
        params={"rays": rays},
        constants=scene.constants("ssil/offscreen/light.wgsl"),
    )
    # Blur, and add to the light that is gathered from visible surfaces.
    _declare_sum(graph, scene, gbuffer, light, normals, 1 << levels.first, irradiance)
    if fine is not None and fine.irradiance is not None:
        _declare_unrepresented(graph, scene, gbuffer, cache, fine, fine.irradiance, seed, one_bounce)


def _declare_sum(
    graph: Graph, scene: SsilInputs, gbuffer: Gbuffer, light: Buffer, normals: Buffer, stride: int, irradiance: Buffer
) -> None:
    """Declare the blur of `light` and its addition to `irradiance`, both of the first level, W/m2."""
    blurred = declare_blur(graph, "ssil/offscreen", gbuffer, light, normals, RADIUS, frames=scene.frames, stride=stride)
    graph.compute(
        "ssil/offscreen_add",
        "ssil/offscreen/add.wgsl",
        over=(irradiance.count,),
        reads={"offscreen": blurred},
        writes={"irradiance": irradiance},
    )


def _declare_unrepresented(
    graph: Graph,
    scene: SsilInputs,
    gbuffer: Gbuffer,
    cache: RadianceCache,
    fine: Upsampling,
    irradiance: Buffer,
    seed: int,
    one_bounce: bool,
) -> None:
    """Declare the same for unrepresented pixels, added to their `irradiance`."""
    graph.compute(
        "ssil/offscreen_unrepresented",
        UNREPRESENTED,
        indirect=fine.guide.groups,
        reads={
            **scene.surfaces,
            **scene.lights,
            **fine.guide.list_reads,
            "visibility": gbuffer.visibility,
            "distance": gbuffer.distance,
            "table": cache.table,
            "cells": cache.cells,
        },
        writes={"irradiance": irradiance},
        params={"seed": seed},
        constants={**scene.constants(UNREPRESENTED), "DIRECT_ONLY": one_bounce},
    )
