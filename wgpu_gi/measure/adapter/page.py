"""The page of a report: one HTML file with all tables, a column for each adapter. It fetches nothing."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template

from ...pictures.atomic_file import atomic_file
from ..compare_page import html_table
from .results import AdapterReport
from .tables import Grid, grids, left_out, titles


def save_page(path: str | Path, reports: Sequence[AdapterReport]) -> None:
    """Write the page. Raises GiError if the file cannot be written."""
    text = page(reports)
    with atomic_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def page(reports: Sequence[AdapterReport]) -> str:
    """Return the page as text."""
    template = files("wgpu_gi.measure.adapter").joinpath("page.html").read_text(encoding="utf-8")
    found = grids(reports)
    main = [grid for grid in found if not grid.title.startswith("Passes ")]
    passes = [grid for grid in found if grid.title.startswith("Passes ")]
    missing = left_out(reports)
    return Template(template).substitute(
        title=escape(", ".join(titles(reports))),
        verdict=escape("; ".join(map(verdict, reports))),
        tables="".join(map(_section, main)),
        passes="".join(
            f"<details><summary>{escape(g.title.removeprefix('Passes of '))}</summary>"
            f"<div class='scroll'>{html_table(g.rows)}</div></details>"
            for g in passes
        )
        or "<p>None was timed.</p>",
        left_out="".join(f"<p>{escape(sentence)}.</p>" for sentence in missing) or "<p>Nothing.</p>",
        details="".join(map(_details, reports)),
    )


def verdict(report: AdapterReport) -> str:
    """Return what the self-test says of an adapter."""
    name, failed = report.machine["adapter"], report.failed
    if not report.checks:
        return f"{name}: not checked"
    if not failed:
        return f"{name}: all {len(report.checks)} checks passed"
    names = ", ".join(check.name for check in failed)
    return f"{name}: {len(failed)} of {len(report.checks)} checks failed: {names}"


def _section(grid: Grid) -> str:
    """Return a table under its title."""
    return (
        f"<h2>{escape(grid.title)}</h2><p class='hint'>{escape(grid.hint)}</p>"
        f"<div class='scroll'>{html_table(grid.rows)}</div>"
    )


def _details(report: AdapterReport) -> str:
    """Return the features and the limits of an adapter, and the names of failed tests."""
    limits = ", ".join(f"{name} {value}" for name, value in sorted(report.limits.items()))
    failed = report.tests.names if report.tests is not None else []
    tests = f"<p>Failed tests: {escape(', '.join(failed))}</p>" if failed else ""
    return (
        f"<details><summary>{escape(str(report.machine['adapter']))}</summary>"
        f"<p>Features: {escape(', '.join(report.features))}</p><p>Limits: {escape(limits)}</p>{tests}</details>"
    )
