"""Filters of gathered light: its mean over frames, and the edge-aware blur."""

from __future__ import annotations

from dataclasses import dataclass, replace

from ...gpu.graph import Graph
from ...gpu.handles import Buffer
from ...settings import setting
from ..shared.denoise import declare_blur
from ..shared.gbuffer import Gbuffer
from ..shared.scene_inputs import SceneInputs
from ..shared.temporal import TemporalSettings, declare_accumulate
from .gather import Gathered


@dataclass
class Accumulated:
    """What VPLs give to each pixel in the mean; `rejected`: the share of each pixel's history that was left out."""

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
    """Declare the mean over frames of the irradiance; what coats reflect changes with the view and is left alone."""
    found = declare_accumulate(graph, settings, scene, gbuffer, motion, gathered.irradiance)
    return Accumulated(replace(gathered, irradiance=found.averaged), found.rejected)


@dataclass
class DenoiseSettings:
    """How the light of neighbouring pixels is averaged."""

    radius: int = setting(
        4,
        "Pixels that light is averaged over, up to edges; at least the side of squares that share VPLs; 1 is off.",
        "pixels",
        range=(1, 8),
    )


def declare_denoise(
    graph: Graph, settings: DenoiseSettings, gbuffer: Gbuffer, gathered: Gathered, frames: int
) -> Buffer:
    """Declare the indirect light: (r, g, b, 1) per pixel, W/(m2 sr). `frames` make a still picture."""
    radius = max(settings.radius, gathered.interleave) if settings.radius > 1 else 1
    return declare_blur(
        graph,
        "denoise",
        gbuffer,
        gathered.irradiance,
        gathered.normals,
        radius,
        frames=frames,
        glossy=gathered.glossy,
        reflected=True,
    )
