"""What `wgpu-gi bench` and its survey share: scenes as they are shown, tables, names of files."""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path

from rich.console import Console
from rich.table import Table

from ..camera import Camera
from ..errors import GiError
from ..pictures.atomic_file import check_writable
from ..scene.player import find_animation
from ..scene.pose import Pose
from ..scene.scene import Scene
from .common import prepare_scene, time_of
from .messages import Messages

TABLE_WIDTH = 140  # characters, if the output is no terminal


def shown_scene(arguments: Namespace, source: str, say: Messages) -> tuple[str, Scene, Camera]:
    """Load a scene; return its name for titles, what it shows at the time of the arguments, and its camera."""
    scene, camera = prepare_scene(arguments, source, say)
    time = time_of(arguments, source, scene)
    scene, camera = Pose().at(scene, camera, time, arguments.animation)
    if time is None:
        return source, scene, camera
    return f"{source}, {find_animation(scene, arguments.animation).name or 'animation'} at {time:g} s", scene, camera


def print_table(title: str, table: Table) -> None:
    """Print a title and a table."""
    console = Console(highlight=False, width=None if sys.stdout.isatty() else TABLE_WIDTH)
    console.print(title, style="bold", markup=False, soft_wrap=True)
    console.print(table)
    console.print()


def check_suffix(flag: str, path: str, suffixes: tuple[str, ...]) -> None:
    """Raise GiError for a file name without one of the suffixes, or that cannot be written."""
    if Path(path).suffix.lower() not in suffixes:
        raise GiError(f"{flag} takes a file name that ends in {' or '.join(suffixes)}, not {path!r}")
    check_writable(path)
