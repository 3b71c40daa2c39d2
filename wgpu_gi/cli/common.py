"""Makes settings, scene, renderer, buffers and a picture's metadata from the arguments of several commands."""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from ..buffers import buffers_of, views_of
from ..camera import Camera
from ..errors import GiError, known_names
from ..options import TECHNIQUES, Settings, uses
from ..renderer import Renderer
from ..reports import Report
from ..scene.files.camera_files import choose_camera
from ..scene.load import GLOW_NOTE, NO_CAMERA_NOTE, NO_LIGHT_NOTE, is_usd
from ..scene.pose import outside, start_of
from ..scene.scene import Scene
from ..sequence.source import SceneSource
from ..settings import apply_quality, assign, cells_of, describe, format_rows, validate
from ..version import __version__
from .budgets import flag_of_time, settle_time
from .messages import Messages

FLAGS = {"spp": "--spp", "seed": "--seed", "path.visible_only": "--visible-only"}  # settings with a flag of their own
REASONS = {
    "spp": "averages frames, set by camera.frames",
    "camera.frames": "averages samples, set by --spp",
    "camera.antialias": "averages jittered samples",
}
REMEDIES = dict.fromkeys((NO_LIGHT_NOTE, GLOW_NOTE), "--env or --light set others")
REMEDIES[NO_CAMERA_NOTE] = "--camera sets another"
DEFAULTS, QUALITY = Settings(), "medium"  # where the arguments give none
LISTS = ("help", "help=all")  # what --set takes in place of a setting


def list_names(arguments: Namespace) -> bool:
    """Print the techniques or the settings if the arguments ask for a list; return whether they do."""
    if arguments.gi == "help":
        print_techniques()
        return True
    if set(LISTS).isdisjoint(arguments.set):
        return False
    print_settings(settings_from(arguments), everything="help=all" in arguments.set)
    return True


def print_techniques() -> None:
    """Print the techniques, a sentence each."""
    print("\n".join(f"{name:<12} {technique.sentence}" for name, technique in TECHNIQUES.items()))


def print_settings(settings: Settings, everything: bool = False) -> None:
    """Print the settings that the technique uses, or all: wrapped on a terminal, else one per line."""
    rows = describe(settings)
    used = [row for row in rows if everything or uses(settings.gi, row.name)]
    if sys.stdout.isatty():
        from rich.console import Console
        from rich.markup import escape
        from rich.table import Table

        table = Table.grid(padding=(0, 2, 0, 0))
        table.add_column(no_wrap=True)
        for cells in cells_of(used):
            table.add_row(*map(escape, cells))
        Console(highlight=False).print(table)
    else:
        print(format_rows(used))
    if len(used) < len(rows):
        print(f"--gi {settings.gi} does not use {len(rows) - len(used)} more settings; --set help=all lists them")


def settings_from(arguments: Namespace, first: Sequence[str] = ()) -> Settings:
    """Return checked settings: from the flags, then `first`, then every `--set`. Later values win."""
    settings = Settings(
        gi=arguments.gi or DEFAULTS.gi,
        bounces=arguments.bounces,
        spp=DEFAULTS.spp if arguments.spp is None else arguments.spp,
        seed=arguments.seed,
        exposure=arguments.exposure,
        diffuse=arguments.diffuse,
        transparent=getattr(arguments, "transparent", False),
    )
    settings.path.visible_only = arguments.visible_only
    validate(settings)
    apply_quality(settings, arguments.quality or QUALITY)
    for text in (*first, *arguments.set):
        if text not in LISTS:
            assign(settings, text)
    return settings


def without_effect(settings: Settings, texts: Sequence[str]) -> list[str]:
    """Return a sentence for each flag and each `--set` (`texts`) that the technique ignores."""
    gi, technique, notes = settings.gi, TECHNIQUES[settings.gi], []
    most = technique.most_bounces
    if most is not None and (settings.bounces or 0) > most:
        notes.append(f"--gi {gi} has at most {most} indirect bounces, not {settings.bounces}")
    changed = {row.name for row in describe(settings) if row.name in FLAGS and row.value != row.default}
    given = [text.partition("=")[0].strip() for text in texts if text not in LISTS]
    for name in dict.fromkeys([*sorted(changed), *given]):
        if name != "bounces" and not uses(gi, name):
            reason = REASONS.get(name, "does not use it")
            notes.append(f"{FLAGS.get(name, name)} changes nothing: --gi {gi} {reason}")
    return notes


def source_of(arguments: Namespace, source: str) -> SceneSource:
    """Return what the arguments say about loading a scene; `settle_time` has been called."""
    return SceneSource(
        source,
        arguments.env,
        tuple(arguments.light),
        tuple(arguments.relight),
        arguments.max_memory,
        arguments.strict,
        arguments.point_size,
        arguments.time,
    )


def prepare_scene(arguments: Namespace, source: str, say: Messages) -> tuple[Scene, Camera]:
    """Load the scene of the arguments, choose its camera and print its notes."""
    settle_time(arguments, None)
    with say.timed(f"loading {source}"):
        scene = source_of(arguments, source).load()
        camera = choose_camera(scene, arguments.camera, Path(source).parent)
    settle_time(arguments, scene)
    notes = [*scene.notes, *outside(scene, time_of(arguments, source, scene), arguments.animation)]
    for note in notes:
        if note != NO_CAMERA_NOTE or arguments.camera is None:
            say.note(f"{note} ({REMEDIES[note]})" if note in REMEDIES else note)
    say.detail(
        f"{source}: {scene.triangle_count} triangles, {len(scene.instances)} instances, {len(scene.lights)} lights,"
        f" {'an' if scene.environment else 'no'} environment"
    )
    return scene, camera


def time_of(arguments: Namespace, source: str, scene: Scene) -> float | None:
    """Return the seconds at which to show the animation of the arguments; None for the scene as it stands.

    `--at` of a USD file is its time code. Raises GiError for an animation that the scene does not have.
    """
    time = None if is_usd(source) else arguments.time
    given = [
        flag
        for flag, value in ((flag_of_time(arguments), time), ("--animation", arguments.animation))
        if value is not None
    ]
    if given and not scene.animations:
        raise GiError(f"{source} has no animation for {' and '.join(given)}")
    return start_of(scene, time, arguments.animation)


def noted_scene(arguments: Namespace, settings: Settings, say: Messages) -> tuple[Scene, Camera]:
    """Load the scene of the arguments, choose its camera, print its notes, and those on settings without effect."""
    scene, camera = prepare_scene(arguments, arguments.scene, say)
    for note in without_effect(settings, arguments.set):
        say.note(note)
    return scene, camera


def renderer_from(
    arguments: Namespace, settings: Settings, say: Messages, size: tuple[int, int] | None = None
) -> Renderer:
    """Load the scene and return its renderer, of `size` (None: that of the arguments).

    Note settings without effect; warn of a slow adapter.
    """
    scene, camera = noted_scene(arguments, settings, say)
    renderer = Renderer(scene, size=size or arguments.size, camera=camera, settings=settings, adapter=arguments.adapter)
    renderer.time, renderer.animation = time_of(arguments, arguments.scene, scene), arguments.animation
    warn_of_cpu(renderer.adapter_name, renderer.is_cpu, say)
    return renderer


@contextmanager
def rendering(renderer: Renderer, say: Messages, what: str = "rendering") -> Iterator[Report]:
    """Yield a function that shows the progress of `renderer`; show which pipeline it compiles, too."""
    with say.progress(what) as report:
        renderer.on_compile = lambda done, count: report(0.0, f"compiling {done} of {count}")
        try:
            yield report
        finally:
            renderer.on_compile = None


def warn_of_cpu(adapter: str, is_cpu: bool, say: Messages) -> None:
    """Print the adapter as a detail; warn if it is a CPU."""
    if is_cpu:
        say.warning(f"{adapter} is a CPU, not a GPU: rendering is slow")
    else:
        say.detail(f"adapter: {adapter}")


def checked_buffers(names: Sequence[str], gi: str) -> list[str]:
    """Return the buffers to write, in order, without duplicates. Raises GiError for one that the technique lacks."""
    known = (*buffers_of(gi), *views_of(gi))
    for name in names:
        if name not in known:
            raise GiError(f"--gi {gi} has no buffer {name!r}; {known_names(name, known)}")
    return list(dict.fromkeys(names))


def metadata_of(arguments: Namespace, settings: Settings, adapter_name: str) -> dict[str, object]:
    """Return the metadata of a picture file. Equal commands give equal metadata, so files can be compared."""
    return {
        "software": f"wgpu_gi {__version__}",
        "scene": arguments.scene,
        "camera": "" if arguments.camera is None else arguments.camera,
        "time": "" if arguments.time is None else arguments.time,
        "animation": "" if arguments.animation is None else arguments.animation,
        "gi": settings.gi,
        "quality": arguments.quality or QUALITY,
        "bounces": "unlimited" if settings.bounces is None else settings.bounces,
        "spp": settings.spp,
        "seed": settings.seed,
        "diffuse": settings.diffuse,
        "transparent": settings.transparent,
        "denoise": arguments.denoise,
        "environment": arguments.env or "",
        "lights": "; ".join(arguments.light),
        "relight": "; ".join(arguments.relight),
        "settings": " ".join(arguments.set),
        "adapter": adapter_name,
    }
