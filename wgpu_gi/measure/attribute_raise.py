"""Measures settings that may lower the largest parts of an error: the error with each, and the time of a frame."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass
from functools import partial

import numpy as np

from ..errors import GiError
from ..options import Settings, uses
from ..settings import assign, describe
from ..techniques.shared.stage import Stage
from .attribute_study import Bar, Split, Study
from .bench import measure_case

LEAST_SHARE = 0.1  # of the error: smaller parts are not worth a setting
MOST_STAGES = 3  # the largest parts of a bar whose settings are tried
SEEDS_SINGLE, SEEDS_STILL = 8, 2  # pictures with each setting
MORE_FRAMES = 2  # factor on the frames of a still picture
LEAST_GAIN = 0.05  # of the error: a smaller gain is none
SURE = 2.0  # standard errors: a gain within these is none


@dataclass(frozen=True)
class Raise:
    """A changed setting, the stage that it is for, and what it does.

    setting: `name=value`. errors: the error of the first bars' layer by the frames of a picture. time: of a picture
    with the setting, over that without.
    """

    setting: str
    stage: str
    errors: dict[int, Split]
    time: float


def measure_raises(study: Study, bars: list[Bar], timed: int) -> list[Raise]:
    """Return the settings of the largest parts of the bars, measured; `timed`: frames for each time."""
    layer, settings = bars[0].layer, study.settings
    raises = []
    for stage, text in candidates(settings, _largest(bars, layer)):
        changed = deepcopy(settings)
        assign(changed, text)
        if all(_is_same(study, changed, frames) for frames in study.counts):
            continue
        # Time both in turn: the load of the machine may change.
        before = time_frame(study, settings, timed)
        time = time_frame(study, changed, timed) / before if before else 1.0
        errors = {frames: _error(study, changed, layer, frames) for frames in study.counts}
        raises.append(Raise(text, stage.name, errors, time))
    # More frames divide the noise of a still picture.
    still = [bar for bar in bars if bar.layer == layer and bar.frames > 1]
    if still and still[0].whole.noise > LEAST_SHARE * still[0].whole.total:
        more = still[0].frames * MORE_FRAMES
        split = _error(study, settings, layer, more)
        raises.append(Raise(f"camera.frames={more}", "noise", {still[0].frames: split}, float(MORE_FRAMES)))
    return raises


def candidates(settings: Settings, stages: list[Stage]) -> list[tuple[Stage, str]]:
    """Return `name=value` for each setting that may lower the part of a stage and that is not at that value yet."""
    rows = {row.name: row for row in describe(settings)}
    found: dict[str, Stage] = {}
    for stage in stages:
        texts = list(stage.values)
        for name, factor in stage.factors.items():
            row = rows[name]
            if row.value is None:
                continue
            value = row.value * factor
            if row.range is not None:
                value = min(max(value, row.range[0]), row.range[1])
            texts.append(f"{name}={round(value) if row.kind is int else value}")
        for text in texts:
            changed = deepcopy(settings)
            try:
                assign(changed, text)
            except GiError:
                continue  # a value that other settings forbid
            if changed != settings and uses(settings.gi, text.partition("=")[0]):
                found.setdefault(text, stage)
    return [(stage, text) for text, stage in found.items()]


def time_frame(study: Study, settings: Settings, timed: int) -> float:
    """Return the milliseconds of a frame in which everything moves, the median of `timed` frames."""
    study.renderer.settings = deepcopy(settings)
    return measure_case(study.renderer, "all", timed, partial(study.report, "times")).gpu_ms.median


def best(raises: list[Raise], bar: Bar) -> Raise | None:
    """Return the setting with the least product of error and time for the frames of a bar; None if none helps.

    At equal time, the error of more samples falls with the time, so the product compares settings of unequal time.
    """
    whole = bar.whole
    useful = []
    for one in raises:
        if bar.frames in one.errors:
            after = one.errors[bar.frames]
            gain = whole.total - after.total
            if gain > max(LEAST_GAIN * whole.total, SURE * np.hypot(whole.error, after.error)):
                useful.append((max(after.total, 0.0) * one.time, one))
    return min(useful, key=lambda pair: pair[0])[1] if useful else None


def _largest(bars: list[Bar], layer: str) -> list[Stage]:
    """Return the stages of the largest parts of the bars of a layer, the largest first."""
    shares: dict[str, tuple[float, Stage]] = {}
    for bar in bars:
        parts = [(p.split.total / bar.whole.total, p.stage) for p in bar.parts if p.stage and bar.layer == layer]
        for share, stage in sorted(parts, key=lambda pair: -pair[0])[:MOST_STAGES]:
            if share >= LEAST_SHARE and share > shares.get(stage.name, (0.0,))[0]:
                shares[stage.name] = (share, stage)
    return [stage for _, stage in sorted(shares.values(), key=lambda pair: -pair[0])]


def _is_same(study: Study, changed: Settings, frames: int) -> bool:
    """Return whether changed settings leave every bit of a picture as it is: they have no effect in this scene."""
    one = study.pictures(changed, frames, 1, keep=False)["full"][0]
    return np.array_equal(one, study.pictures(study.settings, frames)["full"][0])


def _error(study: Study, settings: Settings, layer: str, frames: int) -> Split:
    seeds = SEEDS_SINGLE if frames == 1 else SEEDS_STILL
    stacks = study.pictures(settings, frames, seeds, keep=False)
    return study.split(stacks[layer], layer, layer, study.truth(settings.bounces))
