"""Reflective shadow maps (RSMs): the surfaces that punctual lights see, and the flux that these reflect.

Dachsbacher and Stamminger 2005, "Reflective Shadow Maps"; Linke 2016, section 3.2. Departure: rays through the texels
instead of rasterisation (`wgsl/many_light/rsm/trace.wgsl`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...gpu.graph import Graph
from ...gpu.handles import Buffer, Handle
from ...records import KnownAttributes
from ...settings import setting
from ..shared.bounds import NOTHING
from ..shared.sampling import STILL_SEQUENCE
from .inputs import ManyLightInputs
from .lobes import Lobes

CANDIDATE = np.dtype((np.uint32, 4))  # a word of a candidate for a virtual point light


@dataclass(repr=False, slots=True)
class RsmSettings(KnownAttributes):
    """Reflective shadow maps."""

    texels: int = setting(
        16384,
        "Texels of all reflective shadow maps together; the side of each map is a power of two.",
        "texels",
        range=(64, 1 << 18),
        presets={"low": 4096, "high": 65536},
    )
    jitter: bool = setting(True, "Trace through a random point of each texel, a different point in each frame.")


@dataclass
class Rsm:
    """Buffer of `count` candidates for virtual point lights, packed as in `wgsl/many_light/vpl/vpl.wgsl`."""

    buffer: Buffer
    count: int


def declare_rsm(
    graph: Graph, settings: RsmSettings, scene: ManyLightInputs, lobes: Lobes, albedo: Handle, seed: int
) -> Rsm | None:
    """Declare the maps of all punctual lights, None without lights. `albedo`: reflectance table of coated surfaces."""
    count = scene.vpl.rsm_texels
    if count == 0:
        graph.skip("rsm", "no point, spot or sun light", NOTHING)
        return None
    buffer = graph.buffer("rsm", dtype=CANDIDATE, count=lobes.words * count)
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
        constants={**scene.constants(shader), **lobes.reflecting},
        uniforms=STILL_SEQUENCE,
    )
    return Rsm(buffer, count)
