"""What several commands share: scene, settings and buffers from arguments, a progress bar, a record."""

from __future__ import annotations

import math
import signal
import sys
from argparse import Namespace
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

from ..buffers import buffers_of, views_of
from ..errors import GiError
from ..options import TECHNIQUES, Settings
from ..renderer import Renderer
from ..scene.files.camera_files import choose_camera
from ..scene.files.environment_files import load_environment
from ..scene.files.light_texts import parse_light, relight
from ..scene.load import NO_CAMERA_NOTE, load
from ..scene.scene import Scene
from ..settings import apply_quality, assign, describe, format_rows, validate
from ..version import __version__


def list_names(arguments: Namespace) -> bool:
    """Print the techniques or the settings if that is what is asked for; return whether it is."""
    if arguments.gi == "help":
        print("\n".join(f"{name:<12} {technique.sentence}" for name, technique in TECHNIQUES.items()))
        return True
    if "help" in arguments.set:
        print(format_rows(describe(settings_from(arguments))))
        return True
    return False


def renderer_from(arguments: Namespace, settings: Settings) -> Renderer:
    """Load the scene and return a renderer of it, with notes and warnings to a person printed."""
    scene = scene_from(arguments)
    camera = choose_camera(scene, arguments.camera, Path(arguments.scene).parent)
    for note in scene.notes:
        if note != NO_CAMERA_NOTE or arguments.camera is None:
            print(f"note: {note}", file=sys.stderr)
    for note in without_effect(settings):
        print(f"note: {note}", file=sys.stderr)
    renderer = Renderer(scene, size=arguments.size, camera=camera, settings=settings, adapter=arguments.adapter)
    if renderer.is_cpu:
        print(f"warning: {renderer.adapter_name} IS A CPU, not a GPU: this is slow", file=sys.stderr)
    return renderer


def settings_from(arguments: Namespace) -> Settings:
    """Return the settings that the flags and then every `--set` ask for, checked."""
    if not math.isfinite(arguments.exposure):
        raise GiError(f"--exposure takes a finite number of stops, not {arguments.exposure}")
    settings = Settings(
        gi=arguments.gi,
        bounces=arguments.bounces,
        spp=arguments.spp,
        seed=arguments.seed,
        exposure=arguments.exposure,
        diffuse=arguments.diffuse,
    )
    settings.path.visible_only = arguments.visible_only
    validate(settings)
    apply_quality(settings, arguments.quality)
    for text in arguments.set:
        if text != "help":
            assign(settings, text)
    return settings


def without_effect(settings: Settings) -> list[str]:
    """Return a sentence for each setting that is not the default and that the technique has no use for."""
    notes = []
    gi = settings.gi
    most = TECHNIQUES[gi].most_bounces
    if most is not None and (settings.bounces or 0) > most:
        notes.append(f"--gi {gi} has at most {most} indirect bounces, not {settings.bounces}")
    if gi != "path" and settings.spp != Settings().spp:
        notes.append(f"--gi {gi} averages frames, set by camera.frames; spp={settings.spp} changes nothing")
    if gi != "path" and settings.path.visible_only:
        notes.append(f"--gi {gi} is no truth; --visible-only changes nothing")
    return notes


def buffers_from(arguments: Namespace, settings: Settings) -> list[str]:
    """Return the buffers to write, each once, in the order given."""
    shown = list(dict.fromkeys(arguments.show or ["radiance"]))
    known = (*buffers_of(settings.gi), *views_of(settings.gi))
    for name in shown:
        if name not in known:
            raise GiError(f"with --gi {settings.gi}, --show takes one of {', '.join(known)}, not {name!r}")
    return shown


def scene_from(arguments: Namespace) -> Scene:
    """Load the scene, with the environment and the lights of the command line."""
    notes: list[str] = []
    lights = [parse_light(text) for text in arguments.light]
    environment = None if arguments.env is None else load_environment(arguments.env, notes)
    scene = load(arguments.scene, environment=environment, lights=lights)
    scene.notes.extend(notes)
    for text in arguments.relight:
        relight(scene, text)
    return scene


def metadata_of(arguments: Namespace, settings: Settings, adapter_name: str) -> dict[str, object]:
    """Return what a picture file says of its making; the same for the same command, so that files can be compared."""
    return {
        "software": f"wgpu_gi {__version__}",
        "scene": arguments.scene,
        "camera": "" if arguments.camera is None else arguments.camera,
        "gi": settings.gi,
        "quality": arguments.quality,
        "bounces": "unlimited" if settings.bounces is None else settings.bounces,
        "spp": settings.spp,
        "seed": settings.seed,
        "diffuse": settings.diffuse,
        "environment": arguments.env or "",
        "lights": "; ".join(arguments.light),
        "relight": "; ".join(arguments.relight),
        "settings": " ".join(arguments.set),
        "adapter": adapter_name,
    }


@contextmanager
def progress_bar() -> Iterator[Callable[[float], None] | None]:
    """Yield a function that takes the fraction done, or None where no person watches.

    The function raises KeyboardInterrupt if Ctrl+C came while C code called Python back, which drops exceptions.
    """
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import Progress

    interrupted = False

    def interrupt(number: int, frame: FrameType | None) -> None:
        nonlocal interrupted
        interrupted = True
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGINT, interrupt)
    try:
        with Progress(console=Console(stderr=True), transient=True) as progress:
            task = progress.add_task("rendering", total=1.0)

            def report(fraction: float) -> None:
                if interrupted:
                    raise KeyboardInterrupt
                progress.update(task, completed=fraction)

            yield report
    finally:
        signal.signal(signal.SIGINT, before)
