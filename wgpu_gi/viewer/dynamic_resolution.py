"""Dynamic resolution: chooses the share of the pixels with which a moving view renders in time.

Level n has 2^(-n/2) of the pixels. The model of a frame's time is fixed cost plus cost per pixel, so that a view whose
time is mostly fixed cost keeps its pixels.
"""

from __future__ import annotations

import math

STEP = 2**-0.5  # share of the pixels from level to level: two steps halve them
# Down to about a third of the width (0.35) the aim is 25 frames per second, the rate of television. Below that, pixels
# are worth more than smoothness, and the aim is 15 frames per second. The last level has an eighth of the width.
SMOOTH_SECONDS, SLOW_SECONDS = 1 / 25, 1 / 15
SLOW_LEVEL, LAST_LEVEL = 6, 12
# Shares of a frame's time that depend on its pixels. Above the first, a coarser level saves at least 0.3 (1 - STEP) =
# 9 % of the time; below the second, a finer level costs at most 4 %.
WORTH_COARSER, WORTH_FINER = 0.3, 0.1
MARGIN = 0.9  # limit on a finer level's expected time, as a share of the allowed time: without it levels alternate


class DynamicResolution:
    """`level` is the level of the next frame of a moving view; `note` receives the time of each frame."""

    def __init__(self, fps: float | None = None) -> None:
        """Aim at `fps` frames per second at every level, by default at 25 and at coarse levels at 15."""
        self.level = 0
        self._seconds = None if fps is None else 1.0 / fps
        self._before = 1.0, 0.0  # share of the pixels and seconds of a frame at the previous level
        self._last = math.inf  # seconds of the last frame at this level

    def note(self, seconds: float) -> None:
        """Choose the next level from the seconds that a frame took.

        Two frames must agree, since other work on the machine slows single ones.
        """
        self._last, last = seconds, self._last
        if last == math.inf:
            return
        seconds, slower = min(seconds, last), max(seconds, last)

        # Estimate the share of the time that depends on the pixels, from this level and the previous one.
        pixels, (pixels_before, seconds_before) = pixels_at(self.level), self._before
        share = 1.0
        if pixels_before != pixels:
            share = (seconds_before - seconds) / (pixels_before - pixels) * pixels / seconds

        # Go coarser if that helps, finer if that is in time or costs little.
        level = self.level
        if share > WORTH_COARSER:
            self.level = self._level_in_time(level, seconds)
        if level and (slower / STEP < MARGIN * self._allowed(level - 1) or share < WORTH_FINER):
            self.level = level - 1
        if self.level != level:
            self._before, self._last = (pixels, seconds), math.inf

    def note_rest(self, seconds: float) -> None:
        """Take the seconds of a frame at rest, with all pixels, so that the first frame of a move is in time."""
        needed = self._level_in_time(0, seconds)
        if needed > self.level:
            self.level, self._before, self._last = needed, (1.0, seconds), math.inf

    def _allowed(self, level: int) -> float:
        """Return the seconds that a frame may take at a level."""
        if self._seconds is not None:
            return self._seconds
        return SMOOTH_SECONDS if level < SLOW_LEVEL else SLOW_SECONDS

    def _level_in_time(self, level: int, seconds: float) -> int:
        """Return the first level, from `level` on, that is in time if a frame at `level` takes `seconds`."""
        while level < LAST_LEVEL and seconds > self._allowed(level):
            level, seconds = level + 1, seconds * STEP
        return level


def pixels_at(level: int) -> float:
    """Return the share of the pixels at a level."""
    return STEP**level
