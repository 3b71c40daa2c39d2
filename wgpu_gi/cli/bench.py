"""`wgpu-gi bench`: measures techniques and presets on scenes; prints tables, writes a JSON file and a plot."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable, Collection
from functools import partial
from itertools import product

from ..camera import Camera
from ..errors import GiError
from ..measure.bench import WARM_UP_FRAMES, Candidate, machine, measure_scene
from ..measure.bench_report import different_machine, load_json, ratio_table, ratios, save_json, tables
from ..measure.plot import PLOT_FORMATS, require_matplotlib, save_plot
from ..measure.results import PRESET, Report, SceneReport
from ..measure.truth import Progress, Truth, truth_by_path, truth_from_file
from ..options import TECHNIQUES, Settings, check_size
from ..scene.scene import Scene
from ..settings import QUALITIES, apply_quality, assign, validate
from .attribute import attribute_scenes, prepare
from .bench_parts import check_suffix, print_table, shown_scene
from .common import LISTS, print_settings, print_techniques, warn_of_cpu
from .messages import Messages

DEFAULT_SIZE = (640, 360)
# Without any of these, a survey measures all techniques at a small size; with one, the others have these values.
MEASURED = {"quality": "medium", "frames": 20, "truth": "path", "truth_spp": 256}
CHOICES = (*MEASURED, "gi", "set", "sweep", "moving", "attribute", "size", "json", "compare")
# Settings that --set and --sweep refuse, with the reason or the flag to use instead.
OWN_SETTINGS = {
    "gi": "use --gi",
    "diffuse": "use --diffuse",
    "spp": "a frame of the path tracer is one run; use --set path.samples_per_run",
    "camera.jitter": "pictures and truth are sampled at the pixel centres",
    "camera.frames": "pictures are sampled at the pixel centres, so there is nothing to average",
}
MOST_FRAMES, MOST_SPP = 100_000, 10_000_000


def bench(arguments: Namespace) -> int:
    """Run `wgpu-gi bench` and return the exit code. Raises GiError for an error that the user can fix."""
    if not set(LISTS).isdisjoint(arguments.set):
        print_settings(Settings(), everything=True)
        return 0
    if arguments.gi == "help":
        print_techniques()
        return 0
    say = Messages(arguments.verbose, arguments.quiet)
    choices = [getattr(arguments, name) for name in CHOICES]
    if all(choice is None or choice is False or choice == [] for choice in choices):
        from .bench_survey import survey

        return survey(arguments, say)
    for name, value in MEASURED.items():
        if getattr(arguments, name) is None:
            setattr(arguments, name, value)

    # Check the arguments before any slow step.
    if arguments.attribute:
        prepare(arguments)
    candidates = candidates_from(arguments)
    check_outputs(arguments)
    scenes = list(dict.fromkeys(arguments.scene))
    size = size_from(arguments, scenes)
    old = None if arguments.compare is None else load_json(arguments.compare)

    # Compare the machine with that of the earlier run.
    here = machine(arguments.adapter)
    warn_of_cpu(here["adapter"], here["is_cpu"], say)
    difference = None if old is None else different_machine(old, here)
    if difference is not None:
        say.warning(f"{arguments.compare} was {difference}")

    # Measure, write the files, print the tables.
    if arguments.attribute:
        attribute_scenes(arguments, here, candidates, say, print_table)
        return 0
    reports = [bench_scene(arguments, name, size, candidates, say) for name in scenes]
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
    """Return a candidate for each technique, quality and variant that the arguments ask for."""
    # The path tracer is always measured, as the reference.
    names = [name for name in TECHNIQUES if name != "path"]
    if arguments.gi is not None:
        names = _split("--gi", arguments.gi)
    qualities = _split("--quality", arguments.quality)
    checks: list[tuple[str, list[str], Collection[str]]] = [
        ("--gi", names, TECHNIQUES),
        ("--quality", qualities, QUALITIES),
    ]
    for flag, given, known in checks:
        for name in given:
            if name not in known:
                raise GiError(f"{flag} takes {', '.join(known)}, with commas between, not {name!r}")
    for flag, texts in (("--set", arguments.set), ("--sweep", arguments.sweep)):
        for text in texts:
            name = text.partition("=")[0].strip()
            # --attribute takes the frames of the still picture from there.
            if name in OWN_SETTINGS and not (arguments.attribute and name == "camera.frames"):
                raise GiError(f"bench sets {name} itself, so it does not take {flag} {text}: {OWN_SETTINGS[name]}")
    variants = [" ".join(texts) for texts in product(*map(_swept, arguments.sweep))]
    return [_candidate(arguments, *choice) for choice in product(names, qualities, variants)]


def _candidate(arguments: Namespace, gi: str, quality: str, variant: str) -> Candidate:
    """Return a technique with its settings, sampled at the pixel centres."""
    settings, preset = Settings(), Settings()
    apply_quality(settings, quality)
    apply_quality(preset, quality)
    for text in (*arguments.set, *variant.split()):
        assign(settings, text)
    title = f"{variant} {PRESET}" if variant and settings == preset else variant
    settings.gi, settings.diffuse, settings.camera.jitter = gi, arguments.diffuse, False
    if TECHNIQUES[gi].averages_samples:
        settings.spp = settings.path.samples_per_run  # a frame of the path tracer is one run
    validate(settings)
    return Candidate(gi, quality, settings, title)


def check_outputs(arguments: Namespace) -> None:
    """Raise GiError for numbers out of range and for output files that cannot be written."""
    for flag, number, least, most in (
        ("--frames", arguments.frames, 1, MOST_FRAMES),
        ("--truth-spp", arguments.truth_spp, 2, MOST_SPP),
        ("with --moving, --frames", arguments.frames if arguments.moving else 2, 2, MOST_FRAMES),
    ):
        if not least <= number <= most:
            raise GiError(f"{flag} must lie between {least} and {most}, not {number}")
    if arguments.json is not None:
        check_suffix("--json", arguments.json, (".json",))
    if arguments.plot is not None:
        check_suffix("--plot", arguments.plot, PLOT_FORMATS)
        require_matplotlib()


def size_from(arguments: Namespace, scenes: list[str]) -> tuple[int, int]:
    """Return the size of all pictures: `--size`, or that of the truth file. Raises GiError if the two differ."""
    size: tuple[int, int] = arguments.size or DEFAULT_SIZE
    if arguments.truth != "path":
        if len(scenes) > 1:
            raise GiError(
                f"--truth {arguments.truth} is for one scene, but {len(scenes)} are given; bench one at a time"
            )
        stored = truth_from_file(arguments.truth).size
        if arguments.size is not None and arguments.size != stored:
            raise GiError(
                f"{arguments.truth} is {stored[0]}x{stored[1]}, but --size asks for {size[0]}x{size[1]}; leave it out"
            )
        size = stored
    check_size(size)
    return size


def bench_scene(
    arguments: Namespace, name: str, size: tuple[int, int], candidates: list[Candidate], say: Messages
) -> SceneReport:
    """Load and measure one scene."""
    name, scene, camera = shown_scene(arguments, name, say)
    # All techniques are compared with the same path tracer.
    visible_only = candidates[0].settings.path.visible_only
    with say.progress(name) as bar:

        def report(what: str, fraction: float) -> None:
            bar(fraction, f"{name}: {what}")

        truth_of = truth_source(arguments, scene, camera, size, visible_only, report)

        def truth_at(bounces: int | None, time: float) -> Truth:
            return truth_source(arguments, scene.at(time), camera, size, visible_only, report)(bounces)

        try:
            techniques, references = measure_scene(
                scene,
                camera,
                size,
                candidates,
                truth_of,
                frames=arguments.frames,
                moving=arguments.moving,
                truth_at=truth_at if arguments.truth == "path" else None,
                adapter=arguments.adapter,
                progress=report,
            )
        except GiError as error:
            raise GiError(f"{name}: {error}") from None
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
    """Return a function that takes a number of indirect bounces and returns the truth of `--truth`."""
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
        print_table(title, table)
    here = report.machine
    print(f"{report.frames} frames each, on {here['adapter']}, {here['driver']}, {here['cores']} cores")


def print_ratios(old: Report, new: Report, old_name: str) -> None:
    """Print the ratios to an earlier report, or a sentence if no case is in both."""
    rows = ratios(old, new)
    if rows:
        print()
        print_table(f"now / {old_name}: below 1 is better", ratio_table(rows))
    else:
        print(f"{old_name} holds nothing with the same scene, size, settings and technique")


def _swept(text: str) -> list[str]:
    """Split `--sweep name=a,b` into name=a and name=b."""
    name, equals, values = text.partition("=")
    if not equals or not values.strip(" ,"):
        raise GiError(f"--sweep takes a setting and its values, such as vpl.count=512,2048, not {text!r}")
    return [f"{name.strip()}={value}" for value in _split("--sweep", values)]


def _split(flag: str, text: str) -> list[str]:
    names = [name.strip() for name in text.split(",") if name.strip()]
    if not names:
        raise GiError(f"{flag} takes names with commas between, not {text!r}")
    return list(dict.fromkeys(names))
