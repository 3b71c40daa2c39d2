"""Temporal accumulation: irradiance averaged over frames along reprojected pixels.

Nehab et al. 2007, "Accelerating Real-Time Shading with Reverse Reprojection Caching". Departure: the first frames form
a cumulative mean instead of exponential smoothing, so a disoccluded surface does not keep its first frame.
"""

from __future__ import annotations

from dataclasses import dataclass

from ...gpu.formats import FOUR_FLOATS, FOUR_WORDS
from ...gpu.graph import Graph
from ...gpu.handles import Buffer
from ...records import KnownAttributes
from ...settings import setting
from .gbuffer import Gbuffer
from .scene_inputs import SceneInputs

SHADER = "shared/temporal/reproject.wgsl"


@dataclass(repr=False, slots=True)
class TemporalSettings(KnownAttributes):
    """Temporal accumulation of indirect light."""

    frames: int = setting(1, "Frames over which indirect light is averaged; 1: no average.", "frames", range=(1, 255))
    speed: float = setting(
        0.0, "Fewer frames for moving surfaces: frames / (1 + speed * pixels moved per frame).", range=(0, 100)
    )


@dataclass
class Averaged:
    """The mean of each pixel, and the rejected share of its history, 0 to 1."""

    averaged: Buffer
    rejected: Buffer


def declare_accumulate(
    graph: Graph,
    settings: TemporalSettings,
    scene: SceneInputs,
    gbuffer: Gbuffer,
    motion: Buffer,
    irradiance: Buffer,
    name: str = "temporal",
) -> Averaged:
    """Declare the mean over frames of light (r, g, b, depth) per pixel; depth 0: no surface to light."""
    width, height = graph.size
    count = width * height
    history = graph.buffer(f"{name}/history", dtype=FOUR_WORDS, count=count, width=width, history=True)
    averaged = graph.buffer(f"{name}/irradiance", dtype=FOUR_FLOATS, count=count, width=width, nonnegative=True)
    rejected = graph.buffer(f"{name}/rejected", count=count, width=width, nonnegative=True)
    graph.compute(
        f"{name}/accumulate",
        SHADER,
        over=(width, height),
        reads={
            "irradiance": irradiance,
            "motion": motion,
            "previous": history.previous,
            "surfaces": gbuffer.surfaces,
            "distance": gbuffer.distance,
        },
        writes={"history": history, "averaged": averaged, "rejected": rejected},
        params={"frames": settings.frames, "speed": settings.speed},
        constants=scene.constants(SHADER),
    )
    return Averaged(averaged, rejected)
