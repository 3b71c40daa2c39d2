"""What a bench measures, as plain data."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from .metrics import Errors

CASES = {"still": "still", "camera": "camera moving", "all": "all moving"}
PRESET = "(preset)"  # mark of swept settings that are as the quality has them


@dataclass(frozen=True)
class Stats:
    """Median and 95th percentile, in milliseconds."""

    median: float
    p95: float


@dataclass(frozen=True)
class Case:
    """Times of the frames of one of `CASES`.

    `gpu_ms` is the sum over the passes of a frame, measured apart from `wall_ms`, which is from the call to the last
    work of the GPU. `passes` are over the frames in which each ran, `passes_run` the most in any frame.
    """

    passes_run: int
    wall_ms: Stats
    gpu_ms: Stats
    passes: dict[str, Stats]


@dataclass(frozen=True)
class Measurement:
    """A technique measured: errors by layer (None: the truth is black or unknown), times by case, bytes of its graph.

    `bounces` are the indirect bounces of the truth that it is held against, None for all. `errors` are those of a
    single frame, `settled` those of the mean that a still picture comes to after `settled_frames`; without random
    numbers these are one. `variant` says what `--sweep` has set.
    """

    gi: str
    quality: str
    bounces: int | None
    errors: dict[str, Errors | None]
    settled: dict[str, Errors | None]
    settled_frames: int
    cases: dict[str, Case]
    bytes: int
    variant: str = ""

    @property
    def title(self) -> str:
        """What sets it apart from others of its scene, in words."""
        return title_of(self.gi, self.quality, self.variant)


@dataclass(frozen=True)
class PathPoint:
    """A picture of the path tracer: what it takes from nothing, and how good it is."""

    spp: int
    gpu_ms: float
    wall_ms: float
    errors: dict[str, Errors | None]


@dataclass(frozen=True)
class Reference:
    """A truth that was used, with its noise as relMSE by layer, and the path tracer's way towards it."""

    bounces: int | None
    truth: str
    noise: dict[str, float | None]
    curve: list[PathPoint]


@dataclass(frozen=True)
class SceneReport:
    """All that was measured in one scene; the fields before `size`, and `relight`, are as on the command line."""

    scene: str
    camera: str | None
    env: str | None
    light: list[str]
    diffuse: bool
    set: list[str]
    size: tuple[int, int]
    techniques: list[Measurement]
    references: list[Reference]
    relight: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Report:
    """All that was measured in one go."""

    machine: dict[str, Any]
    frames: int
    warm_up: int
    scenes: list[SceneReport]


def title_of(gi: str, quality: str, variant: str) -> str:
    """Return the title of a measurement."""
    return ", ".join(part for part in (gi, quality, variant) if part)


def bounces_text(bounces: int | None) -> str:
    """Return the indirect bounces of a truth in words."""
    return "all bounces" if bounces is None else f"{bounces} indirect bounce{'s' * (bounces != 1)}"
