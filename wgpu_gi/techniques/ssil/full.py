"""The end of SSIL: light of the first level that it gathers at, brought to all pixels of the picture and reflected.

Soler et al. 2010, "A Deferred Shading Algorithm for Real-Time Indirect Illumination", section 4. Departures: pixels
that no pixel of the first level stands for gather by themselves; what coats reflect is not averaged over frames, since
it changes with the view: the factor of eq. 6 is 0 for them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...gpu.graph import Graph
from ...gpu.handles import Buffer
from ..shared.gbuffer import FOUR_FLOATS, Gbuffer
from ..shared.scene_inputs import SceneInputs
from ..shared.temporal import TemporalSettings, declare_accumulate
from .levels import Levels, level_buffer


@dataclass(frozen=True)
class Lone:
    """Pixels of the picture that none of the first level stands for: their indices, and workgroups for them.

    `irradiance` is of each in the list, W/m2.
    """

    pixels: Buffer
    groups: Buffer
    irradiance: Buffer


def declare_lone(graph: Graph, levels: Levels, wanted: bool) -> Lone | None:
    """Declare the list of lone pixels; None where there are none, or they are not `wanted`."""
    if not wanted or levels.first == 0:
        graph.skip("ssil/lone", "gathering starts at full resolution" if wanted else "ssil.lone is off")
        return None
    width, height = graph.size
    pixels = graph.buffer("ssil/lone", dtype=np.uint32, count=width * height)
    groups = graph.buffer("ssil/lone_groups", dtype=np.uint32, count=4)
    graph.compute(
        "ssil/lone",
        "ssil/lone.wgsl",
        over=levels.surfels[0],
        reads={"surfels": levels.surfels[0], "coarse_surfels": levels.surfels[levels.first]},
        writes={"lone": pixels, "lone_groups": groups},
        constants={"SQUARE": 1 << levels.first},
        clear=[groups],
    )
    return Lone(pixels, groups, level_buffer(graph, "ssil/lone_irradiance", graph.size))


def declare_last(
    graph: Graph,
    temporal: TemporalSettings,
    scene: SceneInputs,
    gbuffer: Gbuffer,
    motion: Buffer,
    levels: Levels,
    irradiance: Buffer,
    glossy: Buffer | None,
    lone: Lone | None,
) -> Buffer:
    """Declare the light that pixels of the picture reflect: of the irradiance, and of `glossy`, of the first level."""
    if temporal.frames == 1:
        graph.skip("temporal/accumulate", "temporal.frames is 1")
        return _declare_full(graph, scene, gbuffer, levels, irradiance, "indirect", glossy, lone, {})
    full = _declare_full(graph, scene, gbuffer, levels, irradiance, "irradiance", None, lone, {"REFLECTED": False})
    mean = declare_accumulate(graph, temporal, scene, gbuffer, motion, full).averaged
    return _declare_full(graph, scene, gbuffer, levels, mean, "indirect", glossy, None, {"UPSAMPLED": True})


def _declare_full(
    graph: Graph,
    scene: SceneInputs,
    gbuffer: Gbuffer,
    levels: Levels,
    coarse: Buffer,
    name: str,
    glossy: Buffer | None,
    lone: Lone | None,
    variant: dict[str, bool],
) -> Buffer:
    """Declare what pixels of the picture get, or reflect, of the light of the first level."""
    width, height = graph.size
    full = graph.buffer(f"ssil/{name}", dtype=FOUR_FLOATS, count=width * height, width=width, nonnegative=True)
    shader = "ssil/last.wgsl"
    reads = {
        "surfaces": gbuffer.surfaces,
        "surfels": levels.surfels[0],
        "coarse_surfels": levels.surfels[levels.first],
        "coarse": coarse,
        "coarse_glossy": graph.neutral("buffer") if glossy is None else glossy,
    }
    constants: dict[str, float] = {
        **scene.constants(shader),
        "SQUARE": 1 << levels.first,
        "HAS_GLOSSY": glossy is not None,
        **variant,
    }
    graph.compute(f"ssil/{name}", shader, over=(width, height), reads=reads, writes={"full": full}, constants=constants)
    if lone is not None:
        graph.compute(
            f"ssil/{name}_lone",
            shader,
            entry="listed",
            indirect=lone.groups,
            reads={
                **reads,
                "lone": lone.pixels,
                "lone_groups": lone.groups,
                "lone_irradiance": lone.irradiance,
            },
            writes={"full": full},
            constants=constants,
        )
    return full
