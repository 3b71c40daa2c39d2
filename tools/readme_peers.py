"""Draws many-light among other renderers anew for the README: error against time in the Cornell box under a sun.

What others take and miss was measured once, on two cores with a CPU as Vulkan adapter, in pictures of 640x360 against
4096 samples per pixel: relMSE = mean((x - t)^2 / (t^2 + 0.01)). Their sun does not stand quite where ours does, so ours
is as bright as makes direct light alone err by as much.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from wgpu_gi.measure.truth import truth_by_path
from wgpu_gi.options import Settings
from wgpu_gi.renderer import Renderer
from wgpu_gi.scene.load import load
from wgpu_gi.scene.scene import DirectionalLight, Scene
from wgpu_gi.settings import QUALITIES, apply_quality

FILE = Path(__file__).parents[1] / "scenes" / "cornell" / "peers.png"
SIZE = (640, 360)
SUN = DirectionalLight((0.35, -0.6, 0.72), 10.0)
TRUTH_SPP = 512
DIRECT_ERROR = 0.169  # of theirs
TIMED_FRAMES = 5
# Milliseconds a frame (of Cycles and Mitsuba: of the picture), relMSE.
PEERS: dict[str, tuple[float, float]] = {
    "three.js SSGI": (230, 0.068),
    "three.js voxel cones": (450, 0.028),
    "three.js probe grid,\nbaked in 13 to 20 s": (33, 0.0054),
    "three.js GTAO,\nambient by hand": (86, 0.032),
    "Babylon RSM, gain by hand": (470, 0.019),
    "EEVEE fast GI, 9 samples": (4500, 0.0125),
    "Cycles, 4 samples, denoised": (3900, 0.0008),
    "Mitsuba, 64 samples": (6302, 0.0084),
}


def main() -> int:
    """Measure many-light, print a table, draw both."""
    scene = load("cornell-point")
    scene.lights = [SUN]
    found = truth_by_path(scene, scene.cameras[0], SIZE, spp=TRUTH_SPP, diffuse=True)
    truth, direct = (found.layers[name].astype(np.float64) for name in ("full", "direct"))
    deviation = found.noise["full"].astype(np.float64)
    scale = _scale(direct, truth)
    noise = _relmse(deviation, 0 * deviation, truth, scale)
    print(f"scale {scale:.3f}, direct alone {_relmse(direct, truth, truth, scale):.3f}, noise of the truth {noise:.5f}")
    hidden = direct.sum(-1) < 1e-6 * truth.mean()
    ours = []
    for quality in QUALITIES:
        for frames in (1, None):
            settings = Settings(gi="many-light", diffuse=True)
            apply_quality(settings, quality)
            settings.camera.frames = frames or settings.camera.frames
            renderer = _rendered(scene, settings)
            picture = renderer.read_back("radiance").astype(np.float64)
            error = _relmse(picture, truth, truth, scale) - noise
            energy = picture[hidden].mean() / truth[hidden].mean()
            ms, count = _frame_ms(renderer), settings.camera.frames
            print(f"{quality}, {count} frames: {ms:.0f} ms each, relMSE {error:.5f}, energy {energy:.3f}", flush=True)
            ours.append((quality, count, count * ms, error))
    _draw(ours)
    return 0


def _rendered(scene: Scene, settings: Settings) -> Renderer:
    settings.camera.jitter = False
    renderer = Renderer(scene, size=SIZE, settings=settings)
    renderer.run(show=("radiance",))
    return renderer


def _relmse(x: NDArray[np.float64], t: NDArray[np.float64], truth: NDArray[np.float64], scale: float) -> float:
    return float((scale**2 * (x - t) ** 2 / (scale**2 * truth**2 + 0.01)).mean())


def _scale(direct: NDArray[np.float64], truth: NDArray[np.float64]) -> float:
    """Return the factor of the sun's light by which direct light alone errs by DIRECT_ERROR."""
    low, high = 1e-3, 1e3
    for _ in range(60):
        middle = (low * high) ** 0.5
        low, high = (middle, high) if _relmse(direct, truth, truth, middle) < DIRECT_ERROR else (low, middle)
    return low


def _frame_ms(renderer: Renderer) -> float:
    """Return the CPU time of a frame with everything forced, over two cores."""
    times = []
    for _ in range(2 + TIMED_FRAMES):
        start = time.process_time()
        renderer.step(show=("display",), force=True)
        renderer.graph.device.wait()
        times.append(500 * (time.process_time() - start))
    return float(np.median(times[2:]))


def _draw(ours: list[tuple[str, int, float, float]]) -> None:
    figure = Figure(figsize=(9.0, 4.6), layout="constrained")
    panel = figure.subplots()
    panel.set(xscale="log", yscale="log", xlabel="ms for the picture, 640x360, two CPU cores", ylabel="relMSE")
    panel.grid(True, which="major", color="0.88", linewidth=0.8)
    for name, (ms, error) in PEERS.items():
        panel.plot(ms, error, "s", color="#d55e00")
        panel.annotate(name, (ms, error), (6, 3), textcoords="offset points", fontsize="small")
    for still, fill in ((False, "#0072b2"), (True, "white")):
        points = [(q, n, ms, e) for q, n, ms, e in ours if (n > 1) == still]
        label = "many-light, a still picture" if still else "many-light, a single frame"
        line: dict[str, Any] = {"color": "#0072b2", "markerfacecolor": fill, "label": label}
        panel.plot([p[2] for p in points], [p[3] for p in points], "o-", **line)
        for quality, count, ms, error in points:
            text = f"{quality}, {count} frames" if still else quality
            panel.annotate(text, (ms, error), (-6, -11), textcoords="offset points", color="#0072b2", ha="right")
    panel.legend(loc="lower left", frameon=False)
    panel.set_title("The Cornell box under a sun: error against time", fontsize="medium")
    figure.savefig(FILE, dpi=130)


if __name__ == "__main__":
    sys.exit(main())
