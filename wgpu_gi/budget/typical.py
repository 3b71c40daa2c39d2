"""What a candidate costs and errs before it is measured: typical figures, scaled by what was measured of others.

Seconds are those of an adapter on which `wgpu_gi` was used before (`front_cache.py`), else of llvmpipe on two cores.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace

from .front import LEAST_FLOOR, LEAST_NOISE, Candidate, Figures

LEAST_SECONDS = 1e-5  # below: errors of clocks
# Standard deviations of logarithms over the 12 scenes of tools/README.md, "Budgets". A scene has a noise of its own,
# which candidates share: the noise of one over that of another varies less, that of a technique's qualities least.
SCENE_NOISE, SAME_NOISE, OTHER_NOISE = 1.6, 0.6, 1.2
SCENE_FLOOR, SAME_FLOOR = 1.8, 0.5  # floors of different techniques have nothing in common
PIXELS = 14400  # of the pictures whose seconds were measured

# Of llvmpipe on two cores. Noise and floor: medians of the curves that tools/try_budgets.py fits; a technique's floor
# hardly depends on its quality. The noise of many-light low is such that its error at equal time is 1.1 times that of
# medium, as the geometric mean of ten scenes is, each the mean of three seeds: blotches of few virtual lights are rare
# and large, and standard errors of few frames miss them. Seconds: of furnished rooms at 160x90, shared out as in the
# Cornell box at two sizes.
_MEDIANS = {
    Candidate("many-light", "low"): (0.5, 0.01, 0.016, 1.8e-6, 0.170, 0.0022),
    Candidate("many-light", "medium"): (0.6, 0.02, 0.036, 2.8e-6, 0.087, 0.0020),
    Candidate("many-light", "high"): (1.9, 0.15, 0.140, 5.0e-6, 0.060, 0.0018),
    Candidate("ssdo", "low"): (0.6, 0.01, 0.005, 1.0e-6, 0.15, 0.090),
    Candidate("ssdo", "medium"): (0.7, 0.02, 0.006, 1.4e-6, 0.087, 0.080),
    Candidate("ssdo", "high"): (1.0, 0.05, 0.010, 4.0e-6, 0.034, 0.080),
    Candidate("ssil", "low"): (0.5, 0.02, 0.010, 1.9e-6, 0.040, 0.17),
    Candidate("ssil", "medium"): (0.5, 0.02, 0.015, 2.6e-6, 0.032, 0.17),
    Candidate("ssil", "high"): (0.9, 0.10, 0.070, 7.5e-6, 0.020, 0.15),
    Candidate("none", "low"): (0.3, 0.005, 0.003, 0.7e-6, 0.010, 0.41),
    Candidate("none", "medium"): (0.3, 0.005, 0.003, 1.0e-6, 0.010, 0.41),
    Candidate("none", "high"): (0.3, 0.005, 0.005, 1.7e-6, 0.010, 0.41),
    Candidate("path", "medium"): (0.3, 0.005, 0.004, 2.5e-6, 3.0, LEAST_FLOOR),
}


def _spreads(candidate: Candidate) -> tuple[float, float]:
    """Return the spreads of noise and floor."""
    # Qualities other than medium were tuned against it, so they vary more. The path tracer has no floor.
    own = 0.0 if candidate == ("many-light", "medium") else SAME_NOISE
    return math.hypot(SCENE_NOISE, own), 0.0 if candidate.gi == "path" else SCENE_FLOOR


TYPICAL = {candidate: Figures(*medians, *_spreads(candidate)) for candidate, medians in _MEDIANS.items()}


def typical(candidate: Candidate) -> Figures:
    """Return the typical figures of a candidate; those of SSIL for a technique without."""
    return TYPICAL.get(candidate) or TYPICAL["ssil", candidate.quality]  # type: ignore[index]


def expected(
    wanted: Iterable[Candidate], known: Mapping[Candidate, Figures], used: Mapping[Candidate, Figures] | None = None
) -> dict[Candidate, Figures]:
    """Return the figures of each candidate: those `known`, else typical ones, scaled.

    Seconds and noise are scaled by the geometric mean of known over typical figures, floors by that of the same
    technique. A candidate of the same technique tells more than others, which count without one. used: seconds on this
    adapter in other scenes; they replace the typical ones.
    """
    used = used or {}
    usual = {c: _timed(c, typical(c), used) for c in {*wanted, *known}}
    return {c: known.get(c) or _scaled(c, usual, known) for c in wanted}


def _timed(candidate: Candidate, own: Figures, used: Mapping[Candidate, Figures]) -> Figures:
    """Return typical figures with the seconds of candidates `used` on this adapter."""
    if candidate in used:
        found = used[candidate]
        return replace(own, cold=found.cold, warm=found.warm, fixed=found.fixed, per_pixel=found.per_pixel)
    like = _like(candidate, used)
    scale = _mean_ratio((_seconds(used[c]), _seconds(typical(c))) for c in like)
    start = _mean_ratio((used[c].cold, typical(c).cold) for c in like)
    return _in_time(own, scale, start)


def _scaled(candidate: Candidate, usual: Mapping[Candidate, Figures], known: Mapping[Candidate, Figures]) -> Figures:
    own = usual[candidate]
    like = _like(candidate, known)
    if not like:
        return own
    scale = _mean_ratio((_seconds(known[c]), _seconds(usual[c])) for c in like)
    start = _mean_ratio((known[c].cold, usual[c].cold) for c in like)
    noise = _mean_ratio((max(known[c].noise, LEAST_NOISE), usual[c].noise) for c in like)
    is_same = like[0].gi == candidate.gi
    spread = sum(known[c].noise_spread for c in like) / len(like)
    # The noise of direct light is the same whatever the quality.
    shared = sum(known[c].shared for c in like) / len(like) if is_same else 0.0
    same = math.exp(sum(math.log(max(known[c].noise, LEAST_NOISE)) for c in like) / len(like))
    doubt = (1.0 - shared) * SAME_NOISE if is_same else OTHER_NOISE
    found = replace(
        _in_time(own, scale, start),
        noise=shared * same + (1.0 - shared) * own.noise * noise,
        noise_spread=min(math.hypot(spread, doubt), own.noise_spread),
        shared=shared,
    )
    if is_same and candidate.gi != "path":
        floor = _mean_ratio((max(known[c].floor, LEAST_FLOOR), usual[c].floor) for c in like)
        spread = sum(known[c].floor_spread for c in like) / len(like)
        found = replace(found, floor=own.floor * floor, floor_spread=min(math.hypot(spread, SAME_FLOOR), SCENE_FLOOR))
    return found


def _like(candidate: Candidate, known: Mapping[Candidate, Figures]) -> list[Candidate]:
    """Return the known candidates that tell about another: those of its technique, else all."""
    return [c for c in known if c.gi == candidate.gi] or list(known)


def _seconds(figures: Figures) -> float:
    return figures.frame_seconds(PIXELS)


def _in_time(figures: Figures, scale: float, start: float) -> Figures:
    """Return figures whose frames take `scale` times as long, and the start in a new process `start` times."""
    return replace(
        figures,
        cold=figures.cold * start,
        warm=figures.warm * scale,
        fixed=figures.fixed * scale,
        per_pixel=figures.per_pixel * scale,
    )


def _mean_ratio(pairs: Iterable[tuple[float, float]]) -> float:
    """Return the geometric mean of the ratios of pairs, 1 without any."""
    logs = [math.log(max(value, LEAST_SECONDS * LEAST_NOISE) / like) for value, like in pairs]
    return math.exp(sum(logs) / len(logs)) if logs else 1.0
