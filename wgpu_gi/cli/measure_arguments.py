"""The arguments of the commands that measure: `compare`, `bench`, `stress` and `report`."""

from __future__ import annotations

from argparse import ArgumentParser

from .argument_types import parse_seeds, parse_size
from .picture_arguments import ADAPTER_HELP, CAMERA_HELP, STRICT_HELP, add_light_arguments, add_loading_arguments


def add_compare_arguments(parser: ArgumentParser) -> None:
    """Add the arguments of `wgpu-gi compare`."""
    add = parser.add_argument
    add("image", metavar="A", help="the picture: FILE or FILE:LAYER")
    add("truth", metavar="B", help="the truth that A is measured against")
    add("--layer", metavar="LAYER", help="the layer of A and B, unless they name one")
    add("--noise", metavar="C", help="standard error of the truth: FILE or FILE:LAYER")
    add("--mask", metavar="MASK", help=".png or FILE:LAYER with at most 64 values: one region, and row, per value")
    add("--html", default="compare.html", metavar="OUT", help="the page to write, default compare.html")
    add("--no-html", dest="html", action="store_const", const=None, help="write no page")
    add("--json", metavar="OUT", help="write the numbers to this .json")


def add_bench_arguments(parser: ArgumentParser) -> None:
    """Add the arguments of `wgpu-gi bench`, but for those on messages."""
    # Scenes.
    scene = parser.add_argument_group("scene")
    scene.add_argument(
        "scene", nargs="*", default=["cornell"], metavar="SCENE", help="files or built-in scenes, default cornell"
    )
    scene.add_argument(
        "--size",
        type=parse_size,
        metavar="WxH",
        help="pixels, default 640x360 or that of the --truth file",
    )
    scene.add_argument("--camera", metavar="CAMERA", help=CAMERA_HELP)
    add_light_arguments(scene)
    add_loading_arguments(scene, "--at", "--time")

    # Techniques and settings.
    technique = parser.add_argument_group("what to measure")
    add = technique.add_argument
    add("--gi", metavar="A,B,C", help="techniques, default all ('help' lists them); path is always measured, too")
    add("--quality", metavar="A,B,C", help="some of low,medium,high; default medium")
    add(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="change a setting, repeatable; 'help' lists them",
    )
    add("--sweep", action="append", default=[], metavar="NAME=A,B", help="measure every value of a setting, repeatable")
    add("--frames", type=int, metavar="N", help="frames measured in each case, default 20")
    add("--moving", action="store_true", help="measure flicker, lag and ghosts of moving pictures, too")
    add(
        "--attribute",
        action="store_true",
        help="measure instead what the error is due to, and which setting to raise; default 160x90, many-light",
    )
    add("--truth", metavar="FILE", help="an .npz or .exr with layers; path, the default, renders it")
    add("--truth-spp", type=int, metavar="N", help="samples per pixel of --truth path, default 256")
    add("--adapter", metavar="NAME", help=ADAPTER_HELP)

    # Reports.
    output = parser.add_argument_group("output")
    add = output.add_argument
    add("--json", metavar="OUT", help="write all numbers to this .json")
    add("--plot", metavar="OUT", help="plot error against time to this .png, .svg or .pdf; a survey: bench.png")
    add("--compare", metavar="OLD", help="print the ratios to this .json of an earlier run")


def add_stress_arguments(parser: ArgumentParser) -> None:
    """Add the arguments of `wgpu-gi stress`, but for those on messages."""
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


def add_report_arguments(parser: ArgumentParser) -> None:
    """Add the arguments of `wgpu-gi report`, but for those on messages."""
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
