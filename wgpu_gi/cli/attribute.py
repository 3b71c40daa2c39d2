"""`wgpu-gi bench --attribute`: says what the error of a technique is due to, and which setting to raise."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable, Sequence
from typing import Any

from rich.table import Table

from ..errors import GiError
from ..measure.attribute import attribute
from ..measure.attribute_report import Entry, advice, save_json, save_plot, tables
from ..measure.bench import Candidate
from ..measure.truth import Truth, truth_by_path
from ..options import TECHNIQUES
from ..scene.pose import Pose
from .common import prepare_scene, time_of
from .messages import Messages

SIZE = (160, 90)  # if none is given: a technique takes one to two hundred frames
MOST_PIXELS = 640 * 360  # the pictures take up to 1 GiB
TECHNIQUE = "many-light"  # if none is given


def prepare(arguments: Namespace) -> None:
    """Set the defaults of --attribute. Raises GiError for flags that it does not take."""
    for flag, given in (
        ("--sweep", arguments.sweep),
        ("--moving", arguments.moving),
        ("--compare", arguments.compare),
        ("--truth", arguments.truth != "path"),
    ):
        if given:
            raise GiError(f"--attribute renders its own truths and settings, so it does not take {flag}")
    arguments.gi = arguments.gi or TECHNIQUE
    for name in arguments.gi.split(","):
        if name.strip() in TECHNIQUES and not TECHNIQUES[name.strip()].stages:
            raise GiError(f"--attribute exchanges the stages of a technique, and {name.strip()} has none")
    arguments.size = arguments.size or SIZE
    width, height = arguments.size
    if width * height > MOST_PIXELS:
        raise GiError(f"--attribute holds some hundred pictures, so --size {width}x{height} is too large; 640x360 fits")


def attribute_scenes(
    arguments: Namespace,
    machine: dict[str, Any],
    candidates: Sequence[Candidate],
    say: Messages,
    print_table: Callable[[str, Table], None],
) -> None:
    """Measure every candidate in every scene; write the files and print tables and advice."""
    scenes = dict.fromkeys(arguments.scene)
    entries = [_entry(arguments, name, candidate, say) for name in scenes for candidate in candidates]
    if arguments.json is not None:
        save_json(arguments.json, machine, entries)
    if arguments.plot is not None:
        save_plot(arguments.plot, entries)
    for entry in entries:
        for title, table in tables(entry):
            print_table(title, table)
        for sentence in advice(entry):
            print(sentence)
        print()
    print(f"{arguments.frames} frames are timed with each setting, on {machine['adapter']}, {machine['driver']}")


def _entry(arguments: Namespace, name: str, candidate: Candidate, say: Messages) -> Entry:
    """Load one scene and measure one candidate."""
    scene, camera = prepare_scene(arguments, name, say)
    scene, camera = Pose().at(scene, camera, time_of(arguments, name, scene), arguments.animation)
    given = candidate.settings.path.visible_only
    # The number of settings to try is not known before the parts are.
    with say.progress(f"{name}, {candidate.gi}", known=False) as bar:

        def report(what: str, fraction: float) -> None:
            bar(fraction, f"{name}, {candidate.gi}: {what}")

        def truth_of(bounces: int | None, visible: bool) -> Truth:
            return truth_by_path(
                scene,
                camera,
                arguments.size,
                spp=arguments.truth_spp,
                bounces=bounces,
                diffuse=arguments.diffuse,
                visible_only=visible or given,
                adapter=arguments.adapter,
                progress=report,
            )

        try:
            found = attribute(
                scene,
                camera,
                arguments.size,
                candidate.settings,
                truth_of,
                timed=arguments.frames,
                adapter=arguments.adapter,
                progress=report,
            )
        except GiError as error:
            raise GiError(f"{name}: {error}") from None
    return Entry(name, candidate.gi, candidate.quality, arguments.size, found)
