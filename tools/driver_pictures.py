"""Render the pictures that `drivers.py` compares, on the driver of this process: `driver_pictures.py OUT.npz GI ...`.

The file holds, by "SCENE TECHNIQUE SEED", the radiance of a still picture, (h, w, 3) W/(m2 sr), by "SCENE edges" the
pixels whose neighbours show another surface, and the name of the driver. With `--times` it holds milliseconds of a
frame by technique instead: processor time over the cores, the least of several frames in which every pass runs.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))  # also where the package is not installed

from drivers import SCENES

from wgpu_gi.gpu.device import open_device
from wgpu_gi.measure.adapter.clock import cores
from wgpu_gi.options import Settings
from wgpu_gi.renderer import Renderer
from wgpu_gi.scene.load import load

SIZE, FRAMES, SPP = (96, 54), 8, 32
TIMED_SIZE, TIMED_FRAMES = (320, 180), 5
SAME_NORMAL, SAME_DEPTH = 0.99, 0.05  # cosine, and share of the distance, within which neighbours show one surface


def driver_name() -> str:
    """Return adapter and driver in use."""
    device = open_device(large_buffers=True)
    return ", ".join(filter(None, (device.adapter_name, device.driver)))


def pictures(techniques: list[str]) -> dict[str, NDArray]:
    """Return the pictures of all scenes, two seeds each, and the edges of the surfaces."""
    found: dict[str, NDArray] = {}
    for name in SCENES:
        renderer = Renderer(load(name), size=SIZE)
        for gi in techniques:
            for seed in (0, 1):
                renderer.settings = Settings(gi=gi, seed=seed, spp=SPP)
                renderer.settings.camera.frames = FRAMES
                renderer.run(show=("radiance",))
                found[f"{name} {gi} {seed}"] = np.asarray(renderer.read_back("radiance"), np.float64)
        renderer.run(show=("depth", "normal"))
        found[f"{name} edges"] = edges(
            np.asarray(renderer.read_back("depth")), np.asarray(renderer.read_back("normal"))
        )
        renderer.close()
    return found


def edges(depth: NDArray, normal: NDArray) -> NDArray[np.bool_]:
    """Return the pixels, (h, w), of which one of the eight neighbours shows another surface."""
    found = np.zeros(depth.shape, bool)
    height, width = depth.shape
    deep, turned = np.pad(depth, 1, mode="edge"), np.pad(normal, ((1, 1), (1, 1), (0, 0)), mode="edge")
    for dy in range(3):
        for dx in range(3):
            other = deep[dy : dy + height, dx : dx + width]
            cosine = (turned[dy : dy + height, dx : dx + width] * normal).sum(-1)
            found |= (np.abs(other - depth) > SAME_DEPTH * depth) | ((depth > 0) & (cosine < SAME_NORMAL))
    return found


def times(techniques: list[str]) -> dict[str, NDArray]:
    """Return the milliseconds of a frame of the Cornell box by technique."""
    found: dict[str, NDArray] = {}
    for gi in techniques:
        renderer = Renderer(load("cornell-spot"), size=TIMED_SIZE, settings=Settings(gi=gi, spp=1))
        device, least = renderer.graph.device, np.inf
        for number in range(TIMED_FRAMES + 1):
            started = time.process_time()
            renderer.step(show=("radiance",), force=True)
            device.wait()
            if number:
                least = min(least, (time.process_time() - started) / cores() * 1e3)
        found[gi] = np.array(least)
        renderer.close()
    return found


if __name__ == "__main__":
    chosen = [word for word in sys.argv[2:] if not word.startswith("--")]
    made = times(chosen) if "--times" in sys.argv else pictures(chosen)
    np.savez(sys.argv[1], driver=np.array(driver_name()), **made)  # type: ignore[arg-type]
