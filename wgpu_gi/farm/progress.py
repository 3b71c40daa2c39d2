"""The progress of a farm: frames done, frames per second, time left, and a table of the workers."""

from __future__ import annotations

import time
from collections import deque
from typing import NamedTuple

from ..pictures.tables import Table

WINDOW = 60.0  # seconds over which the rate is measured: it follows workers that come and go


class WorkerRow(NamedTuple):
    """What a worker has done: frames, the seconds that it took, and when it ended the last one (monotonic seconds)."""

    worker: str
    frames: int
    busy: float
    last: float


class FarmProgress:
    """Counts what workers have done of `total` frames."""

    def __init__(self, total: int = 0) -> None:
        self.total, self.done, self.failed = total, 0, 0
        self.rows: dict[str, WorkerRow] = {}
        self.start = time.monotonic()
        self._recent: deque[tuple[float, int]] = deque()  # when, and how many frames

    def add(self, worker: str, frames: int, seconds: float) -> None:
        """Note that a worker has done frames."""
        now = time.monotonic()
        row = self.rows.get(worker, WorkerRow(worker, 0, 0.0, now))
        self.rows[worker] = WorkerRow(worker, row.frames + frames, row.busy + seconds, now)
        self.done += frames
        self._recent.append((now, frames))

    @property
    def rate(self) -> float:
        """Frames per second over the last minute."""
        now = time.monotonic()
        while self._recent and now - self._recent[0][0] > WINDOW:
            self._recent.popleft()
        return sum(frames for _, frames in self._recent) / max(min(now - self.start, WINDOW), 1e-3)

    @property
    def fraction(self) -> float:
        """The part of the frames that is done or has failed."""
        return (self.done + self.failed) / max(self.total, 1)

    def line(self, what: str = "frames") -> str:
        """Return the progress in a line; `what` is counted."""
        rate = self.rate
        parts = [f"{self.done} of {self.total} {what}"]
        if rate:
            parts += [f"{rate:.3g} {what}/s", f"{_clock((self.total - self.done - self.failed) / rate)} left"]
        workers = len(self.rows)
        parts.append(f"{workers} {'worker' if workers == 1 else 'workers'}")
        return ", ".join(parts + ([f"{self.failed} failed"] if self.failed else []))

    def table(self, what: str = "frames") -> Table:
        """Return a row per worker: frames (or `what` is counted), their rate, share of the time in work, last one."""
        now = time.monotonic()
        past = max(now - self.start, 1e-3)
        cells = [
            (
                row.worker,
                str(row.frames),
                f"{row.frames / row.busy:.3g}" if row.busy else "",
                f"{min(row.busy / past, 1.0):.0%}",
                f"{_clock(now - row.last)} ago",
            )
            for row in sorted(self.rows.values())
        ]
        head = ("worker", what, f"{what}/s", "busy", "last")
        widths = [max(map(len, column)) for column in zip(head, *cells, strict=True)]
        lines = [
            "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in (head, *cells)
        ]
        return Table("\n".join(line.rstrip() for line in lines), head, cells)


def _clock(seconds: float) -> str:
    """Return seconds as 0:05, 12:30 or 3 h 07 min."""
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes // 60} h {minutes % 60:02} min" if minutes >= 60 else f"{minutes}:{rest:02}"
