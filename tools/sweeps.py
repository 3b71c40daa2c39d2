"""Sweep constants of shaders and modules: print error and time of several values as Markdown tables.

    python tools/sweeps.py                     # list the constants
    python tools/sweeps.py STEP_WIDTH FLAT     # sweep these; a name may also be a file, or a row of REFERENCES
    python tools/sweeps.py all                 # sweep all of them

Each value is put into a copy of the package, which then renders three scenes of 128x72 pixels in a process of its own:
every material Lambert, rays through pixel centres, medium quality, the mean of 8 frames. References are those of
`tests/truth`. A table gives relMSE / bias for each scene, and the CPU time of a frame in which every pass runs.
`tools/README.md`, "Constants", holds the tables.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path

# Append these paths: PYTHONPATH, which leads a worker to its copy of the package, must come before this checkout.
sys.path.append(str(Path(__file__).resolve().parents[1] / "tests"))
sys.path.append(str(Path(__file__).resolve().parents[1]))

import numpy as np
from helpers.skies import gradient_sky
from numpy.typing import NDArray

from wgpu_gi.measure.metrics import bias, relmse
from wgpu_gi.measure.references import SIZE, layers_of, scene_of
from wgpu_gi.options import Settings
from wgpu_gi.renderer import Renderer
from wgpu_gi.scene.built_in.shapes import sphere
from wgpu_gi.scene.load import load
from wgpu_gi.scene.scene import (
    Environment,
    Image,
    Instance,
    Material,
    Mesh,
    PointLight,
    Scene,
    SpotLight,
    Texture,
)
from wgpu_gi.settings import assign

ROOT = Path(__file__).resolve().parents[1]
FRAMES = 8
SEED = 0
TIMED_FRAMES = 3
VISIBLE = Path(__file__).parents[1] / "tests" / "truth" / "visible"


@dataclass(frozen=True)
class Reference:
    """The reference of a technique: the compared buffer, the bounces, the layers of the truth, the scenes."""

    show: str
    bounces: int | None
    layers: tuple[str, ...]
    scenes: tuple[str, ...]
    turning: bool = False  # single frames of a camera that turns into the view of the reference


REFERENCES = {
    "none": Reference("direct", 0, ("direct",), ("cornell_area", "cornell_point", "leak_corridor_a")),
    "sky": Reference("direct", 0, ("direct",), ("courtyard_sky",)),
    "many-light": Reference("indirect", None, ("one", "multi"), ("cornell_point", "leak_corridor_a", "courtyard_sky")),
    "ssdo": Reference("radiance", 1, ("emit", "direct", "one"), ("cornell_point", "cornell_spot", "courtyard_sky")),
    "sky map": Reference("direct", 0, ("direct",), ("pictured_sky",)),
    "sun": Reference("direct", 0, ("direct",), ("courtyard_sun",)),
    "lamps": Reference("direct", 0, ("direct",), ("lamps",)),
    "moving": Reference(
        "indirect", None, ("one", "multi"), ("cornell_area", "cornell_point", "leak_corridor_a"), turning=True
    ),
    "screen": Reference("direct", 0, ("direct",), ("screen",)),
    "emitters": Reference("direct", 0, ("direct",), ("cornell_area", "screen")),
    "balls": Reference("radiance", 0, (), ("balls",)),
    # Its truth is the light of visible surfaces; with the spot, all that is lit is in view.
    "ssil": Reference("indirect", 1, ("one",), ("cornell_point", "cornell_area", "cornell_spot")),
}
# The technique of each row of REFERENCES that is not named after one.
TECHNIQUE = {
    "sky": "many-light",
    "sky map": "many-light",
    "sun": "none",
    "lamps": "none",
    "moving": "many-light",
    "screen": "none",
    "emitters": "none",
    "balls": "many-light",
}


@dataclass(frozen=True)
class Sweep:
    """A constant of a file, below wgsl/ or wgpu_gi/, the values to try, and the settings that make it take effect."""

    file: str
    constant: str
    values: str
    reference: str
    settings: str = ""

    @property
    def path(self) -> Path:
        """The file, relative to the root of the repository."""
        return Path("wgsl" if self.file.endswith(".wgsl") else "wgpu_gi") / self.file


ISM = "gather.visibility=ism"
# The value in use is among the values.
SWEEPS = (
    Sweep("deferred/shadow/lookup.wgsl", "DEPTH_ROUNDING", "1e-6, 4e-6, 16e-6", "none"),
    Sweep("deferred/shadow/lookup.wgsl", "OWN_PLANE", "0.03, 0.1, 0.3", "none"),
    Sweep("deferred/shadow/lookup.wgsl", "CLEAR_OF_PLANE", "0.5, 1.0, 2.0", "none"),
    Sweep("techniques/deferred/sky.py", "INTERLEAVE", "2, 4, 8", "sky"),
    Sweep("techniques/deferred/shadow_sun.py", "RATIO", "2.0, 4.0, 8.0", "sun", "direct.edges=false"),
    Sweep("techniques/deferred/shadow_views.py", "DIMMEST_SIDE", "1 / 2, 1 / 8, 1 / 32", "lamps", "direct.edges=false"),
    Sweep("techniques/deferred/shadow_views.py", "PROBES", "16, 64, 256", "lamps", "direct.edges=false"),
    Sweep("techniques/deferred/direct.py", "TILED_FROM", "1, 8, 32", "lamps"),
    Sweep("shared/denoise/guide.wgsl", "OFF_PLANE", "0.0625, 0.125, 0.25", "many-light"),
    Sweep("shared/denoise/guide.wgsl", "PER_NORMAL", "5.0, 10.0, 20.0", "many-light"),
    Sweep("shared/denoise/guide.wgsl", "GUIDED_FROM", "2u, 4u, 8u", "many-light"),
    Sweep("shared/denoise/guide.wgsl", "INDEPENDENT_PIXELS", "4.0, 9.0, 18.0", "many-light", "camera.frames=1"),
    Sweep("shared/denoise/blur.wgsl", "STANDARD_ERRORS", "2.0, 3.0, 5.0", "many-light"),
    Sweep("shared/denoise/blur.wgsl", "STANDARD_ERRORS_AROUND", "1.5, 2.5, 4.0", "many-light"),
    Sweep("shared/denoise/atrous.wgsl", "STANDARD_ERRORS", "1.0, 1.5, 2.0", "many-light"),
    Sweep("techniques/shared/denoise.py", "FIRST_STEP", "2, 3, 4", "many-light"),
    Sweep("deferred/sky/occlusion.wgsl", "CANDIDATES", "1u, 2u, 4u", "sky map"),
    Sweep("shared/temporal/reproject.wgsl", "MAX_PLANE_DISTANCE", "0.3, 1.0, 3.0", "moving", "temporal.frames=8"),
    Sweep("shared/temporal/reproject.wgsl", "MIN_NORMAL_COSINE", "0.7, 0.9, 0.97", "moving", "temporal.frames=8"),
    Sweep("shared/temporal/reproject.wgsl", "MIN_HISTORY_WEIGHT", "0.01, 0.1, 0.3", "moving", "temporal.frames=8"),
    Sweep("shared/temporal/accumulate.wgsl", "BOUND", "2.0, 3.0, 5.0", "moving", "temporal.frames=16"),
    Sweep("shared/temporal/accumulate.wgsl", "FILLED_FRAMES", "0.1, 3.0, 6.0", "moving", "temporal.frames=16"),
    Sweep("many_light/ism/map.wgsl", "TEXEL_ANGLE", "2.0, 2.5, 2.83", "many-light", ISM),
    Sweep("many_light/ism/hit_triangle.wgsl", "PLANE_TOLERANCE", "1e-3, 1e-2, 1e-1", "many-light", ISM),
    Sweep("many_light/ism/fill.wgsl", "PLANAR_ERROR", "0.001, 0.005, 0.02", "many-light", ISM),
    Sweep("many_light/ism/fill.wgsl", "CURVED_ERROR", "0.15, 0.3, 0.45, 0.7, 1.0", "many-light", ISM),
    Sweep("many_light/ism/fill.wgsl", "MIN_DISTANCE_RATIO", "1.1, 1.4, 2.0", "many-light", ISM),
    Sweep("many_light/ism/fill.wgsl", "MIN_REFINED_WIDTH", "0.5, 1.0, 2.0", "many-light", ISM),
    Sweep("many_light/ism/lookup.wgsl", "BIAS_NORMAL", "0.0, 0.125, 0.25, 0.5", "many-light", ISM),
    Sweep("many_light/ism/lookup.wgsl", "BIAS_DISTANCE", "0.0, 0.05, 0.1, 0.2", "many-light", ISM),
    Sweep("techniques/many_light/vpl.py", "VIEW_SAMPLES", "16, 64, 256", "many-light"),
    Sweep("techniques/many_light/vpl.py", "DENSITY_VPLS", "128, 512, 2048", "many-light"),
    Sweep("many_light/vpl/weights.wgsl", "WEIGHT_FLOOR", "0.005, 0.02, 0.1", "many-light"),
    Sweep("many_light/gather/drawn.wgsl", "RUNS", "4u, 16u, 64u", "many-light"),
    Sweep("many_light/gather/ray_counts.wgsl", "COST_RATIO", "0.05, 0.1, 0.2", "many-light", "gather.adaptive=true"),
    Sweep("many_light/gather/bound.wgsl", "BOUND_SHARE", "0.125, 0.25, 0.5, 1.0", "many-light"),
    Sweep(
        "techniques/many_light/__init__.py",
        "POINTS",
        "1 << 14, 1 << 17, 1 << 19",
        "many-light",
        "gather.visibility=ism ism.mode=pull-push",
    ),
    Sweep(
        "many_light/near_field/share.wgsl", "MAX_PLANE_DISTANCE", "0.5, 1.0, 4.0", "many-light", "ssdo.near_field=true"
    ),
    Sweep(
        "many_light/near_field/share.wgsl",
        "MAX_POINT_DISTANCE",
        "4.0, 16.0, 64.0",
        "many-light",
        "ssdo.near_field=true",
    ),
    Sweep("upload/top_level.py", "OPEN_UP_TO", "256, 1024, 2048, 8192", "balls", "environment.rays=4"),
    Sweep("upload/draw_list.py", "CLUSTER", "128, 256, 512, 1024, 2048", "balls"),
    Sweep("upload/draw_list.py", "MANY_INSTANCES", "2, 8, 32, 128", "balls"),
    Sweep("upload/direct_lights.py", "MIN_POINTS", "1024, 1 << 12, 16384", "none", "direct.emitters=maps"),
    Sweep("upload/direct_lights.py", "POINTS_PER_SAMPLE", "64, 256, 1024", "none", "direct.emitters=maps"),
    Sweep("upload/emitter_leaves.py", "LEAVES", "64, 256, 1024", "emitters"),
    Sweep("upload/emitter_cells.py", "TEXELS_PER_CELL", "0.5, 1, 4", "emitters"),
    Sweep("deferred/emitters/estimate.wgsl", "BRDF_FROM", "0.1, 0.3, 1.0", "emitters"),
    Sweep("deferred/emitters/estimate.wgsl", "NEAR_RADII", "1.0, 2.0, 4.0", "emitters"),
    Sweep("techniques/deferred/emitters.py", "BLUR", "2, 4, 8", "emitters", "camera.frames=1"),
    Sweep("ssdo/search_radius.wgsl", "FADE_START", "0.5, 0.75, 0.9", "ssdo", "ssdo.undecided=cameras"),
    Sweep("ssdo/search_radius.wgsl", "BORDER_FADE", "0.003, 0.01, 0.03", "ssdo", "ssdo.undecided=cameras"),
    Sweep("ssdo/depth_test.wgsl", "RASTER_ROUNDING", "1e-6, 4e-6, 16e-6", "ssdo"),
    Sweep("ssdo/depth_test.wgsl", "PLANE_ROUNDING", "3e-6, 1e-5, 3e-5", "ssdo"),
    Sweep("ssdo/depth_test.wgsl", "LEAST_SEPARATION", "1.0, 1.5, 2.5", "ssdo", "ssdo.undecided=cameras"),
    Sweep("ssdo/march.wgsl", "LEAST_THICKNESS", "0.5, 1.0, 2.0, 4.0", "ssdo", "ssdo.undecided=cameras"),
    Sweep("ssdo/march.wgsl", "UNEVENNESS", "0.25, 0.5, 1.0", "ssdo", "ssdo.undecided=cameras ssdo.cameras=3"),
    Sweep("ssdo/march.wgsl", "OFF_PLANE", "0.5, 1.0, 2.0", "ssdo", "ssdo.undecided=cameras ssdo.cameras=3"),
    Sweep("techniques/ssdo/search.py", "SENDER_STRIDE", "1, 2, 4", "ssdo", "ssdo.undecided=cameras"),
    Sweep("techniques/ssdo/search.py", "SKY_STRIDE", "4, 8, 16", "ssdo", "ssdo.undecided=cameras"),
    Sweep("techniques/ssdo/search_request.py", "SKY_STEP_SHARE", "1, 2, 4", "ssdo", "ssdo.undecided=cameras"),
    Sweep("techniques/ssdo/search_request.py", "INTERLEAVE", "2, 4, 8", "ssdo"),
    Sweep("techniques/ssdo/cameras.py", "WIDENING", "2.0, 4.0, 8.0", "ssdo", "ssdo.undecided=cameras"),
    Sweep(
        "techniques/ssdo/cameras.py",
        "WIDEST",
        "math.radians(55.0), math.radians(65.0), math.radians(75.0)",
        "ssdo",
        "ssdo.undecided=cameras",
    ),
    Sweep("ssdo/guide.wgsl", "LEAST_REPRESENTED", "0.05, 0.15, 0.3", "ssdo"),
    Sweep("ssil/guide.wgsl", "LEAST_REPRESENTED", "0.05, 0.3, 0.6", "ssil"),
    Sweep("ssil/vote.wgsl", "STEP_WIDTH", "0.5, 1.0, 2.0", "ssil", "ssil.start=quarter"),
    Sweep("ssil/vote.wgsl", "NORMAL_WIDTH", "0.03, 0.1, 0.3", "ssil", "ssil.start=quarter"),
    Sweep("ssil/vote.wgsl", "PLANE_WIDTH", "0.5, 1.0, 2.0", "ssil", "ssil.start=quarter"),
    Sweep("ssil/gather_depth.wgsl", "THICKNESS", "0.03, 0.1, 0.3, 1.0", "ssil", "ssil.visibility=depth"),
    Sweep("ssil/gather_depth.wgsl", "BEHIND", "0.005, 0.02, 0.05", "ssil", "ssil.visibility=depth"),
    Sweep("ssil/voxels/march.wgsl", "END_CELLS", "0.0, 0.5, 1.0, 1.5", "ssil", "ssil.visibility=voxels"),
    Sweep("ssil/voxels/march.wgsl", "LIFT", "1.25, 1.5, 1.75, 2.0", "ssil", "ssil.visibility=voxels"),
    Sweep("ssil/gather.wgsl", "BOUND_SHARE", "0.0625, 0.125, 0.25, 0.5", "ssil", "ssil.form_factor=disc"),
)


# ------------------------------------------------------------------------------------------------ in the copy


def definition(text: str, constant: str) -> re.Match[str]:
    """Return the match of a constant's definition in a shader or module; its group `value` is the value."""
    pattern = rf"^(?:(?:const|override)\s+)?{constant}\b(?:\s*:\s*\w+)?\s*=\s*(?P<value>[^;#\n]*[^;#\s])"
    found = list(re.finditer(pattern, text, re.M))
    if len(found) != 1:
        raise SystemExit(f"sweeps.py: error: {constant} is defined {len(found)} times, not once")
    return found[0]


def current_value(sweep: Sweep) -> str:
    """Return the value in use, as it is written."""
    return definition((ROOT / sweep.path).read_text(encoding="utf-8"), sweep.constant)["value"]


def make_copy(folder: Path, sweep: Sweep, value: str) -> None:
    """Copy the package and its shaders to a folder, with another value of the constant."""
    for name in ("wgpu_gi", "wgsl"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    (folder / "scenes").symlink_to(ROOT / "scenes")
    text = (folder / sweep.path).read_text(encoding="utf-8")
    found = definition(text, sweep.constant)
    (folder / sweep.path).write_text(text[: found.start("value")] + value + text[found.end("value") :], "utf-8")


def measure(reference: str, texts: list[str]) -> dict[str, tuple[float, float, float]]:
    """Render the scenes; return relMSE, bias and the milliseconds of a frame (CPU time) of each."""
    result = {}
    expected = REFERENCES[reference]
    for name in expected.scenes:
        scene = MADE[name]() if name in MADE else scene_of(name)
        truth = truth_of(expected, name, scene)
        gi = TECHNIQUE.get(reference, reference)
        settings = Settings(gi=gi, diffuse=True, bounces=expected.bounces, seed=SEED)
        settings.camera.jitter, settings.camera.frames = False, 1 if expected.turning else FRAMES
        for text in texts:
            assign(settings, text)
        renderer = Renderer(scene, size=SIZE, settings=settings)
        if expected.turning:
            turn_into(renderer, expected.show)
        renderer.run(show=(expected.show,))
        picture = renderer.read_back(expected.show)
        start = time.process_time()
        for _ in range(TIMED_FRAMES):
            renderer.step(show=(expected.show,), force=True)
        renderer.graph.device.wait()
        ms = 1000 * (time.process_time() - start) / TIMED_FRAMES
        renderer.release()
        compared = (np.nan, np.nan) if truth is None else (relmse(picture, truth), bias(picture, truth))
        result[name] = (*compared, ms)
    return result


def turn_into(renderer: Renderer, show: str) -> None:
    """Render frames of a camera that turns towards its view by half a degree per frame, up to the frame before it."""
    view = renderer.camera
    for step in range(FRAMES - 1, 0, -1):
        angle = np.radians(0.5 * step)
        turned = np.array(view.world_from_view)
        turned[:3, :3] = turned[:3, :3] @ [
            [np.cos(angle), 0, np.sin(angle)],
            [0, 1, 0],
            [-np.sin(angle), 0, np.cos(angle)],
        ]
        renderer.camera = replace(view, world_from_view=turned)
        renderer.step(show=(show,))
    renderer.camera = view


def truth_of(reference: Reference, name: str, scene: Scene) -> NDArray[np.float32] | None:
    """Return the truth of a scene; None if only the time is measured."""
    if not reference.layers:
        return None
    if name in MADE:
        settings = Settings(gi="path", diffuse=True, bounces=reference.bounces, spp=256)
        settings.camera.jitter = False
        renderer = Renderer(scene, size=SIZE, settings=settings)
        renderer.run(show=(reference.show,))
        return renderer.read_back(reference.show)
    path = VISIBLE / f"{name}_{SIZE[0]}x{SIZE[1]}.npz"
    if reference is REFERENCES["ssil"] and path.exists():
        with np.load(path) as file:
            return np.asarray(file["one"], np.float32)
    layers = layers_of(name)
    return np.asarray(sum(layers[layer] for layer in reference.layers), np.float32)


def screen() -> Scene:
    """Return a dark room with a screen that shows a few small bright spots."""
    scene = load("cornell-point")
    scene.lights = []
    pixels = np.zeros((32, 32, 4), np.uint8)
    pixels[[3, 20, 27], [5, 28, 11]] = 255
    material = Material(emission=(100.0, 100.0, 100.0), emission_texture=Texture(Image(pixels)))
    corners = np.array([[1.5, 5.4, 1.5], [4.0, 5.4, 1.5], [4.0, 5.4, 4.0], [1.5, 5.4, 4.0]], np.float32)
    triangles = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    texcoords = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    scene.instances.append(Instance(Mesh(corners, triangles, [material], texcoords0=texcoords)))
    return scene


def pictured_sky() -> Scene:
    """Return the courtyard under a sky with a bright spot."""
    return load("courtyard", environment=Environment(image=gradient_sky()))


def lamps() -> Scene:
    """Return the Cornell box with six point lights and six spots, each half as bright as the previous one."""
    scene = load("cornell-point")
    random = np.random.default_rng(1)
    scene.lights = []
    for number, place in enumerate(random.uniform((0.3, 2.0, 0.3), (5.2, 5.2, 5.2), (12, 3))):
        point, spot = PointLight(place, 2.0**-number), SpotLight(place, (0, -1, 0.3), 0.2, 0.9, 2.0**-number)
        scene.lights.append(point if number % 2 else spot)
    return scene


def balls() -> Scene:
    """Return 600,000 triangles under sun and sky: meshes with 1, 4, 16 and 96 instances."""
    scene = load("courtyard")
    random = np.random.default_rng(0)
    for count in (1, 4, 16, 96):
        ball = sphere(radius=0.15, subdivisions=4)
        for place in random.uniform((-3, 0.2, -4), (3, 3, 2), (count, 3)):
            matrix = np.eye(4)
            matrix[:3, 3] = place
            scene.instances.append(Instance(ball, matrix))
    return scene


MADE = {"pictured_sky": pictured_sky, "lamps": lamps, "screen": screen, "balls": balls}


# ------------------------------------------------------------------------------------------------ tables


def run(sweep: Sweep) -> str:
    """Measure all values of a constant; return the table."""
    scenes = REFERENCES[sweep.reference].scenes
    in_use = current_value(sweep)
    settings = f", with `{sweep.settings}`" if sweep.settings else ""
    lines = [
        f"**`{sweep.constant}`** in `{sweep.path}`{settings}:",
        "",
        "| value | " + " | ".join(name.replace("_", "-").removesuffix("-a") for name in scenes) + " | CPU ms a frame |",
        "|---" * (len(scenes) + 2) + "|",
    ]
    for value in sweep.values.split(", "):
        with tempfile.TemporaryDirectory() as folder:
            make_copy(Path(folder), sweep, value)
            command = [sys.executable, __file__, "--measure", sweep.reference, *sweep.settings.split()]
            environment = os.environ | {"PYTHONPATH": folder}
            done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        if done.returncode:
            reason = done.stderr.strip().splitlines()[-1:] or ["no message"]
            cells = ["does not run: " + reason[0], *[""] * len(scenes)]
        else:
            found = json.loads(done.stdout)
            cells = [f"{found[name][0]:.3g} / {found[name][1]:+.1%}".replace("nan / +nan%", "") for name in scenes]
            cells.append(f"{np.mean([ms for *_, ms in found.values()]):.0f}")
        lines.append(f"| {f'**{value}**' if value == in_use else value} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main(arguments: list[str]) -> int:
    """List, sweep or, in a worker, measure."""
    if arguments[:1] == ["--measure"]:
        print(json.dumps(measure(arguments[1], arguments[2:])))
        return 0
    known = {key for s in SWEEPS for key in (s.constant, s.file, s.reference)} | {"all"}
    unknown = [name for name in arguments if name not in known]
    if unknown:
        print(f"sweeps.py: error: no sweep matches {', '.join(unknown)}; call it without arguments for the list")
        return 2
    for sweep in SWEEPS:
        if not arguments:
            print(f"{sweep.reference:<11} {sweep.path}: {sweep.constant} = {current_value(sweep)}; {sweep.values}")
        elif {"all", sweep.constant, sweep.file, sweep.reference}.intersection(arguments):
            print(run(sweep) + "\n", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
