"""Reflective shadow maps (RSMs): the surfaces that point, spot and directional lights see, and the flux they reflect.

Dachsbacher and Stamminger 2005, "Reflective Shadow Maps"; Linke 2016, section 3.2. Departure: rays through the texels
instead of rasterisation, see `wgsl/many_light/rsm/trace.wgsl`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...gpu.graph import Graph
from ...gpu.handles import Buffer, Handle
from ...settings import setting
from .inputs import ManyLightInputs

CANDIDATE = np.dtype((np.uint32, 4))  # a candidate for a virtual point light is two of them


@dataclass
class RsmSettings:
    """Reflective shadow maps."""

    texels: int = setting(
        16384,
        "Texels of all reflective shadow maps together; each map has a power of two on a side.",
        "texels",
        range=(64, 1 << 18),
        presets={"low": 4096, "high": 65536},
    )
    jitter: bool = setting(True, "Trace through a random point of each texel, a different one in each frame.")


@dataclass
class Rsm:
    """Candidates for virtual point lights as `wgsl/many_light/vpl/vpl.wgsl` packs them; `count` of them."""

    buffer: Buffer
    count: int


def declare_rsm(graph: Graph, settings: RsmSettings, scene: ManyLightInputs, albedo: Handle, seed: int) -> Rsm | None:
    """Declare the maps of all punctual lights; return None if there is none. `albedo` is that of coated surfaces."""
    count = scene.vpl.rsm_texels
    if count == 0:
        graph.skip("rsm", "no point, spot or sun light")
        return None
    buffer = graph.buffer("rsm", dtype=CANDIDATE, count=2 * count)
    shader = "many_light/rsm/trace.wgsl"
    graph.compute(
        "rsm",
        shader,
        over=count,
        reads={
            **scene.surfaces,
            **scene.lights,
            "rsm_lights": scene.vpl.rsm_lights,
            "ambient_albedo": albedo,
        },
        writes={"rsm": buffer},
        params={"texels": count, "jitter": settings.jitter, "seed": seed},
        constants=scene.constants(shader),
    )
    return Rsm(buffer, count)
