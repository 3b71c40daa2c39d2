"""The arguments of every command, their help, and the parsers of their values. Imports no slow module."""

from __future__ import annotations

import argparse
import math
import re
from typing import NoReturn

from ..errors import GiError
from ..scene.files.memory import GIB, MAX_MEMORY
from ..settings import QUALITIES
from ..version import __version__
from .epilogs import (
    BENCH_EPILOG,
    COMPARE_EPILOG,
    INFO_EPILOG,
    MAIN_EPILOG,
    RENDER_EPILOG,
    REPORT_EPILOG,
    STRESS_EPILOG,
    VIEW_EPILOG,
)

CAMERA_HELP = (
    "a camera of the scene by name or index; auto: from outside, or from inside of a room; inside: at eye height; a"
    ' .json file, or its text such as \'{"position": [0, 1, 5], "target": [0, 1, 0]}\'; default the first, else auto'
)


class Parser(argparse.ArgumentParser):
    """An argument parser that reports an error in one sentence, as the rest of the program does."""

    def error(self, message: str) -> NoReturn:
        """Raise GiError instead of printing the usage."""
        raise GiError(f"{message} (see {self.prog} -h)")


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
    _add_picture_arguments(render, size="640x360")
    _add_render_arguments(render)
    _add_messages(render, "the output of --plan and --timings")
    view = command("view", "show a scene in a window", VIEW_EPILOG, USAGE)
    _add_picture_arguments(view, size="960x540")
    _add_messages(view, "copied commands")
    _add_compare_arguments(command("compare", "measure the error of a picture against a truth", COMPARE_EPILOG))
    bench = command("bench", "measure error and time of techniques", BENCH_EPILOG, "[OPTIONS] [SCENE ...]")
    _add_bench_arguments(bench)
    _add_messages(bench, "the tables")
    stress = command("stress", "test techniques on random scenes", STRESS_EPILOG, "[OPTIONS]")
    _add_stress_arguments(stress)
    _add_messages(stress, "failures")
    report = command(
        "report", "measure an adapter: what it has, whether it is right, how fast", REPORT_EPILOG, REPORT_USAGE
    )
    _add_report_arguments(report)
    _add_messages(report, "the verdict")
    info = command(
        "info", "list adapters, drivers and versions, and what is missing; or what a scene holds", INFO_EPILOG
    )
    info.add_argument("scene", nargs="?", metavar="SCENE", help="list its parts, cameras and animations instead")
    return parser


USAGE = "[OPTIONS] [SCENE]"
REPORT_USAGE = "[OPTIONS] [REPORT.json ...]"
ADAPTER_HELP = "use the adapter whose name contains NAME (wgpu-gi info lists them)"
STRICT_HELP = "refuse damaged files; by default a damaged part is left out, with a note"
SET_HELP = "change a setting, repeatable; 'help' lists the technique's settings, 'help=all' lists all"


def _add_picture_arguments(parser: Parser, size: str) -> None:
    # What to render.
    scene = parser.add_argument_group("scene")
    scene.add_argument(
        "scene", nargs="?", default="cornell", metavar="SCENE", help="a file or a built-in scene, default cornell"
    )
    scene.add_argument("--camera", metavar="CAMERA", help=CAMERA_HELP)
    _add_light_arguments(scene)
    _add_loading_arguments(scene)

    # How to light it.
    technique = parser.add_argument_group("technique")
    add = technique.add_argument
    add(
        "--gi",
        default="many-light",
        metavar="GI",
        help="technique, default many-light; 'help' lists them, 'path' is the truth",
    )
    add("--quality", choices=QUALITIES, default="medium", help="preset of the settings, default medium")
    add("--bounces", type=parse_bounces, metavar="N", help="indirect bounces: 0, 1 ... or unlimited, the default")
    add("--spp", type=int, default=64, metavar="N", help="samples per pixel of --gi path, default 64")
    add("--visible-only", action="store_true", help="with --gi path: only surfaces in the picture send light")
    add("--seed", type=int, default=0, metavar="N", help="seed of the random numbers, default 0")
    add("--set", action="append", default=[], metavar="NAME=VALUE", help=SET_HELP)

    # How to show it.
    picture = parser.add_argument_group("picture")
    add = picture.add_argument
    add("--size", type=parse_size, default=parse_size(size), metavar="WxH", help=f"pixels, default {size}")
    add("--exposure", type=parse_exposure, metavar="EV", help="scale the displayed picture by 2^EV; default automatic")
    add("--adapter", metavar="NAME", help=ADAPTER_HELP)


def _add_light_arguments(group: argparse._ArgumentGroup) -> None:
    add = group.add_argument
    add("--env", metavar="ENV", help="environment: an .hdr or .exr file, or a constant radiance R,G,B")
    add(
        "--light",
        action="append",
        default=[],
        metavar="LIGHT",
        help='add "sun dx,dy,dz r,g,b", "point x,y,z r,g,b" or "spot x,y,z dx,dy,dz r,g,b OUTER,INNER" (angles from its'
        " axis in degrees, default 45,0), repeatable",
    )
    add(
        "--relight",
        action="append",
        default=[],
        metavar="LIGHT=R,G,B",
        help="change a light of the scene, by name or index, in candela or lux, repeatable; for a sun also the"
        ' direction, "LIGHT=r,g,b dx,dy,dz"; "env=r,g,b degrees" tints and rotates the environment',
    )


def _add_loading_arguments(group: argparse._ArgumentGroup) -> None:
    add = group.add_argument
    add("--diffuse", action="store_true", help="treat every material as Lambert with its base colour")
    add(
        "--max-memory",
        type=parse_memory,
        default=MAX_MEMORY,
        metavar="GIB",
        help=f"the most that a file may unpack to, default {MAX_MEMORY / GIB:g} GiB",
    )
    add("--strict", action="store_true", help=STRICT_HELP)
    add(
        "--point-size",
        type=parse_length,
        metavar="METRES",
        help="diameter of the discs or spheres that show points without faces, default twice their spacing",
    )
    add(
        "--time",
        type=parse_time,
        metavar="T",
        help="seconds at which an animation is shown; of a USD file the time code, default its start",
    )
    add("--animation", metavar="NAME", help="the animation, by name or index; default the first")


def _add_render_arguments(parser: Parser) -> None:
    # Files and reports.
    output = parser.add_argument_group("output")
    add = output.add_argument
    add(
        "-o",
        "--output",
        default="out.png",
        metavar="OUT",
        help=".png .jpg .webp .exr .hdr .npy .npz, with --frames .mp4; default out.png",
    )
    add("--transparent", action="store_true", help="leave the environment out of the background; the file gets alpha")
    add(
        "--show",
        action="append",
        default=[],
        metavar="BUFFER",
        help="buffer to write, repeatable, default radiance; 'help' lists them",
    )
    add("--plan", action="store_true", help="print which passes ran, and why others did not")
    add("--timings", action="store_true", help="print the time of each pass")
    add("--check", action="store_true", help="name the first pass that writes a NaN or an infinity (slow)")

    # Several frames.
    sequence = parser.add_argument_group("sequence")
    add = sequence.add_argument
    add(
        "--frames",
        type=parse_frames,
        metavar="A:B[:STEP]",
        help="render frames; OUT contains {frame}, such as f_{frame:04d}.exr",
    )
    add("--turntable", action="store_true", help="move the camera once round the scene")
    add("--camera-path", metavar="FILE", help="move the camera along the keys of a .json file")
    add("--layers", default="", metavar="A,B,C", help="buffers to write to an .npz beside each frame")
    add("--shard", type=parse_shard, metavar="I/N", help="render part I of N of the frames, from 1/N to N/N")
    add(
        "--fps", type=int, default=24, metavar="N", help="frames per second of the animation and of an .mp4, default 24"
    )


def _add_messages(parser: Parser, asked: str) -> None:
    group = parser.add_argument_group("messages").add_mutually_exclusive_group()
    group.add_argument("-v", "--verbose", action="store_true", help="also print sizes and times of loading")
    group.add_argument("-q", "--quiet", action="store_true", help=f"print only errors and {asked}")


def _add_compare_arguments(parser: Parser) -> None:
    add = parser.add_argument
    add("image", metavar="A", help="the picture: FILE or FILE:LAYER")
    add("truth", metavar="B", help="the truth that A is measured against")
    add("--layer", metavar="LAYER", help="the layer of A and B, unless they name one")
    add("--noise", metavar="C", help="standard error of the truth: FILE or FILE:LAYER")
    add("--mask", metavar="MASK", help=".png or FILE:LAYER with at most 64 values: one region, and row, per value")
    add("--html", default="compare.html", metavar="OUT", help="the page to write, default compare.html")
    add("--no-html", dest="html", action="store_const", const=None, help="write no page")
    add("--json", metavar="OUT", help="write the numbers to this .json")


def _add_bench_arguments(parser: Parser) -> None:
    # Scenes.
    scene = parser.add_argument_group("scene")
    scene.add_argument(
        "scene", nargs="*", default=["cornell"], metavar="SCENE", help="files or built-in scenes, default cornell"
    )
    scene.add_argument(
        "--size", type=parse_size, metavar="WxH", help="pixels, default 640x360 or that of the --truth file"
    )
    scene.add_argument("--camera", metavar="CAMERA", help=CAMERA_HELP)
    _add_light_arguments(scene)
    _add_loading_arguments(scene)

    # Techniques and settings.
    technique = parser.add_argument_group("what to measure")
    add = technique.add_argument
    add("--gi", metavar="A,B,C", help="techniques, default all; path is always measured, as the reference")
    add("--quality", default="medium", metavar="A,B,C", help="some of low,medium,high; default medium")
    add(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="change a setting, repeatable; 'help' lists them",
    )
    add("--sweep", action="append", default=[], metavar="NAME=A,B", help="measure every value of a setting, repeatable")
    add("--frames", type=int, default=20, metavar="N", help="frames measured in each case, default 20")
    add("--moving", action="store_true", help="measure flicker, lag and ghosts of moving pictures, too")
    add("--truth", default="path", metavar="FILE", help="an .npz or .exr with layers; path, the default, renders it")
    add("--truth-spp", type=int, default=256, metavar="N", help="samples per pixel of --truth path, default 256")
    add("--adapter", metavar="NAME", help=ADAPTER_HELP)

    # Reports.
    output = parser.add_argument_group("output")
    add = output.add_argument
    add("--json", metavar="OUT", help="write all numbers to this .json")
    add("--plot", metavar="OUT", help="plot error against time to this .png, .svg or .pdf")
    add("--compare", metavar="OLD", help="print the ratios to this .json of an earlier run")


def _add_stress_arguments(parser: Parser) -> None:
    # Scenes.
    scene = parser.add_argument_group("scenes")
    add = scene.add_argument
    add("--kinds", metavar="A,B,C", help="kinds of random scenes, default all")
    add("--seeds", type=parse_seeds, default=range(0, 100), metavar="A:B", help="seeds A to B-1, default 0:100")
    add("--scene", metavar="FILE", help="a file or a built-in scene instead of random ones")
    add("--strict", action="store_true", help=f"with --scene: {STRICT_HELP}")
    add("--env", metavar="ENV", help="with --scene: an .hdr or .exr file, or a constant radiance R,G,B")
    add("--size", type=parse_size, default=(64, 36), metavar="WxH", help="pixels, default 64x36")

    # Techniques, checks and budget.
    what = parser.add_argument_group("what to check")
    add = what.add_argument
    add("--gi", metavar="A,B,C", help="techniques, default all")
    add("--quality", default="medium", metavar="A,B,C", help="some of low,medium,high; default medium")
    add("--checks", default="turns", metavar="A,B,C", help="checks, or 'all'; default: in turns; 'help' lists them")
    add("--set", action="append", default=[], metavar="NAME=VALUE", help="change a setting, repeatable")
    add("--minutes", type=float, metavar="M", help="stop after M minutes")
    add("--reduce", type=float, default=60.0, metavar="S", help="seconds to reduce a failing scene, default 60; 0: not")
    add("--adapter", metavar="NAME", help=ADAPTER_HELP)

    # Reports.
    output = parser.add_argument_group("output")
    add = output.add_argument
    add("-o", "--output", metavar="FOLDER", help="write index.html and the scenes of failures to this folder")
    add("--json", metavar="OUT", help="write all numbers to this .json")


def _add_report_arguments(parser: Parser) -> None:
    add = parser.add_argument
    add("report", nargs="*", metavar="REPORT.json", help="earlier reports to show side by side; nothing is measured")
    add("-o", "--output", default="report", metavar="NAME", help="write NAME.json and NAME.html, default report")
    add(
        "--against",
        action="append",
        default=[],
        metavar="OTHER.json",
        help="show the report of another adapter beside this one, repeatable",
    )
    add("--sponza", metavar="FILE", help="also measure Crytek's Sponza, which the package does not ship")
    add("--minutes", type=float, default=7.0, metavar="M", help="leave out what does not fit in M minutes, default 7")
    add("--markdown", action="store_true", help="print the tables as Markdown")
    add("--adapter", metavar="NAME", help=ADAPTER_HELP)


def parse_size(text: str) -> tuple[int, int]:
    """Parse text such as 640x360 as (width, height) in pixels."""
    match = re.fullmatch(r"(\d{1,9})x(\d{1,9})", text)
    if match is None:
        raise argparse.ArgumentTypeError(f"a size is WIDTHxHEIGHT in pixels, such as 640x360, not {text!r}")
    return int(match[1]), int(match[2])


def parse_frames(text: str) -> range:
    """Parse text such as 0:240 or 0:240:2 as frame numbers."""
    match = re.fullmatch(r"(\d{1,9}):(\d{1,9})(?::([1-9]\d{0,8}))?", text)
    frames = range(int(match[1]), int(match[2]), int(match[3] or 1)) if match else range(0)
    if not frames:
        raise argparse.ArgumentTypeError(f"frames are FIRST:END or FIRST:END:STEP, such as 0:240, not {text!r}")
    return frames


def parse_seeds(text: str) -> range:
    """Parse text such as 0:100 as seeds."""
    match = re.fullmatch(r"(\d{1,9}):(\d{1,9})", text)
    seeds = range(int(match[1]), int(match[2])) if match else range(0)
    if not seeds:
        raise argparse.ArgumentTypeError(f"seeds are FIRST:END, such as 0:100, not {text!r}")
    return seeds


def parse_shard(text: str) -> tuple[int, int]:
    """Parse text such as 2/8 as (I, N)."""
    match = re.fullmatch(r"(\d{1,6})/(\d{1,6})", text)
    if match is None or not 1 <= int(match[1]) <= int(match[2]):
        raise argparse.ArgumentTypeError(f"a shard is I/N from 1/N to N/N, such as 2/8, not {text!r}")
    return int(match[1]), int(match[2])


def parse_memory(text: str) -> int:
    """Parse a number of GiB as bytes."""
    try:
        size = float(text) * GIB
    except ValueError:
        size = math.nan
    if not 1 <= size <= 2**60:
        raise argparse.ArgumentTypeError(f"memory is a number of GiB above 0, such as 8, not {text!r}")
    return int(size)


def parse_length(text: str) -> float:
    """Parse a number of metres above 0."""
    try:
        length = float(text)
    except ValueError:
        length = math.nan
    if not 0 < length < math.inf:
        raise argparse.ArgumentTypeError(f"a length is a number of metres above 0, not {text!r}")
    return length


def parse_time(text: str) -> float:
    """Parse a time code, a finite number."""
    try:
        time = float(text)
    except ValueError:
        time = math.nan
    if not math.isfinite(time):
        raise argparse.ArgumentTypeError(f"a time is a number, not {text!r}")
    return time


def parse_bounces(text: str) -> int | None:
    """Parse a number of indirect bounces; None means unlimited."""
    if text == "unlimited":
        return None
    if not text.isdecimal() or len(text) > 9:
        raise argparse.ArgumentTypeError(f"bounces are 0, 1, 2 ... or unlimited, not {text!r}")
    return int(text)


def parse_exposure(text: str) -> float | None:
    """Parse an exposure in stops; None means automatic."""
    if text in ("automatic", "auto"):
        return None
    try:
        stops = float(text)
    except ValueError:
        stops = math.nan
    if not math.isfinite(stops):
        raise argparse.ArgumentTypeError(f"an exposure is a number of stops, such as 1.5, or automatic, not {text!r}")
    return stops
