"""Draw the plots of README.md and tools/README.md: error against time of the techniques, and of other renderers.

    python tools/readme_plots.py techniques    # from the table "Error against time" of tools/README.md
    python tools/readme_plots.py peers         # measures ours first; needs pyoidn

Time and error of other renderers were measured once, on two cores with a CPU as Vulkan adapter, in pictures of 640x360
against 4096 samples per pixel: relMSE = mean((x - t)^2 / (t^2 + 0.01)). The direction of their sun differs slightly, so
our sun is scaled until direct light alone has their error.
"""

from __future__ import annotations

import re
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from wgpu_gi.measure.smoother import Smoother
from wgpu_gi.measure.truth import truth_by_path
from wgpu_gi.options import Settings
from wgpu_gi.renderer import Renderer
from wgpu_gi.scene.load import load
from wgpu_gi.scene.scene import DirectionalLight, Scene
from wgpu_gi.settings import QUALITIES, apply_quality

FOLDER = Path(__file__).parents[1] / "scenes" / "cornell"
TABLE = Path(__file__).parent / "README.md"
# For each scene: its column in the table; milliseconds and relMSE of the path tracer.
PANELS = {"Cornell box, area light": (2, 3200, 0.015), "Sponza, sun and sky": (4, 6700, 0.46)}
FRAMES = {"low": 4, "medium": 24, "high": 64}  # frames of a still picture
# Okabe and Ito 2008, for any colour vision.
COLORS = {"many-light": "#0072b2", "ssdo": "#d55e00", "ssil": "#009e73", "none": "0.35"}
SIZE = (640, 360)
SUN = DirectionalLight((0.35, -0.6, 0.72), 10.0)
TRUTH_SPP = 64  # its noise is subtracted
TRACED = ("radiance", "standard_error")
PATH_SPP = (1, 4, 16, 64)
DIRECT_ERROR = 0.169  # relMSE of direct light alone for their sun
TIMED_FRAMES = 5
# Milliseconds per frame (for Cycles and Mitsuba: per picture), relMSE.
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


def main(arguments: Sequence[str]) -> int:
    """Draw what the argument names."""
    plots = {"techniques": techniques, "peers": peers}
    if len(arguments) != 1 or arguments[0] not in plots:
        print(__doc__, file=sys.stderr)
        return 2
    plots[arguments[0]]()
    return 0


def techniques() -> None:
    """Draw the techniques in two scenes, each as a line from low to high quality."""
    figure = Figure(figsize=(9.0, 3.9), layout="constrained")
    for panel, (title, (column, path_ms, path_error)) in zip(figure.subplots(1, 2), PANELS.items(), strict=True):
        panel.set(xscale="log", yscale="log", title=title, xlabel="time for the still picture")
        panel.grid(True, which="major", color="0.9", linewidth=0.8)
        panel.spines[["top", "right"]].set_visible(False)
        for name, color in COLORS.items():
            points = table_points(column, name)
            if name == "none":  # quality changes its error little
                points = points[1:2]
            panel.plot(*zip(*points, strict=True), "o-", color=color, markersize=6)
            label(panel, name, points[-1], color)
        panel.plot(path_ms, path_error, "s", color="black")
        label(panel, "path tracer", (path_ms, path_error), "black", (-26, -15) if column == 2 else (6, 12))
        panel.set_xlim(40, 1_500_000)
        panel.set_xticks([100, 1000, 10_000, 100_000], ["0.1 s", "1 s", "10 s", "100 s"])
        panel.set_xticks([], minor=True)
    figure.axes[0].set_ylabel("relMSE of the still picture")
    figure.savefig(FOLDER / "error_time.png", dpi=130)


def label(panel: Any, text: str, point: tuple[float, float], color: str, offset: tuple[int, int] = (8, 0)) -> None:
    """Write a name beside a point."""
    panel.annotate(text, point, offset, textcoords="offset points", color=color, va="center", fontsize=10)


def table_points(column: int, technique: str) -> list[tuple[float, float]]:
    """Return (milliseconds for the still picture, its relMSE) at low, medium and high quality."""
    points = []
    for quality, frames in FRAMES.items():
        row = rf"\| {technique}, {quality} \|(?:[^|]*\|){{{column - 1}}} (\d+), \d+; (\S+) /"
        found = re.search(row, TABLE.read_text(encoding="utf-8"))
        assert found is not None, row
        points.append(((1 if technique == "none" else frames) * float(found[1]), float(found[2])))
    return points


def peers() -> None:
    """Measure many-light and the path tracer, print a table, draw all."""
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
    # The path tracer, with and without the denoiser.
    traced = []
    for spp in PATH_SPP:
        picture, smooth, ms, more = _path(scene, spp)
        for text, x, time_ms in (("", picture, ms), (", denoised", smooth, ms + more)):
            error = _relmse(x.astype(np.float64), truth, truth, scale) - noise
            energy = x[hidden].mean() / truth[hidden].mean()
            print(f"path, {spp} samples{text}: {time_ms:.0f} ms, relMSE {error:.5f}, energy {energy:.3f}", flush=True)
            traced.append((f"{spp}{text}", time_ms, error))
    _draw(ours, traced)


def _path(scene: Scene, spp: int) -> tuple[NDArray, NDArray, float, float]:
    """Return a path-traced picture, the same denoised, and the milliseconds of each step: CPU time over two cores."""
    settings = Settings(gi="path", spp=1, diffuse=True)
    renderer = _rendered(scene, settings)
    smoother = Smoother(renderer)
    renderer.settings.spp, renderer.settings.seed = spp, spp
    start = time.process_time()
    renderer.run(show=TRACED)
    renderer.graph.device.wait()
    ms = 500 * (time.process_time() - start)
    start = time.process_time()
    picture = renderer.read_back("radiance")
    smooth, _ = smoother(picture, renderer.read_back("standard_error"))
    return picture, smooth, ms, 500 * (time.process_time() - start) + smoother.features_ms


def _rendered(scene: Scene, settings: Settings) -> Renderer:
    settings.camera.jitter = False
    renderer = Renderer(scene, size=SIZE, settings=settings)
    renderer.run(show=("radiance",))
    return renderer


def _relmse(x: NDArray[np.float64], t: NDArray[np.float64], truth: NDArray[np.float64], scale: float) -> float:
    return float((scale**2 * (x - t) ** 2 / (scale**2 * truth**2 + 0.01)).mean())


def _scale(direct: NDArray[np.float64], truth: NDArray[np.float64]) -> float:
    """Return the factor on the sun's light for which direct light alone has the relMSE DIRECT_ERROR."""
    low, high = 1e-3, 1e3
    for _ in range(60):
        middle = (low * high) ** 0.5
        low, high = (middle, high) if _relmse(direct, truth, truth, middle) < DIRECT_ERROR else (low, middle)
    return low


def _frame_ms(renderer: Renderer) -> float:
    """Return the milliseconds of a frame with every pass forced: CPU time over two cores."""
    times = []
    for _ in range(2 + TIMED_FRAMES):
        start = time.process_time()
        renderer.step(show=("display",), force=True)
        renderer.graph.device.wait()
        times.append(500 * (time.process_time() - start))
    return float(np.median(times[2:]))


def _draw(ours: list[tuple[str, int, float, float]], traced: list[tuple[str, float, float]]) -> None:
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
    for text, color in (("", "black"), (", denoised", "0.5")):
        curve = [(ms, error) for name, ms, error in traced if name.endswith(", denoised") == bool(text)]
        label = f"path tracer{text}: {PATH_SPP[0]} to {PATH_SPP[-1]} samples"
        panel.plot(*zip(*curve, strict=True), ".-", color=color, label=label)
    panel.legend(loc="lower left", frameon=False)
    panel.set_title("The Cornell box under a sun: error against time", fontsize="medium")
    figure.savefig(FOLDER / "peers.png", dpi=130)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
