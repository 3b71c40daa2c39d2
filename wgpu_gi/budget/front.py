"""The front of error against time: what each candidate costs and how much it errs in a scene, as far as it is known.

A candidate is a technique at a quality. Its picture of n frames takes T(n) = start + n t and has
relMSE(n) = noise / n + floor: the mean of independent frames loses its variance, and keeps its bias. For the path
tracer, a frame is one sample per pixel. Noise and floor are known as lognormal distributions: their medians, and the
standard deviations of their logarithms. Figures come from frames of the picture (`frame_series.py`) and traced pixels
(`traced.py`) where there are any, else from `typical.py`, scaled by what was measured of other candidates. `choice.py`
compares candidates.

Departures from a model of one technique, such as the noise threshold of path tracers: the floor, which no frame
removes, is part of the choice.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from copy import deepcopy
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..options import Settings, technique_of
from ..settings import QUALITIES, apply_quality, assign, describe
from ..techniques.shared.sampling import OPEN_FRAMES

OPEN_SPP = 10_000_000  # the most samples that `Settings.spp` allows
LEAST_FLOOR, LEAST_NOISE = 1e-7, 1e-7  # below: rounding errors of float32
# An error can be met if the floor is likely below this share of it; the noise must then fit into the rest.
ROOM = 0.7

_nodes, _weights = np.polynomial.hermite_e.hermegauss(7)
_weights = np.outer(_weights, _weights) / _weights.sum() ** 2


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
    noise: float  # relMSE of one frame, its variance alone: the median of what it may be
    floor: float  # relMSE of the mean of infinitely many frames: the median
    noise_spread: float = 0.0  # standard deviation of the logarithm of the noise: how little is known of it
    floor_spread: float = 0.0
    shared: float = 0.0  # share of the noise that the technique's other qualities have, too: not of indirect light
    measured: bool = False  # in this scene; else expected

    def frame_seconds(self, pixels: int) -> float:
        """Return the seconds of a frame of so many pixels."""
        return self.fixed + self.per_pixel * pixels

    def log_relmse(self, frames: float) -> tuple[float, float]:
        """Return mean and standard deviation of the logarithm of the relMSE of the mean of `frames` frames."""
        noise = self.noise / max(frames, 1) * np.exp(self.noise_spread * _nodes)
        floor = self.floor * np.exp(self.floor_spread * _nodes)
        logs = np.log(noise[:, None] + floor)
        mean = float((_weights * logs).sum())
        return mean, math.sqrt(max(float((_weights * (logs - mean) ** 2).sum()), 0.0))

    def relmse(self, frames: float) -> float:
        """Return the geometric mean of what the relMSE of the mean of `frames` frames may be."""
        return math.exp(self.log_relmse(frames)[0])

    def chance(self, error: float) -> float:
        """Return the probability that enough frames reach a relMSE: that of a floor below `ROOM` of it."""
        distance = math.log(ROOM * error / self.floor) / max(self.floor_spread, 1e-3)
        return 0.5 * (1.0 + math.erf(distance / math.sqrt(2.0)))


def candidates(
    base: Settings, known: Iterable[Candidate], techniques: Iterable[str] | None = None, quality: str | None = None
) -> dict[Candidate, Settings]:
    """Return the settings of each candidate: `base` with a technique, its presets, and an open number of frames.

    Settings of `base` that are not at their defaults stay. Candidates whose settings would be equal appear once.
    known: candidates that have typical figures. techniques: None: all of these; others get only the quality "medium".
    quality: whose presets `base` has, as the user asked; None: any.
    """
    known = list(known)
    changed = [row for row in describe(base) if row.presets and row.value != row.default]
    found: dict[Candidate, Settings] = {}
    for gi in techniques or dict.fromkeys(candidate.gi for candidate in known):
        # The qualities that differ; one that the user asked for is in the settings already.
        asked = "medium" if technique_of(gi).averages_samples else quality
        for preset in QUALITIES if asked is None else (asked,):
            candidate = Candidate(gi, preset)
            if quality is None and candidate not in known and preset != "medium":
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


def averages_samples(candidate: Candidate) -> bool:
    """Return whether a frame of a candidate is a sample per pixel."""
    return technique_of(candidate.gi).averages_samples
