"""The parser of the command line: its commands; their arguments are in the modules beside. Imports no slow module."""

from __future__ import annotations

import argparse
from typing import NoReturn

from ..errors import GiError
from ..version import __version__
from .dataset_arguments import add_dataset_arguments
from .epilogs import (
    BENCH_EPILOG,
    COMPARE_EPILOG,
    DATASET_EPILOG,
    FARM_EPILOG,
    INFO_EPILOG,
    MAIN_EPILOG,
    RENDER_EPILOG,
    REPORT_EPILOG,
    STRESS_EPILOG,
    VIEW_EPILOG,
)
from .farm_arguments import add_farm_commands
from .measure_arguments import (
    add_bench_arguments,
    add_compare_arguments,
    add_report_arguments,
    add_stress_arguments,
)
from .picture_arguments import add_message_arguments, add_picture_arguments, add_render_arguments, add_view_arguments

USAGE = "[OPTIONS] [SCENE]"
REPORT_USAGE = "[OPTIONS] [REPORT.json ...]"


class Parser(argparse.ArgumentParser):
    """An argument parser that reports an error in one sentence, as the rest of the program does."""

    def error(self, message: str) -> NoReturn:
        """Raise GiError instead of printing the usage."""
        raise GiError(f"{message} (see {self.prog} -h)")

    def parse_known_args(self, args=None, namespace=None):  # type: ignore[no-untyped-def]
        """Parse as the base class; of a command, also keep the arguments as they were typed, as `words`."""
        found, rest = super().parse_known_args(args, namespace)
        if not hasattr(found, "words"):
            found.words = list(args or ())
        return found, rest


def build_parser() -> Parser:
    """Return the parser of the whole command line."""
    verbatim = argparse.RawDescriptionHelpFormatter
    parser = Parser(
        prog="wgpu-gi",
        description="Global illumination on WebGPU.",
        epilog=MAIN_EPILOG,
        formatter_class=verbatim,
        allow_abbrev=False,
    )

    # The commands, each with a parser of its own.
    parser.add_argument("--version", action="version", version=f"wgpu_gi {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", title="commands", required=True)

    def command(name: str, sentence: str, epilog: str, usage: str | None = None) -> Parser:
        description = sentence[0].upper() + sentence[1:] + "."
        return commands.add_parser(
            name,
            help=sentence,
            description=description,
            epilog=epilog,
            usage=usage and f"wgpu-gi {name} {usage}",
            formatter_class=verbatim,
            allow_abbrev=False,
        )

    # Add the arguments of each command.
    render = command("render", "render a scene to a picture, or to a sequence of pictures", RENDER_EPILOG, USAGE)
    add_picture_arguments(render, size="640x360")
    add_render_arguments(render)
    add_message_arguments(render, "the output of --plan and --timings")
    view = command("view", "show a scene in a window", VIEW_EPILOG, USAGE)
    add_picture_arguments(view, size="960x540")
    add_view_arguments(view)
    add_message_arguments(view, "copied commands")
    add_compare_arguments(command("compare", "measure the error of a picture against a truth", COMPARE_EPILOG))
    bench = command("bench", "measure error and time of techniques", BENCH_EPILOG, "[OPTIONS] [SCENE ...]")
    add_bench_arguments(bench)
    add_message_arguments(bench, "the tables")
    farm = command("farm", "render a sequence on many machines", FARM_EPILOG, "COMMAND [OPTIONS] [SCENE]")
    add_farm_commands(farm)
    dataset = command("dataset", "make labelled frames of drawn scenes", DATASET_EPILOG, "[OPTIONS] CONFIG.toml")
    add_dataset_arguments(dataset)
    add_message_arguments(dataset, "the result")
    stress = command("stress", "test techniques on random scenes", STRESS_EPILOG, "[OPTIONS]")
    add_stress_arguments(stress)
    add_message_arguments(stress, "failures")
    report = command(
        "report", "measure an adapter: what it has, whether it is right, how fast", REPORT_EPILOG, REPORT_USAGE
    )
    add_report_arguments(report)
    add_message_arguments(report, "the verdict")
    info = command(
        "info", "list adapters, drivers and versions, and what is missing; or what a scene holds", INFO_EPILOG
    )
    info.add_argument("scene", nargs="?", metavar="SCENE", help="list its parts, cameras and animations instead")
    return parser
