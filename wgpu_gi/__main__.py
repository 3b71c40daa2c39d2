"""The command line: `wgpu-gi render` makes a picture, `wgpu-gi info` tells what this machine offers."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Sequence
from typing import NoReturn

from . import __version__
from .errors import GiError

RENDER_EXAMPLES = """\
examples:
  wgpu-gi render                                    the built-in Cornell box to out.png
  wgpu-gi render scene.glb -o frame.exr --show radiance --show depth --show normal
  wgpu-gi render scene.glb --camera 1 --size 1280x720 --spp 256 --exposure 1.5
  wgpu-gi render scene.obj --env sky.hdr --light "sun 0.3,-1,0.2 3,3,2.8"
  wgpu-gi render cornell --bounces 0 -o direct.npy  only what the lights reach
  wgpu-gi render --set help                         list every setting

--show, --light and --set may be given several times; several buffers need .exr or .npz.
.npy .npz .exr hold linear radiance, float32, without exposure or tone curve; .png is sRGB with both.
"""

INFO_EPILOG = "The exit code is 0 if there is a usable adapter, else 2."


class Parser(argparse.ArgumentParser):
    """An argument parser whose errors are one sentence, as all others of this program."""

    def error(self, message: str) -> NoReturn:
        """Raise GiError instead of printing the usage."""
        raise GiError(f"{message} (see {self.prog} -h)")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit code: 0, 2 for what a user can put right, 130 after Ctrl-C."""
    try:
        arguments = build_parser().parse_args(argv)
        if arguments.command == "info":
            from .cli_info import info

            return info()
        from .cli_render import render

        return render(arguments)
    except GiError as error:
        print(f"wgpu-gi: error: {error}", file=sys.stderr)
    except MemoryError:
        print("wgpu-gi: error: not enough memory; use a smaller --size or a smaller scene", file=sys.stderr)
    except KeyboardInterrupt:
        print("wgpu-gi: interrupted; no file was left half-written", file=sys.stderr)
        return 130
    return 2


def build_parser() -> Parser:
    """Return the parser of the whole command line."""
    parser = Parser(prog="wgpu-gi", description="Global illumination on WebGPU.", allow_abbrev=False)
    parser.add_argument("--version", action="version", version=f"wgpu_gi {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="render | info", required=True)
    verbatim = argparse.RawDescriptionHelpFormatter
    render = commands.add_parser(
        "render", help="make a picture of a scene", epilog=RENDER_EXAMPLES, formatter_class=verbatim, allow_abbrev=False
    )
    _add_render_arguments(render)
    commands.add_parser("info", help="adapters, drivers, versions, and what is missing", epilog=INFO_EPILOG)
    return parser


def _add_render_arguments(parser: Parser) -> None:
    add = parser.add_argument
    add("scene", nargs="?", default="cornell", metavar="SCENE", help="a file or a built-in scene (default: cornell)")
    add("-o", "--output", default="out.png", metavar="OUT", help=".png .exr .npy or .npz (default: out.png)")
    add("--size", type=_size, default=(640, 360), metavar="WxH", help="pixels (default: 640x360)")
    add("--camera", metavar="CAMERA", help="a camera of the scene by name or index, or a .json file")
    add("--gi", choices=("path", "none"), default="path", help="global illumination by (default: path)")
    add("--bounces", type=_bounces, metavar="N", help="indirect bounces: 0, 1 ... or unlimited (the default)")
    add("--spp", type=int, default=64, metavar="N", help="samples per pixel (default: 64)")
    add("--env", metavar="ENV", help="environment: an .hdr or .exr file, or a constant radiance R,G,B")
    add("--light", action="append", default=[], metavar="LIGHT", help='add "sun dx,dy,dz r,g,b" or "point x,y,z r,g,b"')
    add("--exposure", type=float, default=0.0, metavar="EV", help="brighten the .png by 2^EV (default: 0)")
    add("--show", action="append", default=[], metavar="BUFFER", help="what to write (radiance); 'help' lists them")
    add("--set", action="append", default=[], metavar="NAME=VALUE", help="change a setting; 'help' lists them")
    add("--seed", type=int, default=0, metavar="N", help="of the random numbers (default: 0)")
    add("--adapter", metavar="NAME", help="use the adapter whose name contains this (see wgpu-gi info)")
    add("--plan", action="store_true", help="print which passes ran, and why others did not")
    add("--timings", action="store_true", help="print the time that each pass took")
    add("--check", action="store_true", help="name the first pass that makes a NaN or an infinity (slow)")
    add("--diffuse", action="store_true", help="treat every material as Lambert with its base colour")


def _size(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d{1,9})x(\d{1,9})", text)
    if match is None:
        raise argparse.ArgumentTypeError(f"a size is WIDTHxHEIGHT in pixels, such as 640x360, not {text!r}")
    return int(match[1]), int(match[2])


def _bounces(text: str) -> int | None:
    if text == "unlimited":
        return None
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"bounces are 0, 1, 2 ... or unlimited, not {text!r}")
    return int(text)


if __name__ == "__main__":
    sys.exit(main())
