"""`wgpu-gi farm template`: writes a job for another farm manager, from the arguments of `render --frames`."""

from __future__ import annotations

import argparse
import os
import shlex
from argparse import ArgumentParser, Namespace
from pathlib import Path

from ..errors import GiError
from ..farm.templates import SHARD, SLURM_MOST, JobArray, job_name, opencue_specification, openjd_template, slurm_script
from ..options import check_size
from ..pictures.atomic_file import atomic_file, check_writable
from ..pictures.image import check_format
from ..pictures.video import is_video
from ..rendering import check_denoise
from ..scene.files.environment_files import ENVIRONMENT_EXTENSIONS
from ..scene.files.light_texts import parse_light
from ..sequence.blocks import BLOCK
from ..sequence.files import FrameFiles
from .budgets import check_budget
from .certificates import pixels_of
from .common import checked_buffers, list_names, settings_from
from .farm_arguments import MANAGERS, OWN, add_template_arguments
from .frames import check_sequence, layers_of
from .messages import Messages
from .render import plan_of

TEMPLATES = dict(zip(MANAGERS, (openjd_template, slurm_script, opencue_specification), strict=True))
SUBMIT = {
    "openjd": "check it with: openjd check {}",
    "slurm": "submit it with: sbatch {}",
    "opencue": "submit it by opencue.api.launchSpecAndWait",
}


def template(arguments: Namespace) -> int:
    """Run `wgpu-gi farm template` and return the exit code. Raises GiError for an error that the user can fix."""
    if list_names(arguments):
        return 0
    say = Messages(arguments.verbose, arguments.quiet)
    _check(arguments)
    frames, to = arguments.frames, arguments.to
    if to is not None:
        check_writable(to)

    # One task per block of temporal memory, so that no task is empty.
    parts = arguments.tasks or min(-(-len(frames) // BLOCK), SLURM_MOST)
    if parts > len(frames):
        raise GiError(f"--tasks {parts}: there are only {len(frames)} frames")
    command = (*_program(arguments.program), "render", *words_of_render(arguments.words))
    text = TEMPLATES[arguments.manager](JobArray(job_name(arguments.scene), command, parts))

    if to is None:
        print(text, end="")
    else:
        with atomic_file(to) as temporary:
            temporary.write_text(text, encoding="utf-8", newline="\n")
        say.result(f"{to}: {parts} tasks for {len(frames)} frames; {SUBMIT[arguments.manager].format(shlex.quote(to))}")
    return 0


def _check(arguments: Namespace) -> None:
    """Raise GiError for arguments that the tasks would refuse, as far as it is known without the scene."""
    if arguments.frames is None:
        raise GiError("a job needs several frames; add --frames, such as --frames 0:240")
    if arguments.shard is not None:
        raise GiError(
            f"{SHARD} divides the frames among the tasks, and the job gives it; leave it out, or give --tasks"
        )
    if is_video(arguments.output):
        raise GiError(f"-o {arguments.output}: tasks write frames, such as f_{{frame:04d}}.exr, and no video")
    settings = settings_from(arguments)
    shown = checked_buffers(arguments.show or ["radiance"], settings.gi)
    check_size(arguments.size)
    check_denoise(arguments.denoise, ["radiance"], settings.gi)
    plan_of(arguments, settings)
    pixels_of(arguments, shown)
    check_budget(arguments)
    layers = layers_of(arguments, settings)
    check_sequence(arguments, shown, settings)
    for text in arguments.light:
        parse_light(text)
    FrameFiles(arguments.output, shown, layers, settings.transparent)
    check_format(arguments.output, shown, settings.transparent)


def _program(text: str) -> list[str]:
    """Return the words of `--program`."""
    try:
        words = shlex.split(text)
    except ValueError as error:
        raise GiError(f"--program {text}: {error}") from None
    if not words:
        raise GiError("--program is how a machine of the farm starts wgpu-gi, such as /opt/gi/bin/wgpu-gi")
    return words


def words_of_render(words: list[str]) -> list[str]:
    """Return the arguments of `render` among those of `farm template`, the scene first, file names made absolute.

    Tasks may run in any folder. Other values stay as they were typed.
    """
    # Parse again, without types and defaults: what is left are the texts that were given.
    parser = ArgumentParser(add_help=False, allow_abbrev=False)
    add_template_arguments(parser)
    for action in parser._actions:
        action.type, action.default, action.choices = None, argparse.SUPPRESS, None
    given = vars(parser.parse_args(words))

    found = []
    for action in parser._actions:
        if action.dest not in given or action.dest in OWN:
            continue
        value = given[action.dest]
        flag = action.option_strings[-1] if action.option_strings else ""
        for text in value if isinstance(value, list) else [value]:
            if text is True:
                found.append(flag)
            elif not flag:
                found.insert(0, _placed(action.dest, text))
            else:
                text = _placed(action.dest, text)
                found += [f"{flag}={text}"] if text.startswith("-") else [flag, text]
    return found


def _placed(name: str, text: str) -> str:
    """Return the value of an argument; that of a file with its folder. A scene without an extension is built in."""
    extension = Path(text).suffix.lower()
    is_file = {
        "output": True,
        "camera_path": True,
        "scene": extension != "",
        "env": extension in ENVIRONMENT_EXTENSIONS,
        "camera": extension == ".json",
    }
    return os.path.abspath(text) if is_file.get(name, False) else text
