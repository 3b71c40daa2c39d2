"""Ranks pictures by error and time: the best within a time, the trade-offs, and what another picture beats in both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rich.table import Table

from .results import Reference, SceneReport

LIMITS_MS = {100.0: "100 ms", 1000.0: "1 s"}
TRADE_OFF = "trade-off"  # no picture has less error in less time
ALIKE = 0.9  # of an error: a smaller gain is not worth more time
RESOLVED = 0.1  # of the noise of the truth: errors, less that noise, below this cannot be told apart


@dataclass(frozen=True)
class Point:
    """A picture that took `ms`: relMSE, less the noise of the truth, and bias of all its light.

    `samples` are the frames or paths that it averages, in words; `quality` is empty for the path tracer.
    """

    gi: str
    quality: str
    samples: str
    ms: float
    relmse: float
    bias: float

    @property
    def title(self) -> str:
        """Technique, quality and samples, in words."""
        return ", ".join(part for part in (self.gi, self.quality, self.samples) if part)


@dataclass(frozen=True)
class Row:
    """A picture and its verdict: what it is best at, TRADE_OFF, or not worth it, and why."""

    point: Point
    verdict: str


def points_of(scene: SceneReport, reference: Reference) -> list[Point]:
    """Return the pictures that a bench compared with one truth: single frames, still pictures, path-traced ones.

    A still picture takes as long as its frames with everything moving.
    """
    points = []
    for m in scene.techniques:
        ms = m.cases["all"].wall_ms.median
        quality = ", ".join(part for part in (m.quality, m.variant) if part)
        pictures = {1: m.errors["full"], m.settled_frames: m.settled["full"]}
        for frames, errors in pictures.items():
            if errors is not None and m.bounces == reference.bounces:
                points.append(Point(m.gi, quality, frames_text(frames), frames * ms, errors.relmse, errors.bias))
    for name, curve in (("path", reference.curve), ("path, denoised", reference.denoised)):
        for p in curve:
            full = p.errors["full"]
            if full is not None:
                points.append(Point(name, "", f"{p.spp} spp", p.wall_ms, full.relmse, full.bias))
    return points


def frames_text(frames: int) -> str:
    """Return a number of frames in words."""
    return f"{frames} frame{'s' * (frames != 1)}"


def ranked(points: Sequence[Point], noise: float = 0.0) -> list[Row]:
    """Return the points that no other beats in time and error, by time; then one of each other line, by error.

    `noise` is that of the truth, as relMSE. A line is a technique at one quality; of a beaten line without a point
    among the first, its least error stands for all.
    """
    floor = RESOLVED * noise
    # Find the front, and what is best within each time.
    front: list[Point] = []
    for point in sorted(points, key=lambda p: (p.ms, p.relmse)):
        if not front or max(point.relmse, floor) < ALIKE * max(front[-1].relmse, floor):
            front.append(point)
    titles: dict[Point, list[str]] = {}
    for limit, text in LIMITS_MS.items():
        within = [p for p in front if p.ms <= limit]
        if within:
            titles.setdefault(within[-1], []).append(text)
    rows = [Row(p, f"best within {' and '.join(titles[p])}" if p in titles else TRADE_OFF) for p in front]
    if front and front[-1] not in titles:
        rows[-1] = Row(front[-1], "least error")

    # Of every other line, name a picture that is both faster and nearer to the truth.
    beaten: dict[tuple[str, str], Point] = {}
    shown = {(p.gi, p.quality) for p in front}
    for point in sorted(points, key=lambda p: p.relmse):
        if (point.gi, point.quality) not in shown:
            beaten.setdefault((point.gi, point.quality), point)
    for point in beaten.values():
        better = [p for p in front if p.ms <= point.ms][-1]
        rows.append(Row(point, f"not worth it: {better.title} takes {ms_text(better.ms)}"))
    return rows


def ranking_table(rows: Sequence[Row], noise: float = 0.0) -> Table:
    """Return the rows as a table for the terminal; `noise` as for `ranked`."""
    floor = RESOLVED * noise
    table = Table(box=None, pad_edge=False, padding=(0, 3, 0, 0))
    for heading in ("technique", "quality", "picture"):
        table.add_column(heading, no_wrap=True)
    for heading in ("time", "relMSE", "bias"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("verdict")
    for row in rows:
        p = row.point
        error = f"{p.relmse:.2g}" if p.relmse > floor else f"< {floor:.1g}"
        table.add_row(p.gi, p.quality, p.samples, ms_text(p.ms), error, f"{p.bias:+.1%}", row.verdict)
    return table


def ms_text(ms: float) -> str:
    """Return milliseconds with two digits, in seconds from one second on."""
    if ms >= 1000.0:
        return f"{ms / 1000.0:.2g} s" if ms < 1e5 else f"{ms / 1000.0:.0f} s"
    return f"{ms:.2g} ms" if ms < 100.0 else f"{ms:.0f} ms"
