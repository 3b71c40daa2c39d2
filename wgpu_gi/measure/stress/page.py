"""The page of a stress run: one HTML file with tables of failures, errors and times, and the failures in pictures."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template

import numpy as np
from numpy.typing import NDArray

from ...pictures.atomic_file import atomic_file
from ...pictures.color import REC709_LUMINANCE, srgb_from_linear
from ..compare_page import DIVERGING, colored, html_table, png_uri
from .checks import SENTENCES
from .findings import Picture
from .results import Failure, Record, Report, summary

GREY = 0.18  # displayed mean luminance of the expected picture
LAYERS = ("direct", "indirect")


def save_page(path: str | Path, report: Report) -> None:
    """Write the page. Raises GiError if the file cannot be written."""
    text = page(report)
    with atomic_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def page(report: Report) -> str:
    """Return the page as text."""
    template = files("wgpu_gi.measure.stress").joinpath("page.html").read_text(encoding="utf-8")
    return Template(template).substitute(
        verdict=escape(verdict(report)),
        summary=escape(summary_text(report)),
        classes=_table(class_rows(report)),
        errors=_table(error_rows(report)),
        worst="".join(_worst(report)) or "<p>None.</p>",
        times=_table(time_rows(report)),
        checks=_table(check_rows(report)),
        failures="".join(map(_section, report.failures)) or "<p>None.</p>",
    )


def verdict(report: Report) -> str:
    """Return the number of failures in words."""
    count = len(report.failed)
    end = ", interrupted" if report.interrupted else ""
    return f"{count or 'no'} failure{'s' * (count != 1)} in {len(report.records)} cases{end}"


def summary_text(report: Report) -> str:
    """Return size, time and machine."""
    scenes = {(r.case.kind, r.case.seed) for r in report.records}
    here = report.machine
    minutes = report.seconds / 60
    return (
        f"{len(scenes)} scenes at {report.size[0]}x{report.size[1]} in {minutes:.1f} minutes, on {here.get('adapter')},"
        f" {here.get('driver')}, {here.get('cores')} cores"
    )


def class_rows(report: Report) -> list[list[str]]:
    """Return a row for each class of failure, check and technique, most frequent first."""
    groups: dict[tuple[str, str, str], list[Record]] = defaultdict(list)
    for record in report.failed:
        groups[record.failure, record.case.check, record.case.gi].append(record)
    rows = [["class", "check", "technique", "failures", "kinds", "first"]]
    for (failure, check, gi), records in sorted(groups.items(), key=lambda item: -len(item[1])):
        kinds = ", ".join(f"{count} {kind}" for kind, count in Counter(r.case.kind for r in records).most_common())
        first = records[0].case
        rows.append([failure, check, gi, str(len(records)), kinds, f"{first.kind} {first.seed}"])
    return rows


def error_rows(report: Report) -> list[list[str]]:
    """Return bias and relMSE by technique, preset and kind: median, 95th percentile, worst and its scene."""
    groups: dict[tuple[str, str, str], list[Record]] = defaultdict(list)
    for record in report.records:
        if record.case.check == "truth":
            for kind in (record.case.kind, "all"):
                groups[record.case.gi, record.case.quality, kind].append(record)
    rows = [
        ["technique", "preset", "kind", "light", "scenes", "bias", "95 %", "worst", "relMSE", "95 %", "worst", "in"]
    ]
    for (gi, quality, kind), records in sorted(groups.items()):
        for layer in LAYERS:
            found = [r for r in records if f"{layer} bias" in r.numbers]
            if not found:
                continue
            bias = summary([r.numbers[f"{layer} bias"] for r in found])
            relmse = summary([r.numbers[f"{layer} relmse"] for r in found])
            worst = max(found, key=lambda r: abs(r.numbers[f"{layer} relmse"])).case
            cells = [f"{value:.1%}" for value in bias] + [f"{value:.2g}" for value in relmse]
            rows.append([gi, quality, kind, layer, str(len(found)), *cells, f"{worst.kind} {worst.seed}"])
    return rows


def time_rows(report: Report) -> list[list[str]]:
    """Return the times of pictures by technique."""
    rows = [["technique", "picture", "count", "median", "95 %", "worst"]]
    for gi, times in report.times.items():
        for name, values in times.items():
            rows.append([gi, name, str(len(values)), *(f"{value:.0f}" for value in summary(values))])
    return rows


def check_rows(report: Report) -> list[list[str]]:
    """Return how often each check passed, failed and did not apply, and its median time."""
    groups: dict[str, list[Record]] = defaultdict(list)
    for record in report.records:
        groups[record.case.check].append(record)
    rows = [["check", "passed", "failed", "skipped", "median s", "what"]]
    for name, records in groups.items():
        counts = Counter(r.verdict for r in records)
        seconds = summary([r.seconds for r in records if r.verdict != "skipped"])[0]
        numbers = [str(counts[v]) for v in ("passed", "failed", "skipped")]
        rows.append([name, *numbers, f"{seconds:.2f}", SENTENCES.get(name, "")])
    return rows


def _table(rows: list[list[str]]) -> str:
    return html_table(rows) if len(rows) > 1 else "<p>None.</p>"


def _section(failure: Failure) -> str:
    case = failure.record.case
    title = f"{case.check}: {failure.record.failure} · {case.gi} · {case.kind} {case.seed}"
    return (
        f"<section><h3>{escape(title)}</h3><p>{escape(failure.record.sentence)}.</p>"
        f"<p class='hint'>reduced to {escape(failure.reduced)}</p><p><code>{escape(failure.command)}</code></p>"
        f"<div class='pictures'>{''.join(_figures(failure.got, failure.expected))}</div></section>"
    )


def _worst(report: Report) -> Iterable[str]:
    for (gi, quality, layer), worst in sorted(report.worst.items()):
        case, numbers = worst.record.case, worst.record.numbers
        errors = f"relMSE {numbers[f'{layer} relmse']:.2g}, bias {numbers[f'{layer} bias']:+.1%}"
        title = f"{layer} light of {gi}, {quality}: {case.kind} {case.seed}, {errors}"
        yield f"<p>{escape(title)}</p><div class='pictures'>{''.join(_figures(worst.got, worst.expected))}</div>"


def _figures(got: Picture | None, expected: Picture | None) -> Iterable[str]:
    if got is None:
        return
    base = got if expected is None else expected
    finite = np.where(np.isfinite(base), base, 0.0)
    level = float(np.abs(finite @ REC709_LUMINANCE).mean()) or 1.0
    yield _figure("got", _displayed(got, GREY / level))
    if expected is not None and expected.shape == got.shape:
        off = np.nan_to_num((got - expected) @ REC709_LUMINANCE, posinf=0.0, neginf=0.0)
        extent = 4.0 * float(np.abs(off).mean()) or 1.0
        yield _figure("expected", _displayed(expected, GREY / level))
        yield _figure(f"difference, ±{extent / level:.2g} of the mean", colored(off / (2 * extent) + 0.5, DIVERGING))


def _displayed(values: NDArray[np.float64], scale: float) -> NDArray[np.float64]:
    """Return sRGB values 0 to 255; values that are not finite are magenta."""
    wrong: NDArray[np.bool_] = np.asarray(~np.isfinite(values).all(-1))
    shown = srgb_from_linear(np.where(wrong[..., None], 0.0, values) * scale) * 255.0
    return np.where(wrong[..., None], (255.0, 0.0, 255.0), shown)


def _figure(caption: str, values: NDArray[np.float64]) -> str:
    return f"<figure><img src='{png_uri(values)}' alt=''><figcaption>{escape(caption)}</figcaption></figure>"
