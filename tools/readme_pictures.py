"""Draw the pictures of README.md: techniques and Sponza beside the truth, each kind of error, a scene that moves.

    python tools/readme_pictures.py techniques
    python tools/readme_pictures.py error NAME           # one of ERRORS
    python tools/readme_pictures.py budgets              # pictures of three error budgets with their certificates
    python tools/readme_pictures.py walk                 # four frames of the walking figure
    python tools/readme_pictures.py sponza sponza.glb truth.npz
    python tools/readme_pictures.py sheets sponza.glb    # single frame, still picture, truth, difference: tests/truth

Mitsuba 3 renders Sponza's truth, with the same camera, sky and sun:

    python tools/make_references.py sponza.glb --jitter --size 640x360 --spp 2048 -o truth.npz --env 3,4,6 \\
        --light "sun 0.19518,-0.9759,0.09759 100,95,85" --camera view.json

with {"position": [5.5, 2.95, -0.35], "target": [4.38, 3, -0.35]} in view.json.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from wgpu_gi.__main__ import main as command
from wgpu_gi.budget.refine import render_within
from wgpu_gi.camera import Camera
from wgpu_gi.measure.metrics import bias, relmse
from wgpu_gi.options import Settings
from wgpu_gi.pictures.display import display_layer
from wgpu_gi.renderer import Renderer
from wgpu_gi.scene.load import load
from wgpu_gi.scene.scene import DirectionalLight, Environment, Scene

SCENES = Path(__file__).parents[1] / "scenes"
TRUTH = Path(__file__).parents[1] / "tests" / "truth" / "pictures"
CAPTION = 22  # pixels
GAP = 4
TRUTH_SPP = 512
SHEET_SPP = 256
BUDGETS = (0.3, 0.1, 0.01)  # relMSE
WALK, FPS = range(12, 144, 33), 24  # frames of the animation, and per second
SHEETS = {"ssdo": "SSDO", "ssil": "SSIL", "many-light": "many-light"}
TECHNIQUES = {"many-light": "many-light", "ssil": "SSIL", "ssdo": "SSDO", "none": "direct light only"}

Array = NDArray[np.float32]
Cell = tuple[str, Array]  # a caption, and sRGB values in [0, 1]


def techniques() -> None:
    """Draw the Cornell box by every technique, and the error of many-light."""
    scene, size = load("cornell-point"), (400, 300)
    truth = render(scene, size, Settings(gi="path", spp=TRUTH_SPP))
    cells = [(f"path tracer, {TRUTH_SPP} samples: the truth", shown(truth, 0.0))]
    for gi, name in TECHNIQUES.items():
        picture = render(scene, size, Settings(gi=gi))
        errors = f"relMSE {relmse(picture, truth):.2g}, bias {bias(picture, truth):+.1%}"
        cells.append((f"{name}: {errors}", shown(picture, 0.0)))
        if gi == "many-light":
            relative = np.abs(picture - truth).mean(-1) / (truth.mean(-1) + 0.1 * truth.mean())
            grey = np.clip(5 * relative, 0, 1)[..., None].repeat(3, -1)
            cells.append(("five times the relative error of many-light", grey))
    sheet(SCENES / "cornell" / "techniques.png", cells, 3)


def sheets(model: str) -> None:
    """Draw a sheet per technique: one bounce in four scenes as single frame, still picture, truth and difference."""
    lit_side, gallery = load("curtain"), sponza_scene(model)
    lit_side.cameras = [Camera.look_at((-2.7, 1.6, -1.5), (-0.2, 1.1, 0.5), yfov_deg=65.0)]
    gallery.cameras = [Camera.look_at((-9.0, 6.3, 4.0), (0.0, 4.6, -0.6), yfov_deg=60.0)]
    scenes = {
        "Cornell": load("cornell-point"),
        "curtain, lit side": lit_side,
        "courtyard": load("courtyard"),
        "Sponza, gallery": gallery,
    }
    size = (240, 135)
    truths: dict[tuple[str, bool], Array] = {}
    for gi, title in SHEETS.items():
        cells: list[Cell] = []
        for name, scene in scenes.items():
            # SSIL finds light of visible surfaces only, so its truth is restricted to them.
            key = name, gi == "ssil"
            if key not in truths:
                exact = Settings(gi="path", diffuse=True, bounces=1, spp=SHEET_SPP)
                exact.path.visible_only = gi == "ssil"
                exact.camera.jitter = False
                truths[key] = render(scene, size, exact)
            truth = truths[key]
            frames = [_one_bounce(scene, size, gi, count) for count in (1, 24)]
            exposure = math.log2(0.4 / float(truth.mean()))
            difference = np.clip(0.5 + (frames[1] - truth) / (4 * truth.mean()), 0, 1)
            cells += [
                (f"{title}: {name}, one frame, {relmse(frames[0], truth):.2g}", shown(frames[0], exposure)),
                (
                    f"24 frames, {relmse(frames[1], truth):.2g}, {bias(frames[1], truth):+.1%}",
                    shown(frames[1], exposure),
                ),
                (f"path tracer, {SHEET_SPP} samples", shown(truth, exposure)),
                ("difference of 24 frames; grey: none", difference.astype(np.float32)),
            ]
        sheet(TRUTH / f"{gi}.webp", cells, 4)


def _one_bounce(scene: Scene, size: tuple[int, int], gi: str, frames: int) -> Array:
    """Return the radiance of one bounce at pixel centres, the mean of `frames` frames."""
    settings = Settings(gi=gi, diffuse=True, bounces=1)
    settings.camera.jitter, settings.camera.frames = False, frames
    return render(scene, size, settings)


def error(name: str) -> None:
    """Draw a pair of pictures, technique and truth, for a kind of error."""
    size = (216, 144)
    make_scene, exposure, spp, settings = ERRORS[name]
    scene = make_scene()
    picture, truth = render(scene, size, settings), render(scene, size, Settings(gi="path", spp=spp))
    print(f"{name}: relMSE {relmse(picture, truth):.2g}, bias {bias(picture, truth):+.1%}", flush=True)
    cells = [(settings.gi, shown(picture, exposure)), ("truth", shown(truth, exposure))]
    sheet(SCENES / "errors" / f"{name}.png", cells, 2)


def walk() -> None:
    """Draw frames of the walking figure, made by the command line."""
    with TemporaryDirectory() as folder:
        arguments = ["--frames", f"{WALK.start}:{WALK.stop}:{WALK.step}", "--size", "288x162", "--quality", "high"]
        if command(["render", "walk", "-o", f"{folder}/{{frame}}.png", *arguments]):
            raise SystemExit("the frames failed")
        cells: list[Cell] = []
        for frame in WALK:
            with Image.open(f"{folder}/{frame}.png") as picture:
                cells.append((f"{frame / FPS:.3g} s", np.asarray(picture.convert("RGB"), np.float32) / np.float32(255)))
    sheet(SCENES / "walk" / "walk.png", cells, len(cells))


def budgets() -> None:
    """Draw the Cornell box within error budgets, each under what was chosen and certified."""
    cells = []
    for error_wanted in BUDGETS:
        renderer = Renderer("cornell", size=(280, 210))
        outcome = render_within(renderer, None, error_wanted)
        assert outcome.certificate is not None
        found = outcome.certificate.relmse
        certified = f"{found.value:.2g} ({found.low:.2g} to {found.high:.2g})"
        cells.append((f"{outcome.candidate}: {certified}", shown(renderer.read_back(), 1.0)))
    sheet(SCENES / "errors" / "budgets.png", cells, len(BUDGETS))


def sponza(model: str, truth_file: str) -> None:
    """Draw Sponza by many-light beside its truth, shown at three quarters of the size."""
    truth = stored_truth(truth_file)
    start = time.perf_counter()
    picture = render(sponza_scene(model), (truth.shape[1], truth.shape[0]), Settings(gi="many-light", diffuse=True))
    seconds = time.perf_counter() - start
    print(f"relMSE {relmse(picture, truth):.3g}, bias {bias(picture, truth):+.1%}, {seconds:.0f} s")
    cells = [("wgpu_gi, many-light", shown(picture, 0.0)), ("path traced: the truth", shown(truth, 0.0))]
    sheet(SCENES / "sponza" / "sponza.png", [(caption, smaller(cell, 480)) for caption, cell in cells], 2)


def sponza_scene(model: str) -> Scene:
    """Return Sponza with sun, sky and camera."""
    scene = load(
        model,
        environment=Environment((3.0, 4.0, 6.0)),
        lights=[DirectionalLight((0.19518, -0.9759, 0.09759), 1.0, (100.0, 95.0, 85.0))],
    )
    scene.cameras = [Camera.look_at((5.5, 2.95, -0.35), (4.38, 3.0, -0.35), yfov_deg=60.0)]
    return scene


def stored_truth(file: str) -> Array:
    """Return the radiance that `make_references.py` stored."""
    with np.load(file) as layers:
        return np.sum([layers[name] for name in ("emit", "direct", "one", "multi")], 0, np.float32)


def render(scene: Scene, size: tuple[int, int], settings: Settings) -> Array:
    """Return the radiance of a picture."""
    renderer = Renderer(scene, size=size, settings=settings)
    renderer.run(show=("radiance",))
    picture = np.asarray(renderer.read_back("radiance"))
    renderer.release()
    return picture


def moving(gi: str) -> Settings:
    """Return the settings of a single frame: a moving camera has one frame per view."""
    settings = Settings(gi=gi)
    settings.camera.frames = 1
    return settings


def corridor() -> Scene:
    """Return the corridor, which gets its light through doors."""
    scene = load("corridor")
    scene.cameras = scene.cameras[-1:]
    return scene


# Scene, exposure, samples of the truth, settings.
ERRORS: dict[str, tuple[Callable[[], Scene], float, int, Settings]] = {
    "noise": (lambda: load("cornell"), 1.0, 256, Settings(gi="path", spp=4)),
    "direct_only": (lambda: load("cornell"), 1.0, 256, Settings(gi="none")),
    "moving": (corridor, -2.5, 512, moving("many-light")),
    "blotches": (lambda: load("cornell-point"), 0.0, 256, moving("ssdo")),
    "out_of_view": (lambda: load("cornell"), 1.0, 256, Settings(gi="ssil")),
}


def shown(radiance: Array, exposure: float) -> Array:
    """Return linear radiance as displayed on a screen."""
    return display_layer("radiance", radiance, exposure)


def smaller(cell: Array, width: int) -> Array:
    """Return a cell with fewer pixels."""
    size = (width, round(width * cell.shape[0] / cell.shape[1]))
    image = Image.fromarray((255 * cell + 0.5).astype(np.uint8)).resize(size, Image.Resampling.LANCZOS)
    return np.asarray(image, np.float32) / np.float32(255)


def sheet(path: Path, cells: Sequence[Cell], columns: int) -> None:
    """Write cells of one size in rows, each under its caption."""
    height, width = cells[0][1].shape[:2]
    step_x, step_y = width + GAP, height + CAPTION + GAP
    image = Image.new("RGB", (columns * step_x - GAP, -(-len(cells) // columns) * step_y - GAP), "white")
    draw, font = ImageDraw.Draw(image), ImageFont.load_default(15 if width > 300 else 13)
    for number, (caption, pixels) in enumerate(cells):
        x, y = number % columns * step_x, number // columns * step_y
        draw.text((x + 2, y + 2), caption, fill="black", font=font)
        image.paste(Image.fromarray((255 * pixels + 0.5).astype(np.uint8)), (x, y + CAPTION))
    path.parent.mkdir(exist_ok=True)
    image.save(path, **({"quality": 85} if path.suffix == ".webp" else {"optimize": True}))


def main(arguments: Sequence[str]) -> int:
    """Draw what the first argument names."""
    match list(arguments):
        case ["techniques"]:
            techniques()
        case ["error", name] if name in ERRORS:
            error(name)
        case ["budgets"]:
            budgets()
        case ["walk"]:
            walk()
        case ["sponza", model, truth_file]:
            sponza(model, truth_file)
        case ["sheets", model]:
            sheets(model)
        case _:
            print(__doc__, file=sys.stderr)
            return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
