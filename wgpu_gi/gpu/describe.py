"""The plan: which passes ran, which were kept or culled, and why, with times and sizes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from .passes import Pass

if TYPE_CHECKING:
    from .graph import Graph


@dataclass(frozen=True)
class Row:
    """A pass in the plan: `state` is ran, kept or culled, `ms` the median of its runs, `bytes` of what it writes."""

    name: str
    state: str
    reason: str
    ms: float | None
    bytes: int


def plan(graph: Graph) -> list[Row]:
    """Describe what each pass did in the last run of the graph, in the order of declaration."""
    rows = []
    for p in graph.passes.values():
        if not p.active:
            state, reason = "culled", p.culled_because or "the graph is not compiled"
        elif p.name in graph.last_run:
            state, reason = "ran", graph.last_run[p.name]
        else:
            state, reason = "kept", f"inputs unchanged: {', '.join(_inputs(p)) or 'it has none'}"
        rows.append(Row(p.name, state, reason, graph.timing.median(p.name), p.bytes if p.active else 0))
    return rows


def _inputs(p: Pass) -> list[str]:
    """Return the names of all that could make a pass stale."""
    names = ["params"] * (p.params is not None)
    names += [uniform.name for _, uniform in p.uniforms]
    names += [use.view.resource.name for use in p.uses if not use.writes and not use.view.previous]
    return list(dict.fromkeys(names))


def table(rows: list[Row]) -> str:
    """Format a plan as text: a summary, then a line per pass."""
    counts = [f"{state} {sum(r.state == state for r in rows)}" for state in ("ran", "kept", "culled")]
    width = max((len(r.name) for r in rows), default=0)
    lines = [", ".join(counts)]
    for r in rows:
        ms = "" if r.ms is None else f"{r.ms:.2f} ms"
        size = f"{r.bytes / 2**20:.2f} MiB" if r.bytes else ""
        lines.append(f"{r.name:<{width}}  {r.state:<6} {ms:>11} {size:>12}  {r.reason}".rstrip())
    return "\n".join(lines)
