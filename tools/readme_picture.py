"""Makes the picture of the README anew that shows every technique beside the truth, with its error."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from wgpu_gi.measure.metrics import bias, relmse
from wgpu_gi.options import Settings
from wgpu_gi.renderer import Renderer
from wgpu_gi.scene.load import load
from wgpu_gi.scene.scene import Scene

FOLDER = Path(__file__).parents[1] / "scenes" / "cornell"
CELL = (400, 300)
CAPTION = 22  # pixels
TECHNIQUES = {"many-light": "many-light", "ssil": "SSIL", "ssdo": "SSDO", "none": "direct light only"}
TRUTH_SPP = 512


def main() -> int:
    """Draw the Cornell box by every technique, and where many-light errs."""
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
    return 0


def _render(scene: Scene, size: tuple[int, int], settings: Settings) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    renderer = Renderer(scene, size=size, settings=settings)
    renderer.run(show=("radiance", "display"))
    return renderer.read_back("radiance"), np.asarray(renderer.read_back("display"))


if __name__ == "__main__":
    sys.exit(main())
