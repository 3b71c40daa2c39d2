"""The front of error against time: what each candidate costs and how much it errs in a scene, and the best choice.

A candidate is a technique at a quality. Its picture of n frames takes T(n) = start + n t and has
relMSE(n) = noise / n + floor: the mean of independent frames loses its variance, and keeps its bias. For the path
tracer, a frame is one sample per pixel. Figures come from a measurement in the scene where there is one (`probe.py`,
`refine.py`), else from `TYPICAL`, scaled by what was measured of other candidates.

Departures from a model of one technique, such as the noise threshold of path tracers: the floor, which no frame
removes, is part of the choice.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from copy import deepcopy
from dataclasses import dataclass, replace
from typing import NamedTuple

from ..options import Settings, technique_of
from ..settings import QUALITIES, apply_quality, assign, describe
from ..techniques.shared.sampling import OPEN_FRAMES

OPEN_SPP = 10_000_000  # the most samples that `Settings.spp` allows
LEAST_FLOOR, LEAST_NOISE, LEAST_SECONDS = 1e-7, 1e-7, 1e-5  # below: rounding errors of float32, and of clocks
# A measurement on another candidate of the same technique counts this many times as much as one of another technique.
SAME_TECHNIQUE = 8.0


class Candidate(NamedTuple):
    """A technique at a quality; the path tracer, which has no qualities, at the quality "medium"."""

    gi: str
    quality: str

    def __str__(self) -> str:
        return self.gi if self.gi == "path" else f"{self.gi}, {self.quality}"


@dataclass(frozen=True)
class Figures:
    """What a candidate costs and how much it errs, in one scene from one camera, on one adapter."""

    cold: float  # s before the first frame in a new process: compile, upload
    warm: float  # s before the first frame if it has rendered in this process
    fixed: float  # s of a frame, whatever its size
    per_pixel: float  # s of a frame per pixel
    noise: float  # relMSE of one frame, its variance alone
    floor: float  # relMSE of the mean of infinitely many frames
    measured: bool = False  # in this scene; else expected

    def frame_seconds(self, pixels: int) -> float:
        """Return the seconds of a frame of so many pixels."""
        return self.fixed + self.per_pixel * pixels

    def relmse(self, frames: int) -> float:
        """Return the relMSE of the mean of `frames` frames."""
        return self.floor + self.noise / max(frames, 1)


# Of llvmpipe on two cores. Noise and floor: medians of the curves that tools/try_budgets.py fits; a technique's floor
# hardly depends on its quality. Seconds: of furnished rooms at 160x90, shared out as in the Cornell box at two sizes.
TYPICAL = {
    Candidate("many-light", "low"): Figures(0.5, 0.01, 0.016, 1.8e-6, 0.13, 0.0022),
    Candidate("many-light", "medium"): Figures(0.6, 0.02, 0.036, 2.8e-6, 0.087, 0.0020),
    Candidate("many-light", "high"): Figures(1.9, 0.15, 0.140, 5.0e-6, 0.060, 0.0018),
    Candidate("ssdo", "low"): Figures(0.6, 0.01, 0.005, 1.0e-6, 0.15, 0.060),
    Candidate("ssdo", "medium"): Figures(0.7, 0.02, 0.006, 1.4e-6, 0.087, 0.053),
    Candidate("ssdo", "high"): Figures(1.0, 0.05, 0.010, 4.0e-6, 0.034, 0.050),
    Candidate("ssil", "low"): Figures(0.5, 0.02, 0.010, 1.9e-6, 0.040, 0.11),
    Candidate("ssil", "medium"): Figures(0.5, 0.02, 0.015, 2.6e-6, 0.032, 0.11),
    Candidate("ssil", "high"): Figures(0.9, 0.10, 0.070, 7.5e-6, 0.020, 0.10),
    Candidate("none", "low"): Figures(0.3, 0.005, 0.003, 0.7e-6, 0.010, 0.35),
    Candidate("none", "medium"): Figures(0.3, 0.005, 0.003, 1.0e-6, 0.010, 0.35),
    Candidate("none", "high"): Figures(0.3, 0.005, 0.005, 1.7e-6, 0.010, 0.35),
    Candidate("path", "medium"): Figures(0.3, 0.005, 0.004, 2.5e-6, 1.5, LEAST_FLOOR),
}
TECHNIQUES = tuple(dict.fromkeys(candidate.gi for candidate in TYPICAL))


def candidates(
    base: Settings, techniques: Iterable[str] | None = None, quality: str | None = None
) -> dict[Candidate, Settings]:
    """Return the settings of each candidate: `base` with a technique, its presets, and an open number of frames.

    Settings of `base` that are not at their defaults stay. Candidates whose settings would be equal appear once.
    techniques: None: all that have figures; others get only the quality "medium". quality: whose presets `base` has, as
    the user asked; None: any.
    """
    changed = [row for row in describe(base) if row.presets and row.value != row.default]
    found: dict[Candidate, Settings] = {}
    for gi in techniques or TECHNIQUES:
        # The qualities that differ; one that the user asked for is in the settings already.
        asked = "medium" if technique_of(gi).averages_samples else quality
        for preset in QUALITIES if asked is None else (asked,):
            candidate = Candidate(gi, preset)
            if quality is None and candidate not in TYPICAL and preset != "medium":
                continue
            settings = deepcopy(base)
            if quality is None:
                apply_quality(settings, preset)
                for row in changed:
                    assign(settings, f"{row.name}={'none' if row.value is None else row.value}")
            settings.gi, settings.camera.frames, settings.spp = gi, OPEN_FRAMES, OPEN_SPP
            if technique_of(gi).averages_samples:
                settings.path.samples_per_run = 1
            if settings not in found.values():
                found[candidate] = settings
    return found


def expected(wanted: Iterable[Candidate], known: Mapping[Candidate, Figures]) -> dict[Candidate, Figures]:
    """Return the figures of each candidate: those `known`, else typical ones, scaled.

    The scales of time, noise and floor are the geometric means of known over typical figures.
    """
    return {candidate: known.get(candidate) or _scaled(candidate, known) for candidate in wanted}


def typical(candidate: Candidate) -> Figures:
    """Return the typical figures of a candidate; those of SSIL for a technique without."""
    return TYPICAL.get(candidate) or TYPICAL["ssil", candidate.quality]  # type: ignore[index]


def _scaled(candidate: Candidate, known: Mapping[Candidate, Figures]) -> Figures:
    own = typical(candidate)
    logs = {name: 0.0 for name in ("time", "cold", "noise", "floor")}
    total = 0.0
    for other, figures in known.items():
        weight = SAME_TECHNIQUE if other.gi == candidate.gi else 1.0
        usual, total = typical(other), total + weight
        pairs = {
            "time": (figures.fixed + figures.per_pixel * 1e4, usual.fixed + usual.per_pixel * 1e4),
            "cold": (figures.cold, usual.cold),
            "noise": (figures.noise, usual.noise),
            "floor": (figures.floor, usual.floor),
        }
        for name, (value, like) in pairs.items():
            # The path tracer has no floor that could tell about another's.
            if name != "floor" or "path" not in (other.gi, candidate.gi):
                logs[name] += weight * math.log(max(value, LEAST_SECONDS * LEAST_NOISE) / like)
    scales = {name: math.exp(value / total) if total else 1.0 for name, value in logs.items()}
    return replace(
        own,
        cold=own.cold * scales["cold"],
        warm=own.warm * scales["time"],
        fixed=own.fixed * scales["time"],
        per_pixel=own.per_pixel * scales["time"],
        noise=own.noise * scales["noise"],
        floor=own.floor * scales["floor"],
    )


class Choice(NamedTuple):
    """A candidate with the number of frames, the seconds and the relMSE that are expected of it."""

    candidate: Candidate
    frames: int
    seconds: float
    relmse: float


def within(
    candidate: Candidate, figures: Figures, pixels: int, seconds: float | None, error: float | None, *, is_warm: bool
) -> Choice:
    """Return what a candidate reaches within `seconds`, or what it takes to reach `error`, whichever comes first.

    It renders at least one frame. An error that it cannot reach takes infinitely long.
    """
    start, frame = figures.warm if is_warm else figures.cold, figures.frame_seconds(pixels)
    frames = math.inf if seconds is None else max(math.floor((seconds - start) / frame), 1)
    if error is not None:
        needed = math.ceil(figures.noise / (error - figures.floor)) if error > figures.floor else math.inf
        frames = min(frames, max(needed, 1))
    most = OPEN_SPP if averages_samples(candidate) else OPEN_FRAMES
    count = int(min(frames, most))
    return Choice(candidate, count, start + (count if frames < math.inf else math.inf) * frame, figures.relmse(count))


def averages_samples(candidate: Candidate) -> bool:
    """Return whether a frame of a candidate is a sample per pixel."""
    return technique_of(candidate.gi).averages_samples


def best(choices: Iterable[Choice], seconds: float | None, error: float | None) -> Choice:
    """Return the choice that reaches the error first; if none does, that with the least error in time."""

    def rank(choice: Choice) -> tuple[float, ...]:
        late = max(choice.seconds - seconds, 0.0) if seconds is not None else 0.0
        if error is not None and choice.relmse <= error:
            return (late, 0.0, choice.seconds)
        return (late, 1.0, choice.relmse)

    return min(choices, key=rank)
