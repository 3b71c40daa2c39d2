"""Runs the cases of a stress run within its budget: scene by scene, each relation in its turn, failures reduced."""

from __future__ import annotations

import shlex
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from ...errors import GiError
from ...scene.gltf.write import save_glb
from ...scene.load import read_scene
from ...scene.scene import Scene
from .checks import run_check
from .findings import Case, Finding
from .reduce import State, described, reduced
from .relations import RELATIONS
from .results import Failure, Record, Report, Worst
from .studio import Studio

ALWAYS = ("repeated",)  # of every scene and technique
SELDOM = {"renewed": 8, "leaks": 16, "truth": 4, "furnace": 4}  # every so many seeds
MOST_PICTURES = 200  # failures that are reduced and shown; the others are only counted
MOST_OF_CLASS = 3  # ... of one class, check and technique
ROTATE = "rotate"

Progress = Callable[[Record, Report], None]


@dataclass
class Plan:
    """What to run. `checks` of None takes turns: some checks always, one relation, the slow ones seldom."""

    kinds: Sequence[str]
    seeds: range
    techniques: Sequence[str]
    qualities: Sequence[str] = ("medium",)
    checks: Sequence[str] | None = None
    minutes: float | None = None
    folder: Path | None = None
    reduce_seconds: float = 60.0
    make: Callable[[str, int], Scene] | None = None
    source: list[str] = field(default_factory=list)  # arguments of the command that name the scene

    def cases(self, kind: str, seed: int) -> Iterator[Case]:
        """Yield the cases of a scene."""
        for quality in self.qualities:
            for place, gi in enumerate(self.techniques):
                for check in self.checks or _turn(seed, place, self.kinds.index(kind)):
                    yield Case(kind, seed, gi, check, quality)


def _turn(seed: int, place: int, kind: int) -> list[str]:
    """Return the checks whose turn it is."""
    names = list(RELATIONS)
    seldom = [check for check, period in SELDOM.items() if (seed + kind) % period == period - 1]
    return [*ALWAYS, names[(seed + 3 * place + 5 * kind) % len(names)], *seldom]


def run(plan: Plan, studios: dict[str, Studio], machine: dict[str, object], progress: Progress) -> Report:
    """Run all cases; stop when the time is over or at Ctrl-C, with the report of what was done."""
    started = time.perf_counter()
    end = None if plan.minutes is None else started + 60 * plan.minutes
    report = Report(dict(machine), next(iter(studios.values())).size)
    try:
        for seed in plan.seeds:
            for kind in plan.kinds:
                if end is not None and time.perf_counter() > end:
                    return report
                _run_scene(plan, kind, seed, studios, report, progress, end)
    except KeyboardInterrupt:
        report.interrupted = True
    finally:
        report.seconds = time.perf_counter() - started
        for studio in studios.values():
            for gi, times in studio.times.items():
                mine = report.times.setdefault(gi, {"first": [], "further": []})
                mine["first"] += times.first
                mine["further"] += times.further
    return report


def _run_scene(
    plan: Plan,
    kind: str,
    seed: int,
    studios: dict[str, Studio],
    report: Report,
    progress: Progress,
    end: float | None,
) -> None:
    assert plan.make is not None
    scene = plan.make(kind, seed)
    for case in plan.cases(kind, seed):
        if end is not None and time.perf_counter() > end:
            return
        started = time.perf_counter()
        with _noted(plan, case, studios[case.quality].size):
            finding = run_check(studios[case.quality], case, scene)
        record = Record(
            case,
            finding.verdict,
            finding.failure,
            finding.sentence,
            finding.numbers,
            finding.p,
            time.perf_counter() - started,
        )
        report.records.append(record)
        _keep_worst(report, record, finding)
        if finding.verdict == "failed" and _is_shown(report, record):
            report.failures.append(_failure(plan, studios[case.quality], record, finding, scene, end))
        progress(record, report)


@contextmanager
def _noted(plan: Plan, case: Case, size: tuple[int, int]) -> Iterator[None]:
    """Keep the command of a case in a file while it runs, for drivers that end the process."""
    if plan.folder is None:
        yield
        return
    note = plan.folder / "running.txt"
    try:
        note.write_text(command_of(case, size, plan.source or ["--kinds", case.kind]) + "\n", encoding="utf-8")
        yield
    finally:
        note.unlink(missing_ok=True)


def _keep_worst(report: Report, record: Record, finding: Finding) -> None:
    """Keep the pictures of the largest relMSE of each technique, preset and layer."""
    for layer, (got, expected) in finding.compared.items():
        key = (record.case.gi, record.case.quality, layer)
        relmse = record.numbers[f"{layer} relmse"]
        if key not in report.worst or relmse > report.worst[key].record.numbers[f"{layer} relmse"]:
            report.worst[key] = Worst(record, got, expected)


def _is_shown(report: Report, record: Record) -> bool:
    def key(r: Record) -> tuple[str, str, str]:
        return r.failure, r.case.check, r.case.gi

    alike = sum(key(f.record) == key(record) for f in report.failures)
    return len(report.failures) < MOST_PICTURES and alike < MOST_OF_CLASS


def _failure(plan: Plan, studio: Studio, record: Record, finding: Finding, scene: Scene, end: float | None) -> Failure:
    """Reduce the scene of a failure and save it."""
    case = record.case
    state = State(scene, studio.size)
    seconds = plan.reduce_seconds if end is None else min(plan.reduce_seconds, end - time.perf_counter())
    if seconds > 0 and case.check != "furnace":
        state = reduced(state, lambda candidate: _fails_alike(studio, case, candidate, finding.failure), seconds)
    path, environment = "", None
    if plan.folder is not None:
        path = str(plan.folder / f"{case.kind}-{case.seed}-{case.gi}-{case.check}.glb")
        try:
            environment = save_glb(path, state.scene)
            again = _loaded(path, environment)
            shows = case.check == "furnace" or _fails_alike(studio, case, State(again, state.size), finding.failure)
        except GiError as error:
            record.sentence += f"; the scene cannot be saved: {error}"
            shows = False
    if not path or not shows:
        # The file does not hold what matters, such as triangles without area: make the scene again.
        environment, state, source = None, State(state.scene, studio.size), plan.source or ["--kinds", case.kind]
    else:
        source = ["--scene", path, *(["--env", environment] if environment else [])]
    return Failure(
        record, path, command_of(case, state.size, source), described(state.scene), finding.got, finding.expected
    )


def _loaded(path: str, environment: str | None) -> Scene:
    return read_scene(path, environment=environment)


def _fails_alike(studio: Studio, case: Case, state: State, failure: str) -> bool:
    """Return whether a candidate fails in the same class."""
    size, studio.size, studio.thorough = studio.size, state.size, False
    try:
        return run_check(studio, case, state.scene).failure == failure
    finally:
        studio.size, studio.thorough = size, True


def command_of(case: Case, size: tuple[int, int], source: Sequence[str]) -> str:
    """Return the command that runs a case again; `source` are its arguments that name the scene."""
    words = ["wgpu-gi", "stress", *source, "--seeds", f"{case.seed}:{case.seed + 1}"]
    words += ["--gi", case.gi, "--checks", case.check, "--size", f"{size[0]}x{size[1]}"]
    if case.quality != "medium":
        words += ["--quality", case.quality]
    return shlex.join(words)
