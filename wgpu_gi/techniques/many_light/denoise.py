"""Denoising of gathered light: accumulation over frames and the edge-aware blur of interleaved sampling.

Linke 2016, section 3.4, for the blur; `shared/denoise.py` and `shared/temporal.py` name sources and departures.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

from ...gpu.graph import Graph
from ...gpu.handles import Buffer
from ..shared.denoise import DenoiseSettings, declare_filter
from ..shared.gbuffer import Gbuffer
from ..shared.scene_inputs import SceneInputs
from ..shared.temporal import TemporalSettings, declare_accumulate
from .gather import Gathered

STEP = 3  # pixels between neighbours of the mean over frames: 16 of them see all virtual lights


@dataclass
class Accumulated:
    """Light accumulated over frames; `rejected`: the rejected share of each pixel's history, 0 to 1."""

    gathered: Gathered
    rejected: Buffer


def declare_temporal(
    graph: Graph,
    settings: TemporalSettings,
    scene: SceneInputs,
    gbuffer: Gbuffer,
    motion: Buffer,
    gathered: Gathered,
) -> Accumulated:
    """Declare the means over frames of irradiance, and of what coats reflect."""
    accumulate = partial(declare_accumulate, graph, settings, scene, gbuffer, motion, step=STEP)
    found, glossy = accumulate(irradiance=gathered.irradiance), gathered.glossy
    if glossy is not None:
        glossy = accumulate(irradiance=glossy, name="temporal/glossy", coat=True).averaged
    return Accumulated(replace(gathered, irradiance=found.averaged, glossy=glossy), found.rejected)


def declare_denoise(
    graph: Graph, settings: DenoiseSettings, gbuffer: Gbuffer, gathered: Gathered, frames: int
) -> Buffer:
    """Declare the blurred indirect light: (r, g, b, 1) per pixel, W/(m2 sr); `frames`: number per still picture."""
    radius = max(settings.radius, gathered.interleave) if settings.radius > 1 else 1
    return declare_filter(
        graph,
        "denoise",
        gbuffer,
        gathered.irradiance,
        gathered.normals,
        radius,
        settings.levels,
        frames=frames,
        glossy=gathered.glossy,
        reflected=True,
    ).light
