"""The tables of one report, or of several side by side: for the terminal, for the page, and as Markdown.

A column is a report, a row a number. Times of two adapters can be compared; times of one adapter under different load
cannot.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from .results import AdapterReport, PassTimes

MISSING = "-"
SHOWN_LIMITS = (
    "max-texture-dimension-2d",
    "max-buffer-size",
    "max-storage-buffer-binding-size",
    "max-storage-buffers-per-shader-stage",
    "max-compute-workgroup-storage-size",
    "max-compute-invocations-per-workgroup",
)


@dataclass(frozen=True)
class Grid:
    """A table: its title, a sentence on what it holds, and rows of cells, of which the first is the header."""

    title: str
    hint: str
    rows: list[list[str]]


def grids(reports: Sequence[AdapterReport], passes: bool = True) -> list[Grid]:
    """Return all tables with a column for each report; `passes`: with the times of single passes."""
    found = [_adapters(reports), _checks(reports), _errors(reports), _frames(reports), _rays(reports), _builds(reports)]
    found += [_threads(reports)]
    if passes:
        found += _passes(reports)
    return [grid for grid in found if len(grid.rows) > 1]


def markdown(grids: Iterable[Grid]) -> str:
    """Return tables as Markdown."""
    parts = []
    for grid in grids:
        header, *rows = grid.rows
        lines = [_line(header), _line(["---", *["---:"] * (len(header) - 1)]), *map(_line, rows)]
        parts.append("\n".join([f"**{grid.title}.** {grid.hint}", "", *lines]))
    return "\n\n".join(parts) + "\n"


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def titles(reports: Sequence[AdapterReport]) -> list[str]:
    """Return the name of each report: the adapter, and its driver where an adapter occurs twice."""
    names = [str(r.machine["adapter"]) for r in reports]
    drivers = [f"{name}, {r.machine.get('driver')}" for name, r in zip(names, reports, strict=True)]
    return [d if names.count(n) > 1 else n for n, d in zip(names, drivers, strict=True)]


def _rows(
    reports: Sequence[AdapterReport], records: Callable[[AdapterReport], dict[str, str]], corner: str = ""
) -> list[list[str]]:
    """Return a row for each name in any report, in order; a missing value is a dash."""
    cells = [records(report) for report in reports]
    names = dict.fromkeys(name for column in cells for name in column)
    header = [corner, *titles(reports)]
    return [header, *([name, *(column.get(name, MISSING) for column in cells)] for name in names)]


def _adapters(reports: Sequence[AdapterReport]) -> Grid:
    def cells(r: AdapterReport) -> dict[str, str]:
        here = r.machine
        stamps = [f"{t.kind} {'right' if t.right else 'wrong'}" for t in r.timestamps]
        tests = MISSING
        if r.tests is not None:
            end = "" if r.tests.finished else ", not finished"
            tests = f"{r.tests.passed} passed, {r.tests.failed} failed, {r.tests.skipped} skipped{end}"
        return {
            "driver": str(here.get("driver")),
            "backend": str(here.get("backend")),
            "kind": "CPU" if here.get("is_cpu") else "GPU",
            "system": str(here.get("os")),
            "cores": str(here.get("cores")),
            "wgpu_gi": str(here.get("packages", {}).get("wgpu_gi")),
            "features": str(len(r.features)),
            **{name: f"{r.limits[name]}" for name in SHOWN_LIMITS if name in r.limits},
            "needs a newer driver": "; ".join(r.needs_newer_driver) or "nothing",
            "times are": str(here.get("clock")),
            "timestamps": ", ".join(stamps) or MISSING,
            "self-test": f"{len(r.checks) - len(r.failed)} of {len(r.checks)} passed" if r.checks else MISSING,
            "shader tests of the checkout": tests,
            "memory of the process, at most": MISSING if r.memory is None else f"{r.memory / 2**20:.0f} MiB",
            "time of the report": f"{r.seconds:.0f} s",
            "left out": str(len(r.left_out)) if r.left_out else "nothing",
        }

    return Grid("Adapters", "What each report was measured on.", _rows(reports, cells))


def _checks(reports: Sequence[AdapterReport]) -> Grid:
    def cells(r: AdapterReport) -> dict[str, str]:
        found = {}
        for check in r.checks:
            value = check.note or (MISSING if check.deviation is None else f"{check.deviation:.2g}")
            found[f"{check.group}: {check.name} (bound {check.bound:.2g})"] = (
                value if check.passed else f"FAILED: {value}"
            )
        return found

    hint = "Deviation from a closed form; it passes up to the bound. Counts of wrong values where the bound is 0."
    return Grid("Self-test", hint, _rows(reports, cells, "check"))


def _errors(reports: Sequence[AdapterReport]) -> Grid:
    def cells(r: AdapterReport) -> dict[str, str]:
        return {
            f"{e.scene}: {e.technique}": f"{e.relmse:.2g} / {e.bias:+.1%}; {e.still_relmse:.2g} / {e.still_bias:+.1%}"
            for e in r.errors
        }

    hint = (
        "relMSE / bias against Mitsuba 3 at 128x72, medium quality, Lambert: one frame; the still picture. SSDO is"
        " compared with one bounce, the others with all."
    )
    return Grid("Errors", hint, _rows(reports, cells, "scene: technique"))


def _frames(reports: Sequence[AdapterReport]) -> Grid:
    def cells(r: AdapterReport) -> dict[str, str]:
        return {
            f"{scene.scene}: {t.technique}": _frame(t) + f", {t.bytes / 2**20:.0f} MiB"
            for scene in r.scenes
            for t in scene.techniques
        }

    sizes = {scene.size for r in reports for scene in r.scenes}
    size = ", ".join(f"{width}x{height}" for width, height in sorted(sizes))
    hint = (
        f"Milliseconds at {size}, the camera moves and every pass runs: sum of the passes / a whole frame; memory of"
        " the technique."
    )
    return Grid("Frames", hint, _rows(reports, cells, "scene: technique"))


def _frame(t: PassTimes) -> str:
    return f"{_ms(t.passes_ms)} / {_ms(t.frame_ms)}"


def _rays(reports: Sequence[AdapterReport]) -> Grid:
    def cells(r: AdapterReport) -> dict[str, str]:
        return {f"{x.scene}, {x.triangles:,} triangles: {x.kind}": _rate(x.per_second) for x in r.rays}

    hint = "Per second. camera: first hits of pixels; bounce: first hits by the cosine; shadow: any hit between points."
    return Grid("Rays", hint, _rows(reports, cells, "scene: rays"))


def _builds(reports: Sequence[AdapterReport]) -> Grid:
    def cells(r: AdapterReport) -> dict[str, str]:
        found = {}
        for b in r.builds:
            name = f"{b.scene}, {b.triangles:,} triangles"
            found[f"{name}: to the device"] = f"{_ms(b.ms)}, {b.bytes / 2**20:.0f} MiB"
            found[f"{name}: hierarchy and triangles again"] = _ms(b.geometry_ms)
            found[f"{name}: an instance moved"] = _ms(b.moved_ms)
        return found

    hint = "Milliseconds until the scene is on the device, with its hierarchy."
    return Grid("Scene and hierarchy", hint, _rows(reports, cells, "scene: step"))


def _threads(reports: Sequence[AdapterReport]) -> Grid:
    def cells(r: AdapterReport) -> dict[str, str]:
        return {t.technique: f"{t.ms:.2f}, {t.passes} passes" for t in r.threads}

    hint = "Milliseconds of the main thread in a frame in which the camera moves (64x36, Cornell), passes it records."
    return Grid("Main thread", hint, _rows(reports, cells, "technique"))


def _passes(reports: Sequence[AdapterReport]) -> list[Grid]:
    """Return a table for each scene and technique, with its passes."""
    keys = dict.fromkeys((scene.scene, t.technique) for r in reports for scene in r.scenes for t in scene.techniques)
    found = []
    for scene, technique in keys:

        def cells(r: AdapterReport, key: tuple[str, str] = (scene, technique)) -> dict[str, str]:
            matching = [t for s in r.scenes for t in s.techniques if (s.scene, t.technique) == key]
            return {name: _ms(ms) for t in matching for name, ms in {**t.passes, "sum": t.passes_ms}.items()}

        found.append(Grid(f"Passes of {technique} in {scene}", "Milliseconds.", _rows(reports, cells, "pass")))
    return found


def left_out(reports: Sequence[AdapterReport]) -> list[str]:
    """Return a sentence for all that was left out, with the adapter if there are several reports."""
    named: Any = zip(titles(reports), reports, strict=True)
    prefix = len(reports) > 1
    return [f"{name}: {sentence}" if prefix else sentence for name, r in named for sentence in r.left_out]


def _ms(ms: float) -> str:
    return f"{ms:.3f}" if ms < 1 else f"{ms:.2f}" if ms < 10 else f"{ms:.1f}" if ms < 100 else f"{ms:.0f}"


def _rate(per_second: float) -> str:
    return f"{per_second / 1e6:.3g} million" if per_second < 1e9 else f"{per_second / 1e9:.3g} billion"
