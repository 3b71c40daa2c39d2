"""Irradiance averaged over frames, where reprojection finds the same surface again.

Nehab et al. 2007, "Accelerating Real-Time Shading with Reverse Reprojection Caching". Departure: the mean of all frames
at first, so that a surface that comes into view is not a fixed share of its first frame.
"""

from __future__ import annotations

from dataclasses import dataclass

from ...gpu.formats import FOUR_FLOATS, FOUR_WORDS
from ...gpu.graph import Graph
from ...gpu.handles import Buffer
from ...settings import setting
from .gbuffer import Gbuffer
from .scene_inputs import SceneInputs

SHADER = "shared/temporal/accumulate.wgsl"


@dataclass
class TemporalSettings:
    """How light is averaged over frames."""

    frames: int = setting(1, "Frames that indirect light is averaged over; 1 for none.", "frames", range=(1, 255))
    speed: float = setting(
        0.0, "Fewer frames count where a surface moves over the picture: 1 / (1 + speed pixels).", range=(0, 100)
    )


@dataclass
class Averaged:
    """The mean of each pixel, and the share of its history that was left out."""

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
    """Declare the mean over frames of light (r, g, b, -) per pixel, where the last value is above 0."""
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
            "before": history.previous,
            "surfaces": gbuffer.surfaces,
            "distance": gbuffer.distance,
        },
        writes={"kept": history, "averaged": averaged, "rejected": rejected},
        params={"frames": settings.frames, "speed": settings.speed},
        constants=scene.constants(SHADER),
    )
    return Averaged(averaged, rejected)
