"""Reports of `wgpu-gi bench`: tables for the terminal, a JSON file, ratios to an earlier report.

The JSON file is `results.Report`, field by field, with "schema": "wgpu_gi.bench" and "version", which increases when
a field changes its meaning. Errors are `metrics.Errors`: relmse minus the noise floor of the truth if that is known,
bias a fraction. Times are milliseconds. null marks a value that could not be measured.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.table import Table

from ..errors import GiError
from ..pictures.atomic_file import atomic_file
from .metrics import Errors
from .ranking import points_of, ranked, ranking_table
from .results import (
    CASES,
    Case,
    Measurement,
    MovingErrors,
    PathPoint,
    PlayedErrors,
    Reference,
    Report,
    SceneReport,
    Stats,
    bounces_text,
)

SCHEMA, VERSION = "wgpu_gi.bench", 2
LAYER_TITLES = {"full": "full image", "direct": "direct", "indirect": "indirect"}
MOVING_TITLES = {**LAYER_TITLES, "aliased": "full, one sample", "antialiased": "full, anti-aliased"}
MISSING = "-"

# The JSON file.


def save_json(path: str | Path, report: Report) -> None:
    """Write the report. Raises GiError if the file cannot be written."""
    text = json.dumps({"schema": SCHEMA, "version": VERSION, **asdict(report)}, indent=1, allow_nan=False) + "\n"
    with atomic_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def load_json(path: str | Path) -> Report:
    """Read a report. Raises GiError for a file that is missing, damaged, or of another program or version."""
    try:
        document = json.loads(Path(path).read_text(encoding="utf-8"))
        if document["schema"] != SCHEMA:
            raise KeyError("schema")
        version = document["version"]
        if version != VERSION:
            raise GiError(f"{path}: version {version} of the report; this program reads {VERSION}: measure again")
        scenes = [_scene(scene) for scene in document["scenes"]]
        return Report(dict(document["machine"]), document["frames"], document["warm_up"], scenes)
    except OSError as error:
        raise GiError(f"{path}: cannot be read ({error.strerror or error})") from None
    except (ValueError, KeyError, TypeError, AttributeError):
        raise GiError(f"{path}: not a report of wgpu-gi bench --json") from None


def _scene(d: Mapping[str, Any]) -> SceneReport:
    techniques = [
        Measurement(
            **{
                **m,
                "errors": _errors(m["errors"]),
                "settled": _errors(m["settled"]),
                "cases": {n: _case(c) for n, c in m["cases"].items()},
                "moving": _moving(m.get("moving")),
                "played": None if m.get("played") is None else [PlayedErrors(**e) for e in m["played"]],
            }
        )
        for m in d["techniques"]
    ]
    references = [
        Reference(**{**r, "curve": _curve(r["curve"]), "denoised": _curve(r.get("denoised", []))})
        for r in d["references"]
    ]
    width, height = d["size"]
    return SceneReport(**{**d, "size": (width, height), "techniques": techniques, "references": references})


def _curve(points: list[Mapping[str, Any]]) -> list[PathPoint]:
    return [PathPoint(**{**p, "errors": _errors(p["errors"])}) for p in points]


def _errors(d: Mapping[str, Any]) -> dict[str, Errors | None]:
    return {layer: None if d[layer] is None else Errors(**d[layer]) for layer in LAYER_TITLES}


def _moving(d: Mapping[str, Any] | None) -> dict[str, MovingErrors | None] | None:
    return None if d is None else {layer: None if e is None else MovingErrors(**e) for layer, e in d.items()}


def _case(d: Mapping[str, Any]) -> Case:
    passes = {name: Stats(**s) for name, s in d["passes"].items()}
    return Case(d["passes_run"], Stats(**d["wall_ms"]), Stats(**d["gpu_ms"]), passes)


# The terminal.


def tables(report: Report) -> list[tuple[str, Table]]:
    """Return title and table: for each scene errors, times of each technique, the path tracer, a ranking."""
    found = []
    for scene in report.scenes:
        found.append(_error_table(scene))
        if any(m.moving for m in scene.techniques):
            found.append(_moving_table(scene))
        if any(m.played for m in scene.techniques):
            found.append(_played_table(scene))
        found += [_time_table(scene, measurement) for measurement in scene.techniques]
        found += [_path_table(scene, reference) for reference in scene.references]
        found += [_ranking(scene, reference) for reference in scene.references]
    return found


def _error_table(scene: SceneReport) -> tuple[str, Table]:
    truths = "; ".join(f"{bounces_text(r.bounces)} by {r.truth}" for r in scene.references)
    table = _table("technique", "layer")
    for heading in ("relMSE", "noise floor", "bias", "99.9 %"):
        table.add_column(heading, justify="right")
    for m in scene.techniques:
        rows = [(m.title, m.errors)]
        if m.settled_frames > 1:
            rows.append((f"  {m.settled_frames} frames", m.settled))
        for name, errors in rows:
            for layer, title in LAYER_TITLES.items():
                table.add_row(name if layer == "full" else "", title, *_error_cells(errors[layer]))
    return f"{_title(scene)}: error, truth {truths}", table


def _error_cells(errors: Errors | None) -> list[str]:
    """Return relMSE, noise floor, bias and percentile as text."""
    if errors is None:
        return [MISSING] * 4
    floor = MISSING if errors.floor is None else f"{errors.floor:.2g}"
    return [f"{errors.relmse:.3g}", floor, f"{errors.bias:+.2%}", f"{errors.percentile:.3g}"]


def _moving_table(scene: SceneReport) -> tuple[str, Table]:
    table = _table("technique", "layer")
    for heading in ("flicker", "lag, frames", "ghost, camera", "ghost, object", "relMSE", "bias"):
        table.add_column(heading, justify="right")
    for m in scene.techniques:
        for layer, e in (m.moving or {}).items():
            cells = [MISSING] * 6
            if e is not None:
                errors = (e.flicker, e.ghost_camera, e.ghost_object, e.relmse)
                flicker, camera, thing, relmse = (MISSING if v is None else f"{v:.3g}" for v in errors)
                frames = MISSING if e.lag is None else str(e.lag)
                cells = [flicker, frames, camera, thing, relmse, f"{e.bias:+.2%}"]
            table.add_row(m.title if layer == "full" else "", MOVING_TITLES[layer], *cells)
    return f"{_title(scene)}: moving, against each technique's own converged pictures", table


def _played_table(scene: SceneReport) -> tuple[str, Table]:
    """Return errors by frames of history; the indirect light of a technique stands below its full image."""
    table = _table("technique", "layer")
    for heading in ("history", "relMSE", "bias", "ghost"):
        table.add_column(heading, justify="right")
    for m in scene.techniques:
        for layer in ("full", "indirect"):
            for k, e in enumerate(m.played or []):
                relmse, bias, ghost = (getattr(e, f"{name}_{layer}") for name in ("relmse", "bias", "ghost"))
                titles = [m.title if layer == "full" and k == 0 else "", LAYER_TITLES[layer] if k == 0 else ""]
                cells = [MISSING if v is None else f"{v:.3g}" for v in (relmse, ghost)]
                cells.insert(1, MISSING if bias is None else f"{bias:+.2%}")
                table.add_row(*titles, str(e.frames), *cells)
    return f"{_title(scene)}: while its animation plays, against the path tracer", table


def _time_table(scene: SceneReport, m: Measurement) -> tuple[str, Table]:
    table = _table("median (p95)")
    for title in CASES.values():
        table.add_column(title, justify="right")
    cases = [m.cases[case] for case in CASES]
    table.add_row("wall, per frame", *(_ms(case.wall_ms) for case in cases))
    table.add_row("GPU, per frame", *(_ms(case.gpu_ms) for case in cases))
    table.add_row("passes run", *(str(case.passes_run) for case in cases))
    for name in dict.fromkeys(name for case in reversed(cases) for name in case.passes):
        table.add_row(f"  {name}", *(_ms(case.passes.get(name)) for case in cases))
    return f"{_title(scene)}: ms of {m.title}, {m.bytes / 2**20:.1f} MiB", table


def _path_table(scene: SceneReport, reference: Reference) -> tuple[str, Table]:
    table = _table()
    for heading in ("spp", "GPU ms", "wall ms", "relMSE full", "relMSE indirect"):
        table.add_column(heading, justify="right")
    for curve, title in ((reference.curve, ""), (reference.denoised, ", denoised")):
        for p in curve:
            errors = [_error_cells(p.errors[layer])[0] for layer in ("full", "indirect")]
            table.add_row(f"{p.spp}{title}", _number(p.gpu_ms), _number(p.wall_ms), *errors)
    return f"{_title(scene)}: the path tracer, {bounces_text(reference.bounces)}", table


def _ranking(scene: SceneReport, reference: Reference) -> tuple[str, Table]:
    noise = reference.noise["full"] or 0.0
    table = ranking_table(ranked(points_of(scene, reference), noise), noise)
    return f"{_title(scene)}: pictures by time, full image, truth {bounces_text(reference.bounces)}", table


def _table(*columns: str) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 3, 0, 0))
    for column in columns:
        table.add_column(column, no_wrap=True)
    return table


def _title(scene: SceneReport) -> str:
    return f"{scene.scene}, {scene.size[0]}x{scene.size[1]}"


def _ms(s: Stats | None) -> str:
    return MISSING if s is None else f"{_number(s.median)} ({_number(s.p95)})"


def _number(ms: float) -> str:
    return f"{ms:.2f}" if ms < 100 else f"{ms:.0f}"


# An earlier report.


def different_machine(old: Report, machine: Mapping[str, Any]) -> str | None:
    """Return a sentence if `old` was measured on another adapter, or on another number of cores of a CPU adapter."""

    def name(m: Mapping[str, Any]) -> str:
        return f"{m.get('adapter')}" + (f" on {m.get('cores')} cores" if m.get("is_cpu") else "")

    before, now = name(old.machine), name(machine)
    if before == now:
        return None
    return f"measured on {before}, not on {now}: ratios across machines mean nothing and are not printed"


def ratios(old: Report, new: Report) -> dict[str, dict[str, float | None]]:
    """Return new / old of times, errors and memory by name, for the same scene, settings and size in both reports.

    A ratio is None if one of its values is missing or not positive.
    """
    earlier = _by_key(old)
    found = {}
    for key, m in _by_key(new).items():
        if key in earlier:
            before, now = _compared(earlier[key]), _compared(m)
            scene, (width, height) = key[0], key[1]
            found[f"{scene}, {width}x{height}, {m.title}"] = {
                heading: _ratio(before[heading], now[heading]) for heading in now
            }
    return found


def ratio_table(rows: Mapping[str, Mapping[str, float | None]]) -> Table:
    """Return at least one row of ratios as a table."""
    table = _table("")
    for heading in next(iter(rows.values())):
        table.add_column(heading, justify="right")
    for name, row in rows.items():
        table.add_row(name, *(MISSING if ratio is None else f"{ratio:.2f}" for ratio in row.values()))
    return table


def _by_key(report: Report) -> dict[Any, Measurement]:
    """Return the measurements by all that must be equal for a comparison."""
    return {
        (s.scene, s.size, s.camera, s.env, tuple(s.light), tuple(s.relight), s.diffuse, tuple(s.set), m.title): m
        for s in report.scenes
        for m in s.techniques
    }


def _compared(m: Measurement) -> dict[str, float | None]:
    full, indirect = m.errors["full"], m.errors["indirect"]
    return {
        "GPU all": m.cases["all"].gpu_ms.median,
        "GPU camera": m.cases["camera"].gpu_ms.median,
        "wall all": m.cases["all"].wall_ms.median,
        "wall still": m.cases["still"].wall_ms.median,
        "relMSE full": None if full is None else full.relmse,
        "indirect": None if indirect is None else indirect.relmse,
        "memory": m.bytes,
    }


def _ratio(before: float | None, now: float | None) -> float | None:
    return now / before if before and now and min(before, now) > 0 else None
