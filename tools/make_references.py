"""Render a reference with Mitsuba 3, an engine that shares no code with ours, from the same scene files.

    python tools/make_references.py cornell_spot.glb --camera view.json --size 128x72 --spp 8192 -o cornell_spot.npz

The layers are linear radiance by number of scatterings: emit (none: light sources seen directly), direct (one), one
(two: one indirect bounce), multi (three and more); indirect = one + multi, full = the sum of all. They are differences
of pictures with more and fewer bounces whose noise is independent, so that dark pixels may be a little below 0.
se_direct, se_one, se_multi, se_indirect, se_full: standard errors, from the spread of independent runs, to 4 bits.
depth (metres along the ray through the centre; 0: nothing there), normal (towards the viewer), albedo. All of it is
float16, row 0 on top. meta: JSON.
"""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from mitsuba_scene import camera_rays, mitsuba_scene, needs_null_surfaces
from numpy.typing import NDArray
from reference_file import DEPTHS, Array, layers_of, noise_of, scene_hash, write
from rich.console import Console
from rich.progress import Progress

from wgpu_gi.__main__ import Parser, _size
from wgpu_gi.atomic_file import check_writable
from wgpu_gi.camera import Camera
from wgpu_gi.errors import GiError
from wgpu_gi.scene.camera_files import choose_camera
from wgpu_gi.scene.environment_files import load_environment
from wgpu_gi.scene.load import NO_CAMERA_NOTE, load, parse_light
from wgpu_gi.scene.scene import Scene

EPILOG = """\
Materials are Lambert with their base colour, as in `wgpu-gi render --diffuse`: metallic, roughness and normal maps are
ignored. Glossy references are not offered, since Mitsuba's `principled` is another BRDF than that of glTF.
Refused: unlit materials, masked emitters, a texture under vertex colours, textures that wrap differently along u and v,
or of one material with different coordinates, spots wider than 80 degrees from their axis.
Files hold float16: pictures that do not fit (above 65504, or so dim that its steps show) are refused.
Mitsuba starts rays 0.1 mm or more off a surface: scale up scenes whose details are smaller than centimetres.
Rendering takes every core; start it with `nice` where others work. Needs Mitsuba 3: pip install 'wgpu_gi[truth]'.
"""

# Others have half of its variance, but are biased where a run has few samples: in a closed box, 64 samples a run, the
# layer multi was 0.8 % too dark with `stratified` (nine standard errors), 0.4 % too bright with `multijitter` (four).
SAMPLER = {"type": "independent"}


# ------------------------------------------------------------------------------------------------ with Mitsuba


def import_mitsuba() -> Any:
    """Return Mitsuba 3, set to the variant that needs no LLVM. Raises GiError if it is not installed."""
    try:
        mi = importlib.import_module("mitsuba")
    except ImportError:
        raise GiError("references are rendered by Mitsuba 3: pip install 'wgpu_gi[truth]'") from None
    mi.set_variant("scalar_rgb")
    mi.set_log_level(mi.LogLevel.Error)
    return mi


def render(
    mi: Any,
    scene: Scene,
    camera: Camera,
    size: tuple[int, int],
    *,
    spp: int,
    runs: int = 16,
    seed: int = 0,
    jitter: bool = False,
    progress: Callable[[float], None] | None = None,
) -> dict[str, Array]:
    """Return all layers of a scene in float32: `spp` samples a pixel for each of DEPTHS, in `runs` independent runs."""
    origin = np.asarray(scene.bounds().mean(0))
    world = mitsuba_scene(mi, scene, origin)
    # `path` takes masked surfaces for solid in shadow rays and counts passing them as a bounce; `volpath` does not.
    kind = "volpath" if needs_null_surfaces(scene) else "path"
    integrators = {name: mi.load_dict({"type": kind, "max_depth": depth}) for name, depth in DEPTHS.items()}
    sensors = list(_jittered(mi, camera, size, origin) if jitter else _centred(mi, camera, size, origin))
    pictures = {name: np.zeros((runs, size[1], size[0], 3), np.float32) for name in DEPTHS}
    count = 0
    for run in range(runs):
        for name, integrator in integrators.items():
            # Nothing is random in what a ray through a pixel's centre sees of the light sources.
            samples = 1 if name == "emit" and not jitter else spp // runs
            rows = []
            for sensor in sensors:
                number = seed * runs * len(DEPTHS) * len(sensors) + count
                rows.append(np.array(integrator.render(world, sensor, seed=number % 2**32, spp=samples)))
                count += 1
                if progress is not None:
                    progress(count / (runs * len(DEPTHS) * len(sensors)))
            pictures[name][run] = np.concatenate(rows)
    return layers_of(pictures) | _first_hits(mi, world, camera, size, origin)


def _film(width: int, height: int) -> dict[str, Any]:
    return {
        "type": "hdrfilm",
        "width": width,
        "height": height,
        "rfilter": {"type": "box"},
        "pixel_format": "rgb",
        "component_format": "float32",
    }


def _centred(mi: Any, camera: Camera, size: tuple[int, int], origin: NDArray[np.float64]) -> Iterator[Any]:
    """Yield a sensor for each row of the picture: one meter of a single ray, through the centre, for each pixel.

    Not one for all rows: with that many pixels side by side, float32 would lay samples into the next one.
    """
    pixel = mi.load_dict(_film(1, 1))
    for starts, directions in zip(*camera_rays(camera, size), strict=True):
        words: dict[str, Any] = {"type": "batch", "film": _film(size[0], 1), "sampler": SAMPLER}
        for column, (start, direction) in enumerate(zip(starts - origin, directions, strict=True)):
            meter = {"type": "radiancemeter", "origin": start.tolist(), "direction": direction.tolist(), "film": pixel}
            words[f"{column:05d}"] = meter
        yield mi.load_dict(words)


def _jittered(mi: Any, camera: Camera, size: tuple[int, int], origin: NDArray[np.float64]) -> Iterator[Any]:
    """Yield one sensor whose rays go through random points of the pixels."""
    pose = np.array(camera.world_from_view, np.float64)
    pose[:3, 3] -= origin
    # Mitsuba's cameras look along +Z with +X to the left.
    pose = pose @ np.diag([-1.0, 1.0, -1.0, 1.0])
    words: dict[str, Any] = {"film": _film(*size), "sampler": SAMPLER, "near_clip": 1e-3}
    if camera.orthographic_height is None:
        words |= {"type": "perspective", "fov": float(np.degrees(camera.yfov)), "fov_axis": "y"}
    else:
        # Its picture is two units wide.
        half_width = camera.orthographic_height / 2 * size[0] / size[1]
        pose = pose @ np.diag([half_width, half_width, 1.0, 1.0])
        words |= {"type": "orthographic"}
    yield mi.load_dict(words | {"to_world": mi.ScalarTransform4f(pose)})


def _first_hits(
    mi: Any, world: Any, camera: Camera, size: tuple[int, int], origin: NDArray[np.float64]
) -> dict[str, Array]:
    """Return distance, shading normal towards the viewer and albedo where the rays through the pixel centres hit."""
    depth = np.zeros((size[1], size[0]), np.float32)
    normal, albedo = np.zeros((2, size[1], size[0], 3), np.float32)
    starts, directions = camera_rays(camera, size)
    for pixel in np.ndindex(*depth.shape):
        start, direction = (starts[pixel] - origin).tolist(), directions[pixel].tolist()
        hit = world.ray_intersect(mi.Ray3f(start, direction))
        while hit.is_valid() and float(np.max(np.array(hit.bsdf().eval_null_transmission(hit)))) > 0.5:
            hit = world.ray_intersect(hit.spawn_ray(direction))
        if hit.is_valid():
            n = np.array(hit.sh_frame.n)
            depth[pixel] = np.linalg.norm(np.array(hit.p) - start)
            normal[pixel] = n if n @ direction < 0 else -n
            albedo[pixel] = np.array(hit.bsdf().eval_diffuse_reflectance(hit)).ravel()
    return {"depth": depth, "normal": normal, "albedo": albedo}


# ------------------------------------------------------------------------------------------------ command line


def build_parser() -> Parser:
    """Return the parser of the command line."""
    summary = (__doc__ or "").partition("\n")[0]
    verbatim = argparse.RawDescriptionHelpFormatter
    parser = Parser(
        "make_references.py", description=summary, epilog=EPILOG, formatter_class=verbatim, allow_abbrev=False
    )
    add = parser.add_argument
    add("scene", metavar="SCENE", help="a file or a built-in scene")
    add("-o", "--output", required=True, metavar="OUT", help="the .npz to write")
    add("--camera", metavar="CAMERA", help="a camera of the scene by name or index, or a .json file")
    add("--size", type=_size, default=(160, 90), metavar="WxH", help="pixels (default: 160x90)")
    add("--spp", type=int, default=4096, metavar="N", help="samples per pixel and number of bounces (default: 4096)")
    add("--runs", type=int, default=16, metavar="N", help="independent runs that share the samples (default: 16)")
    add("--seed", type=int, default=0, metavar="N", help="of the random numbers (default: 0)")
    add("--env", metavar="ENV", help="environment: an .hdr or .exr file, or a constant radiance R,G,B")
    add("--light", action="append", default=[], metavar="LIGHT", help='add "sun dx,dy,dz r,g,b" or "point x,y,z r,g,b"')
    add("--jitter", action="store_true", help="rays through random points of the pixels, not their centres")
    return parser


def make_reference(arguments: argparse.Namespace) -> str:
    """Render what the command line asks for and write it; return a sentence. Raises GiError."""
    if arguments.runs < 2 or arguments.spp < arguments.runs:
        raise GiError(f"--runs must be 2 or more and --spp at least that, not {arguments.runs} and {arguments.spp}")
    if arguments.seed < 0:
        raise GiError(f"--seed takes a whole number from 0 on, not {arguments.seed}")
    if min(arguments.size) < 1:
        raise GiError("--size needs a width and a height of at least 1")
    output = Path(arguments.output)
    if output.suffix != ".npz":
        raise GiError(f"a reference is an .npz file, not {arguments.output}")
    check_writable(output)
    mi = import_mitsuba()
    environment = None if arguments.env is None else load_environment(arguments.env)
    lights = [parse_light(text) for text in arguments.light]
    scene = load(arguments.scene, environment=environment, lights=lights)
    camera = choose_camera(scene, arguments.camera, Path(arguments.scene).parent)
    for note in scene.notes:
        if note != NO_CAMERA_NOTE or arguments.camera is None:
            print(f"note: {note}", file=sys.stderr)
    spp = arguments.spp // arguments.runs * arguments.runs
    how = {"spp": spp, "runs": arguments.runs, "seed": arguments.seed, "jitter": arguments.jitter}
    with Progress(console=Console(stderr=True), transient=True, disable=not sys.stderr.isatty()) as bar:
        task = bar.add_task("rendering", total=1.0)
        layers = render(
            mi, scene, camera, arguments.size, progress=lambda done: bar.update(task, completed=done), **how
        )
    noise = noise_of(layers)
    meta = {
        "engine": "Mitsuba 3",
        "version": mi.__version__,
        "variant": mi.variant(),
        "scene": Path(arguments.scene).name,
        "scene_sha256": scene_hash(arguments.scene, scene),
        "camera": {
            "world_from_view": np.asarray(camera.world_from_view).tolist(),
            "yfov": camera.yfov,
            "orthographic_height": camera.orthographic_height,
        },
        "size": list(arguments.size),
        **how,
        "environment": Path(arguments.env).name if arguments.env else "",
        "lights": arguments.light,
        "materials": "diffuse",
        "noise": noise,
    }
    write(output, layers, meta)
    floors = ", ".join(f"{name} {value:.2g}" for name, value in noise.items()) or "none: it is black"
    return f"{arguments.output}: {arguments.size[0]}x{arguments.size[1]}, {spp} spp; noise as relMSE: {floors}"


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit code: 0, 2 for what a user can put right, 130 after Ctrl-C."""
    try:
        print(make_reference(build_parser().parse_args(argv)))
    except GiError as error:
        print(f"make_references: error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("make_references: interrupted; nothing was written", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
