"""How many pixels a view has while it moves: as many as the adapter renders in time."""

from __future__ import annotations

import math

SMOOTH_SECONDS = 1 / 25  # of a frame while the camera moves, as long as that leaves a third of the width: chosen
FRAME_SECONDS = 1 / 15  # with fewer pixels: chosen
STEP = 2**-0.5  # pixels of a coarseness over those of the one before: chosen
THIRD, COARSEST = 6, 12  # coarseness of 0.35 of the width, and the most, an eighth: chosen
WORTH_COARSER, WORTH_FINER = 0.3, 0.1  # shares of a frame's time that its pixels take: chosen
ROOM = 0.9  # share of the time that a finer frame may be expected to take: chosen


class Pace:
    """`coarseness` is what the next frame of a moving view should have; tell it how long each took."""

    def __init__(self) -> None:
        self.coarseness = 0  # steps of fewer pixels
        self._before = 1.0, 0.0  # share of the pixels, and time of a frame, before `coarseness` changed
        self._last = math.inf  # seconds that the frame before took, with as many pixels

    def note(self, seconds: float) -> None:
        """Choose how many pixels the next frame has while moving, from how long one took.

        Two frames must agree, as other work on the machine makes single ones slow. What a frame takes besides its
        pixels, fewer of them do not make shorter: then there may as well be more.
        """
        self._last, last = seconds, self._last
        if last == math.inf:
            return
        seconds, slower = min(seconds, last), max(seconds, last)
        pixels, (pixels_before, seconds_before) = pixels_at(self.coarseness), self._before
        share = 1.0  # of the time that is for pixels
        if pixels_before != pixels:
            share = (seconds_before - seconds) / (pixels_before - pixels) * pixels / seconds
        coarseness = self.coarseness
        if share > WORTH_COARSER:
            self.coarseness = _coarser(coarseness, seconds)
        if coarseness and (slower / STEP < ROOM * _limit(coarseness - 1) or share < WORTH_FINER):
            self.coarseness = coarseness - 1
        if self.coarseness != coarseness:
            self._before, self._last = (pixels, seconds), math.inf

    def note_rest(self, seconds: float) -> None:
        """Learn from a frame at rest, with all pixels, so that the first frame of a move is not a slow one."""
        needed = _coarser(0, seconds)
        if needed > self.coarseness:
            self.coarseness, self._before, self._last = needed, (1.0, seconds), math.inf


def pixels_at(coarseness: int) -> float:
    """Return the share of the pixels."""
    return STEP**coarseness


def _limit(coarseness: int) -> float:
    """Return the seconds that a frame may take while moving: a third of the width is not given for smoothness."""
    return SMOOTH_SECONDS if coarseness < THIRD else FRAME_SECONDS


def _coarser(coarseness: int, seconds: float) -> int:
    """Return the coarseness, at least as much, with which a frame that took `seconds` is in time."""
    while coarseness < COARSEST and seconds > _limit(coarseness):
        coarseness, seconds = coarseness + 1, seconds * STEP
    return coarseness
