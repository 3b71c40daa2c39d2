"""What long steps report: the fraction done, and the name of the current step."""

from __future__ import annotations

from typing import Protocol


class Report(Protocol):
    """Takes the fraction done, 0 to 1, and optionally the name of the current step."""

    def __call__(self, fraction: float, what: str | None = None, /) -> None:
        """Show the progress."""
