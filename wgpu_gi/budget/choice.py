"""Chooses a candidate: what each reaches in a time, or takes to an error, and which is worth starting over for.

Candidates are compared by the mean of the logarithm of relMSE, plus a share of its standard deviation.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping
from typing import NamedTuple

from ..techniques.shared.sampling import OPEN_FRAMES
from .front import OPEN_SPP, ROOM, Candidate, Figures, averages_samples
from .typical import SAME_NOISE

# Standard deviations of the logarithm of relMSE that a choice counts as an error: what is known beats what is hoped.
CAUTION = 0.5
LEAST_CHANCE = 0.05  # of meeting an error, to count on it
# Another candidate replaces one that has begun if it is expected to leave at most this share of its error in what is
# left of the time, or to need at most this share of its time.
WORTH_SWITCHING = 0.95


class Choice(NamedTuple):
    """A candidate with what is expected of it: frames, seconds, relMSE.

    doubt: the standard deviation of the logarithm of the relMSE. chance: the probability that more frames reach the
    error that was asked for, 0 if none was, or if they do not fit into the time.
    """

    candidate: Candidate
    frames: int
    seconds: float
    relmse: float
    doubt: float = 0.0
    chance: float = 0.0

    @property
    def score(self) -> float:
        """What candidates are compared by: the logarithm of a relMSE that it likely stays below."""
        return math.log(self.relmse) + CAUTION * self.doubt


def within(
    candidate: Candidate,
    figures: Figures,
    pixels: int,
    seconds: float | None,
    error: float | None,
    *,
    is_warm: bool,
    done: int = 0,
) -> Choice:
    """Return what a candidate reaches within `seconds`, or what it takes to reach `error`, whichever comes first.

    It renders at least one frame. With `done` frames, it has begun: `seconds` are those left, and those of the choice,
    for further ones. An error that it cannot reach takes infinitely long.
    """
    start, frame = figures.warm if is_warm else figures.cold, figures.frame_seconds(pixels)
    if done:
        start = 0.0
    most = OPEN_SPP if averages_samples(candidate) else OPEN_FRAMES
    frames = math.inf if seconds is None else max(math.floor((seconds - start) / frame), 0 if done else 1)
    chance = 0.0
    if error is not None:
        needed = math.ceil(figures.noise / (error - min(figures.floor, ROOM * error))) - done
        chance = figures.chance(error) if needed <= min(frames, most) else 0.0
        if chance >= LEAST_CHANCE:
            frames = min(frames, max(needed, 0 if done else 1))
    count = int(min(frames, most))
    taken = start + (count if frames < math.inf else math.inf) * frame
    mean, doubt = figures.log_relmse(done + count)
    return Choice(candidate, done + count, taken, math.exp(mean), doubt, chance)


def cost(choice: Choice, choices: Iterable[Choice]) -> float:
    """Return the seconds until the error is expected to be met if a choice comes first; infinite if never.

    If it fails, the fastest follows that surely meets it.
    """
    if choice.chance < LEAST_CHANCE:
        return math.inf
    sure = min((c.seconds for c in choices if c.chance > 1.0 - LEAST_CHANCE), default=math.inf)
    if sure == math.inf:
        return choice.seconds / choice.chance
    return choice.seconds + (1.0 - choice.chance) * sure


def best(
    choices: Iterable[Choice], seconds: float | None, score: Callable[[Choice], float] = lambda choice: choice.score
) -> Choice:
    """Return the choice that is expected to meet the error first; if none is, that with the least score in time."""
    every = list(choices)

    def rank(choice: Choice) -> tuple[float, ...]:
        late = max(choice.seconds - seconds, 0.0) if seconds is not None else 0.0
        needed = cost(choice, every)
        return (late, 0.0, needed) if needed < math.inf else (late, 1.0, score(choice))

    return min(every, key=rank)


def rival(
    choices: Mapping[Candidate, Choice],
    begun: Candidate,
    left: float | None,
    refuted: Collection[Candidate],
    shared: float,
) -> Candidate | None:
    """Return a candidate that is worth starting over for instead of the one that has begun; None if there is none.

    left: seconds. refuted: candidates that cannot meet the error. shared: see `Figures`, of the one that has begun.
    """
    own = choices[begun]
    others = [choice for c, choice in choices.items() if c != begun and c not in refuted]
    if not others:
        return None

    def score(other: Choice) -> float:
        # Another quality of the same technique shares the doubt of this one.
        if other.candidate.gi != begun.gi:
            return other.score
        return math.log(other.relmse) + CAUTION * (own.doubt + (1.0 - shared) * SAME_NOISE)

    other = best(others, left, score)
    needed = cost(other, choices.values())
    if needed < math.inf:
        better = needed < WORTH_SWITCHING * cost(own, choices.values())
    else:
        better = own.chance < LEAST_CHANCE and score(other) < own.score + math.log(WORTH_SWITCHING)
    # Another one must be in time.
    better &= left is None or other.seconds <= left
    return other.candidate if better else None
