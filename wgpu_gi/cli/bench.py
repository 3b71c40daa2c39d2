"""`wgpu-gi bench`: from arguments to measurements of scenes, techniques and presets, tables, a JSON file and a plot."""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from itertools import product
from pathlib import Path

from rich.console import Console
from rich.progress import Progress as Bar
from rich.table import Table

from ..camera import Camera
from ..errors import GiError
from ..measure.bench import WARM_UP_FRAMES, Candidate, machine, measure_scene
from ..measure.plot import PLOT_FORMATS, require_matplotlib, save_plot
from ..measure.report import different_machine, load_json, ratio_table, ratios, save_json, tables
from ..measure.results import PRESET, Report, SceneReport
from ..measure.truth import Progress, Truth, truth_by_path, truth_from_file
from ..options import TECHNIQUES, Settings, check_size
from ..pictures.atomic_file import check_writable
from ..scene.files.camera_files import choose_camera
from ..scene.load import NO_CAMERA_NOTE
from ..scene.scene import Scene
from ..settings import QUALITIES, apply_quality, assign, describe, format_rows, validate
from .common import scene_from

DEFAULT_SIZE = (640, 360)
# Settings that a measurement has of its own, and why, or what to use instead.
OWN_SETTINGS = {
    "gi": "use --gi",
    "diffuse": "use --diffuse",
    "spp": "a frame of the path tracer is one run; use --set path.samples_per_run",
    "camera.jitter": "pictures are of the pixel centres, as the truth is",
    "camera.frames": "pictures are of the pixel centres, so there is nothing to average",
}
# What techniques are held against, as these with settings of their own: ssao is ambient light times a share of it.
TABLE_WIDTH = 140  # where the output is no terminal
MOST_FRAMES, MOST_SPP = 100_000, 10_000_000


def bench(arguments: Namespace) -> int:
    """Carry out `wgpu-gi bench`; return the exit code. Raises GiError for all that the user can put right."""
    if "help" in arguments.set:
        print(format_rows(describe(Settings())))
        return 0
    # Refuse what cannot work before any time is spent on it.
    candidates = candidates_from(arguments)
    check_outputs(arguments)
    scenes = list(dict.fromkeys(arguments.scene))
    size = size_from(arguments, scenes)
    old = None if arguments.compare is None else load_json(arguments.compare)
    here = machine(arguments.adapter)
    if here["is_cpu"]:
        print(f"warning: {here['adapter']} IS A CPU, not a GPU: this is slow", file=sys.stderr)
    difference = None if old is None else different_machine(old, here)
    if difference is not None:
        print(f"warning: {arguments.compare} was {difference}", file=sys.stderr)

    with progress_bar() as progress:
        reports = [bench_scene(arguments, name, size, candidates, progress) for name in scenes]
    report = Report(here, arguments.frames, WARM_UP_FRAMES, reports)
    if arguments.json is not None:
        save_json(arguments.json, report)
    if arguments.plot is not None:
        save_plot(arguments.plot, report)
    print_report(report)
    if old is not None and difference is None:
        print_ratios(old, report, arguments.compare)
    return 0


def candidates_from(arguments: Namespace) -> list[Candidate]:
    """Return what `--gi`, `--quality` and `--set` ask for: each technique at each quality, at the pixel centres."""
    # The path tracer is measured in any case, as the curve that all are held against.
    known = [*TECHNIQUES]
    names = [name for name in known if name != "path"] if arguments.gi is None else _split("--gi", arguments.gi)
    for name in names:
        if name not in known:
            raise GiError(f"--gi takes techniques out of {', '.join(known)}, with commas between, not {name!r}")
    for flag, texts in (("--set", arguments.set), ("--sweep", arguments.sweep)):
        for text in texts:
            name = text.partition("=")[0].strip()
            if name in OWN_SETTINGS:
                raise GiError(f"bench has its own {name}, so it does not take {flag} {text}: {OWN_SETTINGS[name]}")
    variants = [" ".join(texts) for texts in product(*map(_swept, arguments.sweep))]
    candidates = []
    for name in names:
        for quality in _split("--quality", arguments.quality):
            if quality not in QUALITIES:
                raise GiError(f"--quality takes {', '.join(QUALITIES)}, with commas between, not {quality!r}")
            for variant in variants:
                settings, preset = Settings(), Settings()
                apply_quality(settings, quality)
                apply_quality(preset, quality)
                for text in (*arguments.set, *variant.split()):
                    assign(settings, text)
                name_of_variant = f"{variant} {PRESET}" if variant and settings == preset else variant
                settings.gi, settings.diffuse, settings.camera.jitter = name, arguments.diffuse, False
                if name == "path":
                    settings.spp = settings.path.samples_per_run  # a frame of it is one run
                validate(settings)
                candidates.append(Candidate(name, quality, settings, name_of_variant))
    return candidates


def check_outputs(arguments: Namespace) -> None:
    """Raise GiError if numbers make no sense, or a file could not be written at the end."""
    for flag, number, least, most in (
        ("--frames", arguments.frames, 1, MOST_FRAMES),
        ("--truth-spp", arguments.truth_spp, 2, MOST_SPP),
    ):
        if not least <= number <= most:
            raise GiError(f"{flag} must lie between {least} and {most}, not {number}")
    if arguments.json is not None:
        _check_suffix("--json", arguments.json, (".json",))
    if arguments.plot is not None:
        _check_suffix("--plot", arguments.plot, PLOT_FORMATS)
        require_matplotlib()


def size_from(arguments: Namespace, scenes: list[str]) -> tuple[int, int]:
    """Return the size of all pictures: as given, or that of the truth's file. Raises GiError if the two differ."""
    size: tuple[int, int] = arguments.size or DEFAULT_SIZE
    if arguments.truth != "path":
        if len(scenes) > 1:
            raise GiError(f"--truth {arguments.truth} is of one scene, but {len(scenes)} are given; bench one by one")
        stored = truth_from_file(arguments.truth).size
        if arguments.size is not None and arguments.size != stored:
            raise GiError(
                f"{arguments.truth} is {stored[0]}x{stored[1]}, but --size asks for {size[0]}x{size[1]}; leave it out"
            )
        size = stored
    check_size(*size)
    return size


def bench_scene(
    arguments: Namespace, name: str, size: tuple[int, int], candidates: list[Candidate], progress: Progress | None
) -> SceneReport:
    """Load and measure one scene."""
    scene = scene_from(Namespace(scene=name, light=arguments.light, relight=arguments.relight, env=arguments.env))
    camera = choose_camera(scene, arguments.camera, Path(name).parent)
    for note in scene.notes:
        if note != NO_CAMERA_NOTE or arguments.camera is None:
            print(f"note: {name}: {note}", file=sys.stderr)

    def report(what: str, fraction: float) -> None:
        if progress is not None:
            progress(f"{name}: {what}", fraction)

    # Held against the same path tracer, all of them.
    visible_only = candidates[0].settings.path.visible_only
    truth_of = truth_source(arguments, scene, camera, size, visible_only, report)
    try:
        measured = measure_scene(
            scene,
            camera,
            size,
            candidates,
            truth_of,
            frames=arguments.frames,
            adapter=arguments.adapter,
            progress=report,
        )
    except GiError as error:
        raise GiError(f"{name}: {error}") from None
    techniques, references = measured
    return SceneReport(
        name,
        arguments.camera,
        arguments.env,
        arguments.light,
        arguments.diffuse,
        arguments.set,
        size,
        techniques,
        references,
        arguments.relight,
    )


def truth_source(
    arguments: Namespace,
    scene: Scene,
    camera: Camera,
    size: tuple[int, int],
    visible_only: bool,
    report: Progress,
) -> Callable[[int | None], Truth]:
    """Return a function from indirect bounces to the truth, as `--truth` says."""
    if arguments.truth != "path":
        return partial(truth_from_file, arguments.truth)
    return lambda bounces: truth_by_path(
        scene,
        camera,
        size,
        spp=arguments.truth_spp,
        bounces=bounces,
        diffuse=arguments.diffuse,
        visible_only=visible_only,
        adapter=arguments.adapter,
        progress=report,
    )


def print_report(report: Report) -> None:
    """Print all tables."""
    for title, table in tables(report):
        _print_table(title, table)
    here = report.machine
    print(f"{report.frames} frames each, on {here['adapter']}, {here['driver']}, {here['cores']} cores")


def print_ratios(old: Report, new: Report, old_name: str) -> None:
    """Print the ratios to an earlier report, or that there is nothing to compare."""
    rows = ratios(old, new)
    if rows:
        print()
        _print_table(f"now / {old_name}: below 1 is better", ratio_table(rows))
    else:
        print(f"{old_name} holds nothing with the same scene, size, settings and technique")


def _print_table(title: str, table: Table) -> None:
    console = Console(highlight=False, width=None if sys.stdout.isatty() else TABLE_WIDTH)
    console.print(title, style="bold", markup=False, soft_wrap=True)
    console.print(table)
    console.print()


@contextmanager
def progress_bar() -> Iterator[Progress | None]:
    """Yield a function that takes what is done and the fraction of it, or None where no person watches."""
    if not sys.stderr.isatty():
        yield None
        return
    with Bar(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("measuring", total=1.0)
        yield lambda what, fraction: bar.update(task, description=what, completed=fraction)


def _swept(text: str) -> list[str]:
    """Return the settings that `--sweep name=a,b` stands for."""
    name, equals, values = text.partition("=")
    if not equals or not values.strip(" ,"):
        raise GiError(f"--sweep takes a setting and its values, such as vpl.count=512,2048, not {text!r}")
    return [f"{name.strip()}={value}" for value in _split("--sweep", values)]


def _split(flag: str, text: str) -> list[str]:
    names = [name.strip() for name in text.split(",") if name.strip()]
    if not names:
        raise GiError(f"{flag} takes names with commas between, not {text!r}")
    return list(dict.fromkeys(names))


def _check_suffix(flag: str, path: str, suffixes: tuple[str, ...]) -> None:
    if Path(path).suffix.lower() not in suffixes:
        raise GiError(f"{flag} takes a file name that ends in {' or '.join(suffixes)}, not {path!r}")
    check_writable(path)
