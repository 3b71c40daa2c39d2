"""What became of a budget, in words: what was rendered, why it ended, and what each candidate was expected to reach."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass

from ..options import Settings
from ..pictures.tables import Table
from .certificate import Certificate
from .choice import LEAST_CHANCE, Choice
from .frame_series import words_of
from .front import Candidate, Figures

HEAD = ("candidate", "s to start", "ms a frame", "frames", "relMSE", "figures")


@dataclass(frozen=True)
class Outcome:
    """What was rendered, and why it ended. The renderer has the picture.

    seconds: from the call, without those of the certificate if only the time was given. estimated_relmse: floor plus
    noise. traced_seconds, start_seconds: parts of `seconds`, for traced pixels; and until the chosen candidate's first
    frame, 0 if it had its pipelines. missed: words on a better candidate that had to compile for too long. table: what
    each candidate was expected to reach.
    """

    settings: Settings
    candidate: Candidate
    frames: int
    seconds: float
    estimated_relmse: float
    certificate: Certificate | None
    reason: str
    traced_seconds: float
    start_seconds: float
    missed: str
    table: Table

    def sentence(self) -> str:
        """Return what was chosen, what it reached, and why it stopped."""
        parts = ((self.traced_seconds, "to measure the bias"), (self.start_seconds, "to compile and to start"))
        told = "".join(f", {seconds:.2g} s of them {what}" for seconds, what in parts if seconds)
        missed = f"; {self.missed}" if self.missed else ""
        return (
            f"{words_of(self.candidate, self.frames)} in {self.seconds:.2f} s{told}; expected relMSE"
            f" {self.estimated_relmse:.2g}{missed}; {self.reason}"
        )


def missed_words(better: Choice, start: float) -> str:
    """Return words on a candidate that would be better, but for the `start` seconds that it is expected to compile."""
    return f"{better.candidate} would reach {better.relmse:.2g}, but would compile for about {start:.2g} s first"


def time_words(choice: Choice, error: float) -> str:
    """Return words on how long a picture that has begun still takes to an error."""
    if choice.chance < LEAST_CHANCE or choice.seconds == math.inf:
        return f"relMSE {error:g} is out of its reach"
    seconds = choice.seconds
    unit, size = next((unit, size) for unit, size in (("h", 3600.0), ("min", 60.0), ("s", 0.0)) if seconds >= size)
    return f"about {seconds / max(size, 1.0):.2g} {unit} more to relMSE {error:g}"


def table_of(
    figures: Mapping[Candidate, Figures],
    reached: Iterable[Choice],
    chosen: Candidate,
    rendered_before: Collection[Candidate],
    pixels: int,
) -> Table:
    """Return what each candidate was expected to reach in the whole time, the least error first."""
    rows = []
    for choice in sorted(reached, key=lambda choice: choice.score):
        c, frames, relmse = choice.candidate, choice.frames, choice.relmse
        f = figures[c]
        rows.append(
            (
                f"{'> ' if c == chosen else ''}{c}",
                f"{f.warm if c in rendered_before else f.cold:.2f}",
                f"{1e3 * f.frame_seconds(pixels):.1f}",
                str(frames),
                f"{relmse:.2g}",
                "measured" if f.measured else "expected",
            )
        )
    return Table("\n".join("".join(f"{cell:<22}" for cell in row).rstrip() for row in (HEAD, *rows)), HEAD, rows)
