"""The results of a run as plain data, and its JSON file.

The file is `Report`, with "schema": "wgpu_gi.stress" and "version", which increases when a field changes its meaning.
Numbers of a case: "direct bias", "direct bias error" (one standard error), "direct relmse", the same for "indirect", as
fractions; "off" of a relation, as a fraction of the expected mean. null marks a value that is not finite.
"""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from ...pictures.atomic_file import atomic_file
from .findings import Case, Picture, Verdict

SCHEMA, VERSION = "wgpu_gi.stress", 1


@dataclass
class Record:
    """A case and what it found; `seconds` is the time of the check."""

    case: Case
    verdict: Verdict
    failure: str
    sentence: str
    numbers: dict[str, float]
    p: float | None
    seconds: float


@dataclass
class Failure:
    """A failure: its record, its reduced scene as a file, the command that shows it again, and its pictures."""

    record: Record
    path: str
    command: str
    reduced: str  # what is left of the scene, in words
    got: Picture | None = None
    expected: Picture | None = None


@dataclass
class Worst:
    """The worst picture of a technique against its truth."""

    record: Record
    got: Picture
    expected: Picture


@dataclass
class Report:
    """All results of a run.

    times: milliseconds of pictures by technique, of first and further frames of a scene. worst: the largest relMSE by
    technique, preset and layer.
    """

    machine: dict[str, Any]
    size: tuple[int, int]
    records: list[Record] = field(default_factory=list)
    failures: list[Failure] = field(default_factory=list)
    times: dict[str, dict[str, list[float]]] = field(default_factory=dict)
    worst: dict[tuple[str, str, str], Worst] = field(default_factory=dict)
    seconds: float = 0.0
    interrupted: bool = False

    @property
    def failed(self) -> list[Record]:
        """The records of failed cases."""
        return [record for record in self.records if record.verdict == "failed"]


def save_json(path: str | Path, report: Report) -> None:
    """Write the report without pictures. Raises GiError if the file cannot be written."""
    document = {
        "schema": SCHEMA,
        "version": VERSION,
        "machine": report.machine,
        "size": list(report.size),
        "seconds": report.seconds,
        "interrupted": report.interrupted,
        "times": {gi: {name: _stats(values) for name, values in t.items()} for gi, t in report.times.items()},
        "cases": [_plain(record) for record in report.records],
        "failures": [
            {"case": asdict(f.record.case), "class": f.record.failure, "sentence": f.record.sentence}
            | {"path": f.path, "command": f.command, "reduced": f.reduced}
            for f in report.failures
        ],
    }
    text = json.dumps(document, indent=1, allow_nan=False) + "\n"
    with atomic_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _plain(record: Record) -> dict[str, Any]:
    numbers = {name: value if math.isfinite(value) else None for name, value in record.numbers.items()}
    return {
        **asdict(record.case),
        "verdict": record.verdict,
        "class": record.failure,
        "sentence": record.sentence,
        "numbers": numbers,
        "p": record.p,
        "seconds": round(record.seconds, 4),
    }


def summary(values: list[float]) -> tuple[float, float, float]:
    """Return median, 95th percentile and worst of magnitudes; zeros without values."""
    if not values:
        return 0.0, 0.0, 0.0
    ordered = sorted(abs(value) for value in values)
    last = len(ordered) - 1
    return ordered[last // 2], ordered[math.ceil(0.95 * last)], ordered[last]


def _stats(values: list[float]) -> dict[str, float]:
    median, p95, worst = summary(values)
    return {"count": len(values), "median_ms": median, "p95_ms": p95, "worst_ms": worst}
