"""Makes pictures of the README anew: every technique beside the truth, and error against time beside other renderers.

python tools/readme_pictures.py techniques peers
"""

from __future__ import annotations

import argparse
import importlib
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from wgpu_gi.frame import CameraSettings, Settings
from wgpu_gi.metrics import bias, relmse
from wgpu_gi.renderer import Renderer
from wgpu_gi.scene.load import load
from wgpu_gi.scene.scene import DirectionalLight, Scene
from wgpu_gi.settings import apply_quality

FOLDER = Path(__file__).parents[1] / "scenes" / "cornell"

CELL = (400, 300)
CAPTION = 22  # pixels
TECHNIQUES = {"many-light": "many-light", "ssil": "SSIL", "ssdo": "SSDO", "none": "direct light only"}
TRUTH_SPP = 512

PEERS_SIZE = (640, 360)
SUN = DirectionalLight((0.35, -0.6, -0.72), 10.0)
# Other renderers on a machine of the same kind, each measured once, under a sun that stands nearly there: ms of a
# frame, or of a whole picture, and relMSE with epsilon 0.01. A bake before the first frame is not in it.
PEERS = {
    "three.js, SSGI": (230, 0.068),
    "three.js, voxel cones": (450, 0.028),
    "three.js, probes (after a bake of 13 to 20 s)": (33, 0.0054),
    "Babylon, RSM": (470, 0.019),
    "EEVEE, fast GI, 9 samples": (4500, 0.0125),
    "Cycles, 4 samples, denoised": (3900, 0.0008),
    "Cycles, 4 samples": (1440, 0.153),
    "Mitsuba, 16 samples": (1724, 0.033),
}
TIMED_FRAMES = 7


def techniques() -> None:
    """Draw the Cornell box by every technique, with its error, and where many-light errs."""
    scene = load("cornell-point")
    truth, shown = _render(scene, CELL, Settings(gi="path", spp=TRUTH_SPP))
    cells = [(f"path tracer, {TRUTH_SPP} samples: the truth", shown)]
    for gi, name in TECHNIQUES.items():
        picture, shown = _render(scene, CELL, Settings(gi=gi))
        cells.append((f"{name}: relMSE {relmse(picture, truth):.2g}, bias {bias(picture, truth):+.1%}", shown))
        if gi == "many-light":
            relative = np.abs(picture - truth).mean(-1) / (truth.mean(-1) + 0.1 * truth.mean())
            grey = (np.clip(5 * relative, 0, 1) * 255).astype(np.uint8)
            cells.append(("five times the relative error of many-light", np.repeat(grey[..., None], 3, -1)))
    width, height = CELL[0] + 4, CELL[1] + CAPTION + 4
    sheet = Image.new("RGB", (3 * width - 4, 2 * height - 4), "white")
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(15)
    for number, (caption, pixels) in enumerate(cells):
        x, y = number % 3 * width, number // 3 * height
        draw.text((x + 4, y + 2), caption, fill="black", font=font)
        sheet.paste(Image.fromarray(np.ascontiguousarray(pixels[..., :3])), (x, y + CAPTION))
    sheet.save(FOLDER / "techniques.png", optimize=True)


def _render(scene: Scene, size: tuple[int, int], settings: Settings) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    renderer = Renderer(scene, size=size, settings=settings)
    renderer.run(show=("radiance", "display"))
    return renderer.read_back("radiance"), np.asarray(renderer.read_back("display"))


def peers() -> None:
    """Draw error against time of many-light, at each quality and after 1, 4, 16 ... frames, and of other renderers."""
    scene = load("cornell-point")
    scene.lights = [SUN]
    centres = CameraSettings(jitter=False)
    renderer = Renderer(
        scene, size=PEERS_SIZE, settings=Settings(gi="path", spp=TRUTH_SPP, diffuse=True, camera=centres)
    )
    renderer.run(show=("radiance", "standard_error"))
    truth, deviation = renderer.read_back("radiance"), renderer.read_back("standard_error")
    floor = float((deviation**2 / (truth**2 + 0.01)).mean())
    figure = importlib.import_module("matplotlib.figure").Figure(figsize=(8, 4.8), layout="constrained")
    panel = figure.subplots()
    for quality, counts, color in (
        ("low", (1, 4), "#56b4e9"),
        ("medium", (1, 4, 16), "#0072b2"),
        ("high", (1, 4), "#009e73"),
    ):
        points = [_settled(scene, quality, frames, truth, floor) for frames in counts]
        panel.plot(*zip(*points, strict=True), color=color, marker="o", label=f"many-light, {quality}")
        for frames, (ms, error) in zip(counts, points, strict=True):
            print(f"many-light, {quality}, {frames} frames: {ms:.0f} ms, relMSE {error:.5f}")
            text = f"{frames} frame{'s' * (frames > 1)}"
            panel.annotate(text, (ms, error), (5, 5), textcoords="offset points", fontsize="x-small", color=color)
    for name, point in PEERS.items():
        panel.plot(*point, "k^")
        panel.annotate(name, point, (6, 3), textcoords="offset points", fontsize="small")
    panel.set(xscale="log", yscale="log", xlim=(20, 30_000), xlabel="ms, two cores of a CPU", ylabel="relMSE")
    panel.grid(True, which="major", color="0.88")
    panel.set_axisbelow(True)
    panel.spines[["top", "right"]].set_visible(False)
    panel.legend(frameon=False, loc="upper left")
    panel.set_title("The Cornell box under a sun, 640x360", fontsize="medium")
    figure.savefig(FOLDER / "peers.png", dpi=110)


def _settled(scene: Scene, quality: str, frames: int, truth: NDArray[np.float32], floor: float) -> tuple[float, float]:
    """Return the ms of so many frames, each of them forced, and the relMSE of their mean without the truth's noise."""
    settings = Settings(gi="many-light", diffuse=True)
    apply_quality(settings, quality)
    settings.camera = CameraSettings(jitter=False, frames=frames)
    renderer = Renderer(scene, size=PEERS_SIZE, settings=settings)
    renderer.run(show=("radiance",))
    picture = renderer.read_back("radiance")
    taken = []
    for _ in range(TIMED_FRAMES):
        # Of all cores: what a machine without other work takes as time.
        started = time.process_time()
        renderer.step(show=("display",), force=True)
        renderer.graph.device.wait()
        taken.append(1e3 * (time.process_time() - started) / 2)
    return frames * float(np.median(taken)), float(((picture - truth) ** 2 / (truth**2 + 0.01)).mean()) - floor


def main() -> int:
    """Make the pictures that are named."""
    made: dict[str, Callable[[], None]] = {"techniques": techniques, "peers": peers}
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="+", choices=made, metavar="NAME", help=", ".join(made))
    for name in parser.parse_args().names:
        made[name]()
    return 0


if __name__ == "__main__":
    sys.exit(main())
