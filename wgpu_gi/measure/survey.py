"""Measures every technique in about a minute on a CPU: time and error of its pictures, at low and medium quality.

Every picture, sampled at the pixel centres, is compared with all light, path traced. Times are wall times, without
loading, uploading the scene and compiling: of a single frame, and of the still picture that a renderer shows at the
end. The path tracer is measured with 1, 2, 4 ... samples per pixel, with and without the denoiser, if there is one.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..options import TECHNIQUES, Settings, picture_count
from ..pictures.denoise import has_denoiser
from ..renderer import Renderer
from ..scene.scene import Scene
from ..settings import apply_quality
from .bench import MOST_PER_RUN, layer_errors
from .ranking import Point, frames_text
from .smoother import Smoother
from .truth import Progress, Truth, truth_by_path

SIZE = (160, 90)
QUALITIES = ("low", "medium")
REPEATS = 3  # of a single frame; the median counts
# Seconds on the machine that runs it. The longest path-traced picture takes between half of PATH_SECONDS and all, the
# truth as much of TRUTH_SECONDS. No picture begins after LATEST seconds.
PATH_SECONDS, TRUTH_SECONDS, LATEST = 4.0, 20.0, 90.0
TRACED = ("radiance", "standard_error")
LEAST_TRUTH_SPP, MOST_TRUTH_SPP = 16, 4096


@dataclass(frozen=True)
class Survey:
    """The pictures of one scene, the noise of the truth as relMSE, and the techniques that time did not allow."""

    scene: str
    size: tuple[int, int]
    truth: str
    noise: float
    points: list[Point]
    left_out: list[str]


def survey_scene(
    name: str,
    scene: Scene,
    camera: Camera,
    *,
    size: tuple[int, int] = SIZE,
    diffuse: bool = False,
    adapter: str | None = None,
    progress: Progress | None = None,
) -> Survey:
    """Measure all techniques in a scene; `progress` receives the current step and the fraction of all that is done.

    Raises GiError if a picture cannot be measured.
    """
    report = progress or (lambda what, fraction: None)
    start = time.perf_counter()
    candidates = [(gi, quality) for quality in QUALITIES for gi in TECHNIQUES if not TECHNIQUES[gi].averages_samples]
    # Shares of the whole: the path tracer, the truth, then each candidate.
    steps = 4 + len(candidates)
    with Renderer(scene, size=size, camera=camera, adapter=adapter) as renderer:
        # The path tracer's pictures say how many samples the truth can have.
        report("path", 0.0)
        traced = list(_path_pictures(renderer, diffuse, lambda fraction: report("path", fraction / steps)))
        truth = truth_by_path(
            scene,
            camera,
            size,
            spp=_truth_spp(*max((p.ms, spp) for spp, p, _ in traced if p.gi == "path")),
            diffuse=diffuse,
            adapter=adapter,
            progress=lambda what, fraction: report(what, (1 + 3 * fraction) / steps),
        )
        points = [p for _, point, picture in traced if (p := _measured(point, picture, truth))]

        # Each technique, as long as there is time.
        left_out = []
        for number, (gi, quality) in enumerate(candidates):
            report(f"{gi}, {quality}", (4 + number) / steps)
            if time.perf_counter() - start > LATEST:
                left_out.append(f"{gi}, {quality}")
                continue
            for point, picture in _pictures(renderer, gi, quality, diffuse):
                points.extend([p for p in [_measured(point, picture, truth)] if p])
    report("done", 1.0)
    own = layer_errors({"full": truth.layers["full"]}, _whole(truth))["full"]
    return Survey(name, size, truth.source, (own.floor or 0.0) if own else 0.0, points, left_out)


def _pictures(renderer: Renderer, gi: str, quality: str, diffuse: bool) -> Iterator[tuple[Point, NDArray]]:
    """Yield a single frame and the still picture of a technique, as points without errors."""
    settings = Settings(gi=gi, diffuse=diffuse)
    apply_quality(settings, quality)
    settings.camera.jitter = False
    still = picture_count(settings, renderer.scene)
    for frames in sorted({1, still}):
        renderer.settings = replace(settings, camera=replace(settings.camera, frames=frames))
        renderer.step(show=("radiance",))  # compiles
        seconds = [_picture_seconds(renderer) for _ in range(REPEATS if frames == 1 else 1)]
        ms = 1e3 * float(np.median(seconds))
        yield Point(gi, quality, frames_text(frames), ms, math.nan, math.nan), renderer.read_back("radiance")


def _picture_seconds(renderer: Renderer) -> float:
    """Render the picture anew, every pass of its first frame included; return the wall time."""
    start = time.perf_counter()
    renderer.step(show=("radiance",), force=True)
    while renderer.step(show=("radiance",)):
        pass
    renderer.graph.device.wait()
    return time.perf_counter() - start


def _path_pictures(
    renderer: Renderer, diffuse: bool, report: Callable[[float], None]
) -> Iterator[tuple[int, Point, NDArray]]:
    """Yield pictures of the path tracer with 1, 2, 4 ... samples, each also denoised: samples, point without errors."""
    settings = Settings(gi="path", spp=1, diffuse=diffuse)
    settings.camera.jitter = False
    renderer.settings = settings
    renderer.run(show=TRACED)  # compiles
    smoother = Smoother(renderer) if has_denoiser() else None
    spp, ms, done = 1, 0.0, 0.0
    while ms < 500 * PATH_SECONDS:
        # A new seed, so that no sample of the last picture counts.
        samples = replace(settings.path, samples_per_run=min(spp, MOST_PER_RUN))
        renderer.settings = replace(settings, spp=spp, seed=spp, path=samples)
        start = time.perf_counter()
        renderer.run(show=TRACED)
        renderer.graph.device.wait()
        ms = 1e3 * (time.perf_counter() - start)
        picture = renderer.read_back("radiance")
        yield spp, Point("path", "", f"{spp} spp", ms, math.nan, math.nan), picture
        if smoother is not None:
            smooth, more = smoother(picture, renderer.read_back("standard_error"))
            yield spp, Point("path, denoised", "", f"{spp} spp", ms + more, math.nan, math.nan), smooth
        done = max(done, min(ms / (1e3 * PATH_SECONDS), 1.0))
        report(done)
        spp *= 2


def _truth_spp(ms: float, samples: int) -> int:
    """Return the samples of the truth, a power of two, that take at most TRUTH_SECONDS if `samples` take `ms`."""
    spp = 2 ** math.floor(math.log2(1e3 * TRUTH_SECONDS * samples / ms))
    return min(max(spp, LEAST_TRUTH_SPP), MOST_TRUTH_SPP)


def _measured(point: Point, picture: NDArray, truth: Truth) -> Point | None:
    """Return a point with its errors; None if the truth is black."""
    errors = layer_errors({"full": picture}, _whole(truth))["full"]
    return None if errors is None else replace(point, relmse=errors.relmse, bias=errors.bias)


def _whole(truth: Truth) -> Truth:
    """Return the truth of the full picture alone."""
    return replace(truth, layers={"full": truth.layers["full"]})
