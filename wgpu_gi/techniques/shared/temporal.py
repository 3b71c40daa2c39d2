"""Temporal accumulation: irradiance averaged over frames along reprojected pixels.

Nehab et al. 2007, "Accelerating Real-Time Shading with Reverse Reprojection Caching"; the clip of the history to its
neighbourhood: Karis 2014, "High-Quality Temporal Supersampling". Departures:

* The first frames form a cumulative mean instead of exponential smoothing, so a disoccluded surface does not keep its
  first frame; until then it takes the mean of its neighbours on the same surface.
* The clip compares means of neighbours over this and the previous frames, and its bound is their usual change over
  time. A bound by the variance of one frame takes noise for a change, and loses the energy of rare bright samples.
"""

from __future__ import annotations

from dataclasses import dataclass

from ...gpu.formats import FOUR_FLOATS, FOUR_WORDS, TWO_FLOATS
from ...gpu.graph import Graph
from ...gpu.handles import Buffer
from ...records import KnownAttributes
from ...settings import setting
from .gbuffer import Gbuffer
from .scene_inputs import SceneInputs

REPROJECT, ACCUMULATE = "shared/temporal/reproject.wgsl", "shared/temporal/accumulate.wgsl"


@dataclass(repr=False, slots=True)
class TemporalSettings(KnownAttributes):
    """Temporal accumulation of indirect light."""

    frames: int = setting(
        1,
        "Averages indirect light over frames: a change is 90 % there after so many; 1: no average.",
        "frames",
        range=(1, 255),
    )
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
    *,
    step: int,
    coat: bool = False,
) -> Averaged:
    """Declare the mean over frames of light (r, g, b, depth) per pixel; depth 0: no surface to light.

    step: an odd number of pixels; noise is independent that far apart. coat: the light is what coats reflect.
    """
    width, height = graph.size
    count = width * height
    history = graph.buffer(f"{name}/history", dtype=FOUR_WORDS, count=count, width=width, history=True)
    averaged = graph.buffer(f"{name}/irradiance", dtype=FOUR_FLOATS, count=count, width=width, nonnegative=True)
    rejected = graph.buffer(f"{name}/rejected", count=count, width=width, nonnegative=True)
    found = graph.buffer(f"{name}/found", dtype=FOUR_WORDS, count=count, width=width)
    usual = graph.buffer(f"{name}/usual", dtype=TWO_FLOATS, count=count, width=width, nonnegative=True)
    surfaces = {"surfaces": gbuffer.surfaces, "distance": gbuffer.distance}
    reads = {"irradiance": irradiance, "motion": motion, **surfaces}
    graph.compute(
        f"{name}/reproject",
        REPROJECT,
        over=(width, height),
        reads={**reads, "previous": history.previous},
        writes={"found": found, "usual": usual, "rejected": rejected},
        constants=scene.constants(REPROJECT),
    )
    graph.compute(
        f"{name}/accumulate",
        ACCUMULATE,
        over=(width, height),
        reads={**reads, "found": found, "usual": usual},
        writes={"history": history, "averaged": averaged},
        params={"frames": settings.frames, "speed": settings.speed, "step": step},
        constants={**scene.constants(ACCUMULATE), "COAT": coat},
    )
    return Averaged(averaged, rejected)
