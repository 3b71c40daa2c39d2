"""The arguments that say what to render and how: of `render`, of `view`, and those that `bench` shares with them."""

from __future__ import annotations

from argparse import ArgumentParser, _ArgumentGroup

from ..scene.files.memory import GIB, MAX_MEMORY
from ..settings import QUALITIES
from .argument_types import (
    parse_amount,
    parse_bounces,
    parse_error,
    parse_exposure,
    parse_frames,
    parse_length,
    parse_memory,
    parse_pixels,
    parse_rate,
    parse_shards,
    parse_size,
    parse_tiles,
    parse_time,
)

CAMERA_HELP = (
    "a camera of the scene by name or index; auto: from outside, or from inside of a room; inside: at eye height; a"
    ' .json file, or its text such as \'{"position": [0, 1, 5], "target": [0, 1, 0]}\'; default the first, else auto'
)
ADAPTER_HELP = "use the adapter whose name contains NAME (wgpu-gi info lists them)"
STRICT_HELP = "refuse damaged files; by default a damaged part is left out, with a note"
SET_HELP = "change a setting, repeatable; 'help' lists the technique's settings, 'help=all' lists all"


def add_picture_arguments(parser: ArgumentParser, size: str) -> None:
    """Add what `render` and `view` share: scene, technique, and the picture of `size` pixels by default."""
    # What to render.
    scene = parser.add_argument_group("scene")
    scene.add_argument(
        "scene", nargs="?", default="cornell", metavar="SCENE", help="a file or a built-in scene, default cornell"
    )
    scene.add_argument("--camera", metavar="CAMERA", help=CAMERA_HELP)
    add_light_arguments(scene)
    add_loading_arguments(scene, "--at")

    # How to light it.
    technique = parser.add_argument_group("technique")
    add = technique.add_argument
    add(
        "--gi",
        metavar="GI",
        help="technique, default many-light; 'help' lists them, 'path' is the truth",
    )
    add("--quality", choices=QUALITIES, help="preset of the settings, default medium")
    add("--bounces", type=parse_bounces, metavar="N", help="indirect bounces: 0, 1 ... or unlimited, the default")
    add("--spp", type=int, metavar="N", help="samples per pixel of --gi path, default 64")
    add("--visible-only", action="store_true", help="with --gi path: only surfaces in the picture send light")
    add("--seed", type=int, default=0, metavar="N", help="seed of the random numbers, default 0")
    add("--set", action="append", default=[], metavar="NAME=VALUE", help=SET_HELP)

    # How to show it.
    picture = parser.add_argument_group("picture")
    add = picture.add_argument
    add("--size", type=parse_size, default=parse_size(size), metavar="WxH", help=f"pixels, default {size}")
    add("--exposure", type=parse_exposure, metavar="EV", help="scale the displayed picture by 2^EV; default automatic")
    add("--adapter", metavar="NAME", help=ADAPTER_HELP)


def _add_budget_arguments(parser: ArgumentParser, time: str, error: str) -> None:
    add = parser.add_argument_group("budget").add_argument
    time += "; a number without a unit, of a scene with an animation: --at"
    add("--time", dest="budget", type=parse_amount, metavar="T", help=time)
    add("--error", type=parse_error, metavar="E", help=error)


def add_light_arguments(group: _ArgumentGroup) -> None:
    """Add what changes the lights and the environment of a scene."""
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


def add_loading_arguments(group: _ArgumentGroup, *names: str) -> None:
    """Add how a scene is read, and, by a flag of these `names`, at which time it is shown."""
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
        *names,
        dest="time",
        type=parse_time,
        metavar="T",
        help="seconds at which an animation is shown; of a USD file the time code, default its start",
    )
    add("--animation", metavar="NAME", help="the animation, by name or index; default the first")


def add_render_arguments(parser: ArgumentParser) -> None:
    """Add what only `render` takes: files, reports, sequences."""
    _add_budget_arguments(
        parser,
        "render the best picture within T, such as 2s, 500ms, 1.5min: chooses technique, quality, number of frames",
        "render until the relMSE is E, such as 0.01; with --time: whichever comes first",
    )
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
    add("--denoise", action="store_true", help="with --gi path: smooth noise with Open Image Denoise (extra denoise)")
    add(
        "--certify",
        nargs="?",
        const=True,
        type=parse_pixels,
        metavar="N",
        help="path trace N random pixels, default 200: state relMSE and bias of the picture with 95 %% intervals",
    )
    add(
        "--tiles",
        nargs="?",
        const=True,
        default=False,
        type=parse_tiles,
        metavar="N|WxH",
        help="render the picture in N tiles, or in tiles of WxH pixels, default 2048x2048: for sizes up to 8192x8192",
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

    _add_sequence_arguments(parser)


def _add_sequence_arguments(parser: ArgumentParser) -> None:
    add = parser.add_argument_group("sequence").add_argument
    add(
        "--frames",
        type=parse_frames,
        metavar="A:B[:STEP]",
        help="render frames; OUT contains {frame}, such as f_{frame:04d}.exr",
    )
    add("--turntable", action="store_true", help="move the camera once round the scene")
    add("--camera-path", metavar="FILE", help="move the camera along the keys of a .json file")
    add("--layers", default="", metavar="A,B,C", help="buffers to write to an .npz beside each frame")
    add("--shard", type=parse_shards, metavar="I/N", help="render part I of N of the frames, or parts I-J/N")
    fps = "frames per second of the animation and of an .mp4, default 24"
    add("--fps", type=int, metavar="N", help=fps)


def add_view_arguments(parser: ArgumentParser) -> None:
    """Add what only `view` takes."""
    _add_budget_arguments(
        parser,
        "refine a view at rest for T, such as 10s",
        "refine a view at rest until the relMSE of its noise is E, such as 0.0001",
    )
    parser.add_argument_group("window").add_argument(
        "--fps",
        type=parse_rate,
        metavar="N",
        help="while the view moves, use so many pixels that N frames per second are shown; default 25, at least 15",
    )


def add_message_arguments(parser: ArgumentParser, asked: str) -> None:
    """Add how much is printed; `asked` is what `-q` leaves."""
    group = parser.add_argument_group("messages").add_mutually_exclusive_group()
    group.add_argument("-v", "--verbose", action="store_true", help="also print sizes and times of loading")
    group.add_argument("-q", "--quiet", action="store_true", help=f"print only errors and {asked}")
