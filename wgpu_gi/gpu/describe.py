"""The plan: which passes ran, were kept or were culled, and why, with times and sizes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ..pictures.tables import Table
from .passes import Pass
from .schedule import Skipped, Stale, Work
from .timing import Timing

UNSEEN = "nothing to the buffers shown"


@dataclass(frozen=True)
class Row:
    """A pass in the plan: `state` is ran, kept or culled; `bytes` is the size of what it writes.

    `ms` is the median of its measured runs, `p95` their 95th percentile. `bound`: what a culled pass could add at most.
    """

    name: str
    state: str
    reason: str
    ms: float | None
    p95: float | None
    bytes: int
    bound: str = ""


def plan(
    planned: Mapping[str, Pass | Work | Skipped],
    last_run: Mapping[str, Stale],
    timing: Timing,
    shares: Mapping[str, str],
    *,
    bounds: bool,
) -> list[Row]:
    """Describe what each declared pass did in a run, in the order of declaration.

    `planned` maps each name to what was declared, or skipped; `last_run` holds why each of them ran;
    `shares` has texts of `share`. bounds: also compute bounds that take long.
    """
    return [
        _row(name, what, last_run.get(name), timing, shares.get(name, ""), bounds) for name, what in planned.items()
    ]


def share(part: int, whole: int, of: str) -> str:
    """Describe a share: "64 % of 7,200 directions"."""
    return f"{part / max(whole, 1):.0%} of {whole:,} {of}".replace("%", " %")


def _row(
    name: str, what: Pass | Work | Skipped, stale: Stale | None, timing: Timing, share_of_work: str, bounds: bool
) -> Row:
    if isinstance(what, Skipped):
        bound = what.bound if isinstance(what.bound, str) else what.bound() if bounds else ""
        return Row(name, "culled", what.reason, None, None, 0, bound)
    if isinstance(what, Work):
        state, reason = ("kept", "inputs unchanged") if stale is None else ("ran", stale.reason)
        return Row(name, state, reason, timing.median(name), timing.p95(name), 0)
    if not what.active:
        return Row(name, "culled", what.culled_because or "the graph is not compiled", None, None, 0, UNSEEN)
    if stale is not None:
        state, reason = "ran", stale.reason
    else:
        state, reason = "kept", f"inputs unchanged: {', '.join(_inputs(what)) or 'it has none'}"
    if share_of_work:
        reason = f"{share_of_work}; {reason}"
    return Row(name, state, reason, timing.median(name), timing.p95(name), what.bytes)


def _inputs(p: Pass) -> list[str]:
    """Return the names of the inputs that can make a pass stale."""
    names = ["params"] * (p.params is not None)
    names += [uniform.name for _, uniform in p.uniforms]
    names += [use.view.resource.name for use in p.uses if not use.writes and not use.view.previous]
    return list(dict.fromkeys(names))


def table(rows: list[Row]) -> Table:
    """Format a plan as text: a summary, then a line per pass."""
    counts = [f"{state} {sum(r.state == state for r in rows)}" for state in ("ran", "kept", "culled")]
    why = ", ".join(dict.fromkeys(r.reason for r in rows if r.state == "culled"))
    width = max((len(r.name) for r in rows), default=0)
    lines = [", ".join(counts) + (f": {why}" if why else "")]
    cells = []
    for r in rows:
        ms = "" if r.ms is None else f"{r.ms:.2f} ms"
        p95 = "" if r.p95 is None else f"p95 {r.p95:.2f}"
        size = f"{r.bytes / 2**20:.2f} MiB" if r.bytes else ""
        adds = f"; would add {r.bound}" if r.bound else ""
        lines.append(f"{r.name:<{width}}  {r.state:<6} {ms:>11} {p95:>12} {size:>12}  {r.reason}{adds}".rstrip())
        cells.append((r.name, r.state, ms, p95, size, r.reason, r.bound))
    return Table("\n".join(lines), ("pass", "state", "time", "", "memory", "why", "would add"), cells)
