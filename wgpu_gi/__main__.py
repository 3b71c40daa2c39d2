"""The command line: `wgpu-gi render` makes pictures, `view` shows them live, `compare` and `bench` measure them."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Sequence
from typing import NoReturn

from .errors import GiError
from .settings import QUALITIES
from .version import __version__

RENDER_EXAMPLES = """\
examples:
  wgpu-gi render                                    the built-in Cornell box to out.png
  wgpu-gi render scene.glb -o frame.exr --show radiance --show depth --show normal
  wgpu-gi render scene.glb --camera 1 --size 1280x720 --spp 256 --exposure 1.5
  wgpu-gi render scene.obj --env sky.hdr --light "sun 0.3,-1,0.2 3,3,2.8"
  wgpu-gi render scene.glb --relight 0=5,4,3 --relight "env=1,1,1 90"      its own lights, changed
  wgpu-gi render scene.glb --gi none                direct light by shadow maps, in a fraction of the time
  wgpu-gi render cornell --bounces 0 -o direct.npy  the same by the path tracer, the truth
  wgpu-gi render --set help                         list every setting
  wgpu-gi render a.glb -o f/{frame:04d}.exr --frames 0:240 --turntable --layers depth,normal --shard 1/8
  wgpu-gi render a.glb -o around.mp4 --frames 0:240 --turntable --gi none

--show, --light, --relight and --set may be given several times; several buffers need .exr or .npz.
.npy .npz .exr hold linear radiance, float32, without exposure or tone curve; .png is sRGB with both.

--frames A:B renders frames A to B-1. Files that are there already are left alone, so the same command goes on where it
was stopped, and --shard I/N does the Ith of N parts of the work with the same pictures as the whole; .json beside the
frames holds the command, which must stay the same, and every camera. Techniques with a memory start anew every 32
frames, after 8 that are rendered only to fill it.
--camera-path FILE.json is a list of keys: [{"frame": 0, "position": [0, 1, 5], "target": [0, 1, 0]}, ...].
"""

VIEW_EXAMPLES = """\
examples:
  wgpu-gi view scene.glb                            drag to turn it; ? in the window lists all keys
  wgpu-gi view scene.glb --gi none --size 1280x720
  wgpu-gi view scene.obj --env sky.hdr --light "sun 0.3,-1,0.2 3,3,2.8" --exposure 1

It needs a display and pip install 'wgpu_gi[viewer]'. Shaders are read again when their files are saved.
"""

COMPARE_EXAMPLES = """\
examples:
  wgpu-gi compare frame.exr truth.exr
  wgpu-gi compare a.npz b.npz --layer indirect
  wgpu-gi compare a.npz truth.npz:emit+direct+one+multi --noise truth.npz:se_full
  wgpu-gi compare a.npz b.npz --mask regions.png --html report.html --json report.json

A and B are linear: .npy .npz .exr. FILE:LAYER names a layer, FILE:ONE+TWO the sum of several. Without a layer, an .exr
means its R, G, B, and an .npz its layer "radiance". Both must be of one size.

With x of A, t of B, m the mean of t (over the whole picture, or over the region in the row of a region):
  relMSE              mean((x-t)^2 / (t^2 + 0.01 m^2)), less the noise floor where --noise is given
  noise floor         the relMSE that the noise of B alone makes
  bias                mean(x-t) / m; in the JSON a fraction, not percent
  99.9th percentile   of |x-t| / (t + 0.1 m), for fireflies
  FLIP                mean LDR-FLIP, 0 alike to 1, at 67 pixels per degree, after scaling both so that the mean
                      luminance of B is 0.18, and clipping at 1; needs pip install 'wgpu_gi[bench]'
"""

BENCH_EXAMPLES = """\
examples:
  wgpu-gi bench                                     every technique on the Cornell box
  wgpu-gi bench a.glb b.glb --quality low,medium,high --json now.json --plot now.png
  wgpu-gi bench a.glb --gi many-light --sweep vpl.count=512,2048 --sweep gather.rays=1,4 --plot best.png
  wgpu-gi bench a.glb --compare before.json         ratios of time and error to an earlier run on this machine
  wgpu-gi bench a.glb --truth truth.npz             layers as `render` names them, or emit, direct, one, multi

Errors are of linear radiance at the pixel centres, over the pixels that see a surface, as `wgpu-gi compare` defines
them, less the noise of the truth. Times are of frames after a warm-up: still (nothing changes), camera moving, and all
moving (every pass is forced); GPU ms are the sum over the passes of a frame, wall ms include Python and waiting.
--truth path renders the truth, which may take long, and keeps it in ~/.cache/wgpu_gi/truth (or in XDG_CACHE_HOME, or
WGPU_GI_CACHE); delete that folder at will.
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
            from .cli.info import info

            return info()
        if arguments.command == "compare":
            from .cli.compare import compare

            return compare(arguments)
        if arguments.command == "bench":
            from .cli.bench import bench

            return bench(arguments)
        if arguments.command == "view":
            from .cli.view import view

            return view(arguments)
        from .cli.render import render

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
    commands = parser.add_subparsers(dest="command", metavar="render | view | compare | bench | info", required=True)
    verbatim = argparse.RawDescriptionHelpFormatter
    render = commands.add_parser(
        "render", help="make a picture of a scene", epilog=RENDER_EXAMPLES, formatter_class=verbatim, allow_abbrev=False
    )
    _add_render_arguments(render)
    viewer = commands.add_parser(
        "view", help="look at a scene in a window", epilog=VIEW_EXAMPLES, formatter_class=verbatim, allow_abbrev=False
    )
    _add_picture_arguments(viewer, size=(960, 540), gi="many-light")
    comparison = commands.add_parser(
        "compare",
        help="tell how far a picture is from the truth",
        epilog=COMPARE_EXAMPLES,
        formatter_class=verbatim,
        allow_abbrev=False,
    )
    _add_compare_arguments(comparison)
    measuring = commands.add_parser(
        "bench",
        help="measure error and time of techniques",
        epilog=BENCH_EXAMPLES,
        formatter_class=verbatim,
        allow_abbrev=False,
    )
    _add_bench_arguments(measuring)
    commands.add_parser("info", help="adapters, drivers, versions, and what is missing", epilog=INFO_EPILOG)
    return parser


def _add_picture_arguments(parser: Parser, size: tuple[int, int], gi: str) -> None:
    add, default_size = parser.add_argument, f"{size[0]}x{size[1]}"
    add("scene", nargs="?", default="cornell", metavar="SCENE", help="a file or a built-in scene (default: cornell)")
    add("--size", type=_size, default=size, metavar="WxH", help=f"pixels (default: {default_size})")
    add(
        "--camera",
        metavar="CAMERA",
        help="a camera of the scene by name or index, a .json file, or what such one holds",
    )
    add("--gi", default=gi, metavar="GI", help=f"technique for light; 'help' lists them (default: {gi})")
    add("--quality", choices=QUALITIES, default="medium", help="of all settings that have presets (default: medium)")
    add("--bounces", type=_bounces, metavar="N", help="indirect bounces: 0, 1 ... or unlimited (the default)")
    add("--spp", type=int, default=64, metavar="N", help="samples per pixel (default: 64)")
    _add_light_arguments(parser)
    add("--exposure", type=float, default=0.0, metavar="EV", help="brighten what is shown by 2^EV (default: 0)")
    add("--set", action="append", default=[], metavar="NAME=VALUE", help="change a setting; 'help' lists them")
    add("--seed", type=int, default=0, metavar="N", help="of the random numbers (default: 0)")
    add("--adapter", metavar="NAME", help="use the adapter whose name contains this (see wgpu-gi info)")
    add("--diffuse", action="store_true", help="treat every material as Lambert with its base colour")
    add("--visible-only", action="store_true", help="of --gi path: let light leave only surfaces in the picture")


def _add_light_arguments(parser: Parser) -> None:
    add = parser.add_argument
    add("--env", metavar="ENV", help="environment: an .hdr or .exr file, or a constant radiance R,G,B")
    add("--light", action="append", default=[], metavar="LIGHT", help='add "sun dx,dy,dz r,g,b" or "point x,y,z r,g,b"')
    add(
        "--relight",
        action="append",
        default=[],
        metavar="LIGHT=R,G,B",
        help="change a light of the scene, by index from 0 or name: candela or lux; of a sun also the direction,"
        ' "LIGHT=r,g,b dx,dy,dz"; "env=r,g,b degrees" dyes and turns the environment',
    )


def _add_render_arguments(parser: Parser) -> None:
    _add_picture_arguments(parser, size=(640, 360), gi="path")
    add = parser.add_argument
    add("-o", "--output", default="out.png", metavar="OUT", help=".png .exr .npy or .npz (default: out.png)")
    add("--show", action="append", default=[], metavar="BUFFER", help="what to write (radiance); 'help' lists them")
    add("--plan", action="store_true", help="print which passes ran, and why others did not")
    add("--timings", action="store_true", help="print the time that each pass took")
    add("--check", action="store_true", help="name the first pass that makes a NaN or an infinity (slow)")
    add("--frames", type=_frames, metavar="A:B[:STEP]", help="render frames; OUT has {frame}, as in f_{frame:04d}.exr")
    add("--turntable", action="store_true", help="go once round the scene over the frames")
    add("--camera-path", metavar="FILE", help="move the camera along the keys of this .json")
    add("--layers", default="", metavar="A,B,C", help="buffers to write into an .npz beside each frame")
    add("--shard", type=_shard, metavar="I/N", help="render the Ith of N parts of the frames, 1/N to N/N")
    add("--fps", type=int, default=24, metavar="N", help="frames per second of an .mp4 (default: 24)")


def _add_compare_arguments(parser: Parser) -> None:
    add = parser.add_argument
    add("image", metavar="A", help="the picture: FILE or FILE:LAYER")
    add("truth", metavar="B", help="the truth that it is measured against")
    add("--layer", metavar="LAYER", help="the layer of A and B where they name none themselves")
    add("--noise", metavar="C", help="standard error of the truth: FILE or FILE:LAYER")
    add("--mask", metavar="MASK", help="a row for each distinct value of this .png or FILE:LAYER, at most 64")
    add("--html", default="compare.html", metavar="OUT", help="the page to write (default: compare.html)")
    add("--no-html", dest="html", action="store_const", const=None, help="write no page")
    add("--json", metavar="OUT", help="write the numbers to this .json")


def _add_bench_arguments(parser: Parser) -> None:
    add = parser.add_argument
    add("scene", nargs="*", default=["cornell"], metavar="SCENE", help="files or built-in scenes (default: cornell)")
    add("--gi", metavar="A,B,C", help="techniques, or ssao (default: all but the path tracer, always held against)")
    add("--quality", default="medium", metavar="A,B,C", help="out of low,medium,high (default: medium)")
    add("--size", type=_size, metavar="WxH", help="pixels (default: 640x360, or as the file of --truth)")
    add("--camera", metavar="CAMERA", help="a camera of the scene by name or index, or a .json file")
    _add_light_arguments(parser)
    add("--diffuse", action="store_true", help="treat every material as Lambert with its base colour")
    add("--set", action="append", default=[], metavar="NAME=VALUE", help="change a setting; 'help' lists them")
    add(
        "--sweep",
        action="append",
        default=[],
        metavar="NAME=A,B",
        help="measure all values of a setting",
    )
    add("--frames", type=int, default=20, metavar="N", help="frames measured in each case (default: 20)")
    add("--truth", default="path", metavar="FILE", help="path (render it, the default), or an .npz or .exr with layers")
    add("--truth-spp", type=int, default=256, metavar="N", help="samples per pixel of --truth path (default: 256)")
    add("--json", metavar="OUT", help="write all numbers to this .json")
    add("--plot", metavar="OUT", help="draw error against time to this .png, .svg or .pdf")
    add("--compare", metavar="OLD", help="a .json of an earlier run: print the ratios to it")
    add("--adapter", metavar="NAME", help="use the adapter whose name contains this (see wgpu-gi info)")


def _size(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d{1,9})x(\d{1,9})", text)
    if match is None:
        raise argparse.ArgumentTypeError(f"a size is WIDTHxHEIGHT in pixels, such as 640x360, not {text!r}")
    return int(match[1]), int(match[2])


def _frames(text: str) -> range:
    match = re.fullmatch(r"(\d{1,9}):(\d{1,9})(?::([1-9]\d{0,8}))?", text)
    frames = range(int(match[1]), int(match[2]), int(match[3] or 1)) if match else range(0)
    if not frames:
        raise argparse.ArgumentTypeError(f"frames are FIRST:END or FIRST:END:STEP, such as 0:240, not {text!r}")
    return frames


def _shard(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d{1,6})/(\d{1,6})", text)
    if match is None or not 1 <= int(match[1]) <= int(match[2]):
        raise argparse.ArgumentTypeError(f"a shard is I/N from 1/N to N/N, such as 2/8, not {text!r}")
    return int(match[1]), int(match[2])


def _bounces(text: str) -> int | None:
    if text == "unlimited":
        return None
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"bounces are 0, 1, 2 ... or unlimited, not {text!r}")
    return int(text)


if __name__ == "__main__":
    sys.exit(main())
