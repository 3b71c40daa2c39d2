"""The arguments of the commands of `wgpu-gi farm`."""

from __future__ import annotations

from argparse import ArgumentParser, RawDescriptionHelpFormatter

from .argument_types import parse_tasks
from .epilogs import TEMPLATE_EPILOG
from .picture_arguments import add_message_arguments, add_picture_arguments, add_render_arguments

MANAGERS = ("openjd", "slurm", "opencue")
OWN = ("manager", "to", "tasks", "program")  # the arguments of `farm template` that are not those of `render`


def add_farm_commands(parser: ArgumentParser) -> None:
    """Add the commands of `farm`."""
    commands = parser.add_subparsers(dest="farm_command", metavar="COMMAND", title="commands", required=True)
    sentence = "write a job for OpenJD, Slurm or OpenCue"
    add_template_arguments(
        commands.add_parser(
            "template",
            help=sentence,
            description=f"{sentence[0].upper()}{sentence[1:]}.",
            epilog=TEMPLATE_EPILOG,
            usage="wgpu-gi farm template --for MANAGER [OPTIONS] [SCENE]",
            formatter_class=RawDescriptionHelpFormatter,
            allow_abbrev=False,
        )
    )


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
