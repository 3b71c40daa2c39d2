"""`wgpu-gi stress`: random scenes against relations and the path tracer; a page of failures, each with its command."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable
from pathlib import Path

from rich.console import Console

from ..errors import GiError, known_names
from ..measure.bench import machine
from ..measure.scenes import KINDS, make_scene
from ..measure.stress.checks import CHECKS, SENTENCES
from ..measure.stress.page import class_rows, save_page, summary_text, verdict
from ..measure.stress.results import Record, Report, save_json
from ..measure.stress.run import Plan, run
from ..measure.stress.studio import Studio, techniques
from ..options import Settings, check_size
from ..pictures.atomic_file import check_writable
from ..scene.scene import Scene
from ..sequence.source import load_scene
from ..settings import QUALITIES, apply_quality, assign, validate
from .common import warn_of_cpu
from .messages import Messages

FOUND, INTERRUPTED = 1, 130
MOST_MINUTES, MOST_SECONDS = 100_000.0, 1e6
FILE = "file"  # the kind of a scene from --scene
OWN_SETTINGS = ("gi", "seed", "spp", "bounces", "camera.jitter", "camera.frames")


def stress(arguments: Namespace) -> int:
    """Run `wgpu-gi stress`; return 0 without failures, 1 with failures, 130 after Ctrl-C. Raises GiError."""
    say = Messages(arguments.verbose, arguments.quiet)
    if arguments.checks == "help":
        print("\n".join(f"{name:<14} {sentence}" for name, sentence in SENTENCES.items()))
        return 0

    # Check the arguments before any slow step.
    plan = plan_from(arguments)
    studios = {quality: _studio(arguments, quality) for quality in plan.qualities}
    here = machine(arguments.adapter)
    warn_of_cpu(here["adapter"], here["is_cpu"], say)

    # Run, with a line per failure.
    total = len(plan.seeds)
    with say.progress("stress") as bar:

        def progress(record: Record, report: Report) -> None:
            case = record.case
            done = (case.seed - plan.seeds.start) / max(total, 1)
            if plan.minutes is not None:
                done = max(done, sum(r.seconds for r in report.records) / (60 * plan.minutes))
            bar(min(done, 1.0), f"{case.kind} {case.seed}: {len(report.records)} cases, {len(report.failed)} failures")
            if record.verdict == "failed":
                say.detail(f"{case.kind} {case.seed} {case.gi} {case.check}: {record.failure}: {record.sentence}")

        report = run(plan, studios, here, progress)

    # Report.
    if plan.folder is not None:
        save_page(plan.folder / "index.html", report)
        say.result(str(plan.folder / "index.html"))
    if arguments.json is not None:
        save_json(arguments.json, report)
    print_report(report)
    return INTERRUPTED if report.interrupted else FOUND if report.failed else 0


def plan_from(arguments: Namespace) -> Plan:
    """Return what the arguments ask for. Raises GiError for unknown names and for what cannot be written."""
    check_size(arguments.size)
    if arguments.minutes is not None and not 0 < arguments.minutes <= MOST_MINUTES:
        raise GiError(f"--minutes must lie between 0 and {MOST_MINUTES:g}, not {arguments.minutes:g}")
    if not 0 <= arguments.reduce <= MOST_SECONDS:
        raise GiError(f"--reduce must lie between 0 and {MOST_SECONDS:g} seconds, not {arguments.reduce:g}")
    if arguments.json is not None:
        check_writable(arguments.json)
    folder = None if arguments.output is None else Path(arguments.output)
    if folder is not None:
        _make(folder)
    make, kinds, source = _scenes(arguments)
    return Plan(
        kinds,
        arguments.seeds,
        _chosen("--gi", arguments.gi, techniques()),
        _chosen("--quality", arguments.quality, QUALITIES),
        None if arguments.checks == "turns" else _chosen("--checks", arguments.checks, tuple(CHECKS)),
        arguments.minutes,
        folder,
        arguments.reduce,
        make,
        source,
    )


def _scenes(arguments: Namespace) -> tuple[Callable[[str, int], Scene], tuple[str, ...], list[str]]:
    """Return the function that makes a scene, the kinds, and the arguments that name a file."""
    if arguments.scene is None:
        if arguments.env is not None:
            raise GiError("--env goes with --scene; random scenes have their own sky")
        return make_scene, _chosen("--kinds", arguments.kinds, KINDS), []
    scene = load_scene(arguments.scene, arguments.env, [], [], strict=arguments.strict)

    def the_scene(kind: str, seed: int) -> Scene:
        return scene

    source = ["--scene", arguments.scene, *(["--env", arguments.env] if arguments.env else [])]
    return the_scene, (FILE,), source


def _studio(arguments: Namespace, quality: str) -> Studio:
    settings = Settings()
    apply_quality(settings, quality)
    for text in arguments.set:
        name = text.partition("=")[0].strip()
        if name in OWN_SETTINGS:
            raise GiError(f"stress sets {name} itself, so it does not take --set {text}")
        assign(settings, text)
    validate(settings)
    return Studio(arguments.size, adapter=arguments.adapter, settings=settings)


def _chosen(flag: str, text: str | None, known: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names of a comma-separated list, all that are known for None or `all`."""
    if text is None or text == "all":
        return known
    names = [name.strip() for name in text.split(",") if name.strip()]
    if not names:
        raise GiError(f"{flag} takes names with commas between, not {text!r}")
    for name in names:
        if name not in known:
            raise GiError(f"{flag} does not know {name!r}; {known_names(name, known)}")
    return tuple(dict.fromkeys(names))


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise GiError(f"the folder {folder} cannot be made ({error.strerror}); choose another with -o") from None
    check_writable(folder / "index.html")


def print_report(report: Report) -> None:
    """Print the verdict and the classes of failures."""
    print(f"{verdict(report)}; {summary_text(report)}")
    rows = class_rows(report)
    console = Console(highlight=False, soft_wrap=True)
    for name, check, gi, count, kinds, first in rows[1:]:
        console.print(f"  {count:>5}  {check} of {gi}: {name}, in {kinds}; first {first}", markup=False)
    for failure in report.failures:
        console.print(f"  {failure.command}", markup=False)
