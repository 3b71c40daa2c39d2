"""Render a reference with Mitsuba 3, an engine that shares no code with ours, from the same scene files.

    python tools/make_references.py cornell_spot.glb --camera view.json --size 128x72 --spp 8192 -o cornell_spot.npz

The layers are linear radiance by number of scatterings: emit (none: light sources seen directly), direct (one), one
(two: one indirect bounce), multi (three and more); indirect = one + multi, full = the sum of all. They are differences
of pictures of the same paths with more and fewer bounces.
se_direct, se_one, se_multi, se_indirect, se_full: standard errors, from the spread of independent runs, to 4 bits.
depth (metres along the ray through the centre; 0: no surface), normal (towards the viewer), albedo. All layers are
float16, row 0 on top. meta: JSON.
"""

from __future__ import annotations

import argparse
import glob
import importlib
import os
import re
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from mitsuba_scene import camera_rays, mitsuba_scene, needs_null_surfaces, pixel_centres
from reference_file import DEPTHS, Array, layers_of, noise_of, scene_hash, write
from rich.console import Console
from rich.progress import Progress
from world_surfaces import Floats

from wgpu_gi.camera import Camera
from wgpu_gi.cli.argument_types import parse_size
from wgpu_gi.cli.arguments import Parser
from wgpu_gi.errors import GiError
from wgpu_gi.pictures.atomic_file import check_writable
from wgpu_gi.scene.files.camera_files import choose_camera
from wgpu_gi.scene.files.environment_files import load_environment
from wgpu_gi.scene.files.light_texts import parse_light
from wgpu_gi.scene.load import NO_CAMERA_NOTE, load
from wgpu_gi.scene.scene import Scene

EPILOG = """\
Materials are Lambert with their base colour, as in `wgpu-gi render --diffuse`: metallic, roughness and normal maps are
ignored. Glossy references are not offered, since Mitsuba's `principled` BRDF differs from glTF's.
Refused: unlit materials, masked emitters, a texture under vertex colours, textures that wrap differently along u and v,
or of one material with different coordinates, spots wider than 80 degrees from their axis.
Files hold float16: pictures that do not fit (above 65504, or so dim that its steps show) are refused.
Mitsuba starts rays 0.1 mm or more off a surface: scale up scenes whose details are smaller than centimetres.
Rendering uses every core; use `nice` on a shared machine. Needs Mitsuba 3, pip install mitsuba, and
LLVM 19 or newer, on Debian apt-get install libllvm19, elsewhere its library named in DRJIT_LIBLLVM_PATH.
"""

# Dr.Jit refuses 14; 15 and 16 end the process with "Cannot select".
OLDEST_LLVM = 19
LLVM_PLACES = ("/usr/lib/*/libLLVM*", "/usr/lib64/libLLVM*", "/usr/lib/libLLVM*", "/usr/lib/llvm-*/lib/libLLVM*")

# Paths that are traced together; bounds the memory.
MOST_PATHS = 1 << 21

# The other samplers have half of its variance, but are biased if a run has few samples: in a closed box, at 64 samples
# per run, the layer multi was 0.8 % too dark with `stratified` (nine standard errors), 0.4 % too bright with
# `multijitter` (four).
SAMPLER = {"type": "independent"}


# ------------------------------------------------------------------------------------------------ with Mitsuba


def import_mitsuba() -> Any:
    """Return Mitsuba 3, set to compile with LLVM. Raises GiError if either is not installed."""
    try:
        mi = importlib.import_module("mitsuba")
    except ImportError:
        raise GiError("references are rendered by Mitsuba 3: pip install mitsuba") from None
    if "DRJIT_LIBLLVM_PATH" not in os.environ:
        os.environ["DRJIT_LIBLLVM_PATH"] = find_llvm()
    mi.set_variant("llvm_ad_rgb")
    mi.set_log_level(mi.LogLevel.Error)
    return mi


def find_llvm(places: Sequence[str] = LLVM_PLACES) -> str:
    """Return the path of the oldest LLVM library that Mitsuba can use. Raises GiError if there is none."""
    found = []
    for path in (path for place in places for path in glob.glob(place)):
        version = re.search(r"libLLVM(?:-|\.so\.)(\d+)", path)
        if version and int(version[1]) >= OLDEST_LLVM:
            found.append((int(version[1]), path))
    if not found:
        raise GiError(
            f"Mitsuba needs LLVM {OLDEST_LLVM} or newer, which was not found; on Debian: apt-get install "
            f"libllvm{OLDEST_LLVM}; elsewhere name the library in DRJIT_LIBLLVM_PATH"
        )
    return min(found)[1]


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
    sampler, centres = mi.load_dict(SAMPLER), pixel_centres(size)
    pictures = {name: np.zeros((runs, len(centres), 3)) for name in DEPTHS}
    most = max(1, MOST_PATHS // len(centres))
    batches = [(run, min(most, spp // runs - first)) for run in range(runs) for first in range(0, spp // runs, most)]
    for index, (run, samples) in enumerate(batches):
        number = (seed * len(batches) + index) % 2**32
        points = centres.repeat(samples, 0)
        if jitter:
            points += np.random.default_rng(number).random(points.shape) - 0.5
        rays = _rays(mi, camera, size, points, origin)
        for name, integrator in integrators.items():
            # All integrators use the same random numbers: a path with few bounces is the beginning of one with many, so
            # the difference of two pictures has no noise from their common part.
            sampler.seed(number, len(points))
            radiance = np.array(integrator.sample(world, sampler, rays)[0], np.float64)
            pictures[name][run] += radiance.reshape(3, len(centres), samples).sum(2).T / (spp // runs)
        if progress is not None:
            progress((index + 1) / len(batches))
    shape = (runs, size[1], size[0], 3)
    layers = layers_of({name: picture.reshape(shape) for name, picture in pictures.items()})
    return layers | _first_hits(mi, world, _rays(mi, camera, size, centres, origin), size)


def _rays(mi: Any, camera: Camera, size: tuple[int, int], points: Floats, origin: Floats) -> Any:
    """Return Mitsuba's rays through points of the picture, in a world moved so that `origin` is at its origin."""
    starts, directions = camera_rays(camera, size, points)
    columns = [np.ascontiguousarray(v.T, np.float32) for v in (starts - origin, directions)]
    rays = mi.RayDifferential3f(mi.Point3f(columns[0]), mi.Vector3f(columns[1]))
    rays.has_differentials = False
    return rays


def _first_hits(mi: Any, world: Any, rays: Any, size: tuple[int, int]) -> dict[str, Array]:
    """Return distance, shading normal towards the viewer and albedo where the rays through the pixel centres hit."""
    dr = importlib.import_module("drjit")
    hit = world.ray_intersect(rays)
    # Continue rays where a mask cuts out the surface.
    while dr.any(hole := hit.is_valid() & (hit.bsdf().eval_null_transmission(hit)[0] > 0.5)):
        hit = dr.select(hole, world.ray_intersect(hit.spawn_ray(rays.d), hole), hit)
    seen = hit.is_valid()
    normal = dr.select(dr.dot(hit.sh_frame.n, rays.d) < 0, hit.sh_frame.n, -hit.sh_frame.n)
    depth = np.array(dr.select(seen, dr.norm(hit.p - rays.o), 0))
    albedo = hit.bsdf().eval_diffuse_reflectance(hit)
    colors = {name: np.array(dr.select(seen, v, 0)).T for name, v in (("normal", normal), ("albedo", albedo))}
    return {"depth": depth.reshape(size[::-1]), **{k: v.reshape(*size[::-1], 3) for k, v in colors.items()}}


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
    add("--size", type=parse_size, default=(160, 90), metavar="WxH", help="pixels (default: 160x90)")
    add("--spp", type=int, default=4096, metavar="N", help="samples per pixel (default: 4096)")
    add("--runs", type=int, default=16, metavar="N", help="independent runs that share the samples (default: 16)")
    add("--seed", type=int, default=0, metavar="N", help="seed of the random numbers (default: 0)")
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
    """Run the command line. Return 0, 2 after an error that the user can fix, or 130 after Ctrl-C."""
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
