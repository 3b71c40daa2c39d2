"""The time of a report: what does not fit, or fails, is left out, with a sentence."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from ...errors import GiError


class Budget:
    """Counts down from `seconds`; `left_out` collects what did not fit. `report` shows the progress."""

    def __init__(self, seconds: float, report: Callable[[float, str], None] | None = None) -> None:
        self._started, self.seconds = time.perf_counter(), seconds
        self._report = report or (lambda fraction, what: None)
        self.left_out: list[str] = []

    @property
    def spent(self) -> float:
        """Seconds since the start."""
        return time.perf_counter() - self._started

    @property
    def left(self) -> float:
        """Seconds that are left; negative after the end."""
        return self.seconds - self.spent

    def show(self, what: str) -> None:
        """Show what is being done."""
        self._report(min(1.0, self.spent / max(self.seconds, 1e-9)), what)

    def allows(self, what: str, seconds: float = 0.0) -> bool:
        """Return whether a step of `seconds` fits, and show it; if not, note that it was left out."""
        left = self.left
        if left > seconds:
            self.show(what)
            return True
        why = f"it takes about {seconds:.0f} s, and {max(left, 0):.0f} s were left" if left > 0 else "the time was over"
        self.left_out.append(f"{what}: {why}")
        return False

    @contextmanager
    def noting(self, what: str) -> Iterator[None]:
        """Note that a step was left out if it raises GiError, and go on: a report on a faulty driver tells the most."""
        try:
            yield
        except GiError as error:
            self.left_out.append(f"{what}: {error}")
