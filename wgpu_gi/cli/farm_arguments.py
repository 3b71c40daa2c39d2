"""The arguments of the commands of `wgpu-gi farm`."""

from __future__ import annotations

from argparse import ArgumentParser, RawDescriptionHelpFormatter

from ..farm.defaults import FARM_TILE, THREADS
from .argument_types import parse_count, parse_tasks, parse_tiles
from .epilogs import FARM_RENDER_EPILOG, TEMPLATE_EPILOG
from .picture_arguments import add_message_arguments, add_picture_arguments, add_render_arguments

MANAGERS = ("openjd", "slurm", "opencue")
OWN = ("manager", "to", "tasks", "program")  # the arguments of `farm template` that are not those of `render`


def add_farm_commands(parser: ArgumentParser) -> None:
    """Add the commands of `farm`."""
    commands = parser.add_subparsers(dest="farm_command", metavar="COMMAND", title="commands", required=True)

    def command(name: str, sentence: str, epilog: str, usage: str) -> ArgumentParser:
        return commands.add_parser(
            name,
            help=sentence,
            description=f"{sentence[0].upper()}{sentence[1:]}.",
            epilog=epilog,
            usage=f"wgpu-gi farm {name} {usage}",
            formatter_class=RawDescriptionHelpFormatter,
            allow_abbrev=False,
        )

    sentence = "render a sequence, or a large picture, by many processes, on this machine or by a Dask cluster"
    add_farm_render_arguments(
        command("render", sentence, FARM_RENDER_EPILOG, "--frames A:B|--farm-tiles [OPTIONS] [SCENE]")
    )
    sentence = "write a job for OpenJD, Slurm or OpenCue"
    add_template_arguments(command("template", sentence, TEMPLATE_EPILOG, "--for MANAGER [OPTIONS] [SCENE]"))


def add_farm_render_arguments(parser: ArgumentParser) -> None:
    """Add the arguments of `render` and of the workers."""
    add = parser.add_argument_group("workers").add_argument
    add("--scheduler", metavar="ADDRESS", help="use the workers of a Dask scheduler, such as tcp://host:8786")
    add(
        "--workers",
        type=parse_count,
        metavar="N",
        help="start N processes on this machine; default one for each GPU, else for each --threads cores",
    )
    add("--threads", type=parse_count, metavar="N", help=f"cores of a process that renders on a CPU, default {THREADS}")
    add("--gather", action="store_true", help="send the pictures to this machine: no folder is shared with the workers")
    add(
        "--farm-tiles",
        dest="tiles",
        nargs="?",
        const=FARM_TILE,
        default=False,
        type=parse_tiles,
        metavar="N|WxH",
        help="render one picture in N tiles, or in tiles of WxH pixels, default {}x{}; as --tiles".format(*FARM_TILE),
    )
    add_picture_arguments(parser, size="640x360")
    add_render_arguments(parser)
    add_message_arguments(parser, "the names of failed frames")


def add_template_arguments(parser: ArgumentParser) -> None:
    """Add the arguments of `render` and of the job."""
    add = parser.add_argument_group("job").add_argument
    add("--for", dest="manager", required=True, choices=MANAGERS, help="the farm manager")
    add("--to", metavar="FILE", help="write the job to a file; default standard output")
    add(
        "--tasks",
        type=parse_tasks,
        metavar="N",
        help="divide the frames among N tasks; default one for each 32 frames, at most 1000",
    )
    add(
        "--program",
        default="wgpu-gi",
        metavar="COMMAND",
        help="how a machine of the farm starts wgpu-gi, such as /opt/gi/bin/wgpu-gi; default wgpu-gi",
    )
    add_picture_arguments(parser, size="640x360")
    add_render_arguments(parser)
    add_message_arguments(parser, "the job")
