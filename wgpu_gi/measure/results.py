"""The results of a bench, as plain data."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from .metrics import Errors

CASES = {"still": "still", "camera": "camera moving", "all": "all moving"}
PRESET = "(preset)"  # marks swept settings that equal the preset of the quality


@dataclass(frozen=True)
class Stats:
    """Median and 95th percentile, in milliseconds."""

    median: float
    p95: float


@dataclass(frozen=True)
class Case:
    """Times of the frames of one of `CASES`.

    `gpu_ms` is the sum over the passes of a frame. `wall_ms` is the time from the call until the GPU is done, measured
    in other frames than `gpu_ms`. `passes` has the times of each pass over the frames in which it ran; `passes_run` is
    the largest number of passes in a frame.
    """

    passes_run: int
    wall_ms: Stats
    gpu_ms: Stats
    passes: dict[str, Stats]


@dataclass(frozen=True)
class MovingErrors:
    """Errors of a layer while something moves, against the technique's own converged pictures.

    flicker: mean variance over frames of the relative error at points in view throughout, while the camera moves.
    lag: frames until a step of all light is 90 % there. ghost_camera, ghost_object: relMSE where the camera or an
    instance that moves has just revealed a surface. relmse, bias: of all pixels while the camera moves. None: not
    measurable.
    """

    flicker: float | None
    lag: int | None
    ghost_camera: float | None
    ghost_object: float | None
    relmse: float
    bias: float


@dataclass(frozen=True)
class PlayedErrors:
    """Errors while the scene's animation plays, against path-traced pictures of the same poses.

    `frames` is the history, `temporal.frames`; values are means over some moments. ghost: relMSE where a static or
    rigid surface has just come into view. None: not measurable.
    """

    frames: int
    relmse_full: float | None
    bias_full: float | None
    ghost_full: float | None
    relmse_indirect: float | None
    bias_indirect: float | None
    ghost_indirect: float | None


@dataclass(frozen=True)
class Measurement:
    """A measured technique: errors by layer (None: the truth is black or unknown), times by case, bytes of its graph.

    `bounces` are the indirect bounces of the truth, None for all. `errors` are those of a single frame, `settled` those
    of a still picture, the mean of `settled_frames`; both are equal for a technique without random numbers. `variant`
    holds the settings of `--sweep`; `moving` the errors of `--moving` by layer (`measure_moving`), None without it;
    `played` those of the scene's animation (`measure_played`), None without `--moving` or without one.
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
    moving: dict[str, MovingErrors | None] | None = None
    played: list[PlayedErrors] | None = None

    @property
    def title(self) -> str:
        """Technique, quality and variant, in words."""
        return title_of(self.gi, self.quality, self.variant)


@dataclass(frozen=True)
class PathPoint:
    """A picture of the path tracer: its time since the first sample, and its errors."""

    spp: int
    gpu_ms: float
    wall_ms: float
    errors: dict[str, Errors | None]


@dataclass(frozen=True)
class Reference:
    """A truth, with its noise as relMSE by layer, and the path tracer's curve against it.

    `denoised` is the curve of the same pictures after Open Image Denoise, full images alone; empty without the package.
    """

    bounces: int | None
    truth: str
    noise: dict[str, float | None]
    curve: list[PathPoint]
    denoised: list[PathPoint] = field(default_factory=list)


@dataclass(frozen=True)
class SceneReport:
    """The results of one scene. The fields before `size`, and `relight`, are as on the command line."""

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
    """The results of one bench."""

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
