"""Measures the error of techniques against the truth, and the time and memory of their frames. Prints nothing."""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib import metadata
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..errors import GiError
from ..gpu.device import open_device
from ..options import TECHNIQUES, Settings, picture_count
from ..pictures.denoise import has_denoiser
from ..renderer import Renderer
from ..scene.scene import Scene
from ..techniques.reference import PathSettings
from ..techniques.shared.sampling import CameraSettings
from ..version import __version__
from .metrics import Errors, measure
from .moving_bench import measure_moving
from .moving_play import measure_played
from .results import CASES, Case, Measurement, PathPoint, Reference, Stats, title_of
from .smoother import Smoother
from .truth import LAYERS, Progress, Truth

PACKAGES = ("wgpu", "numpy")
WARM_UP_FRAMES = 3  # frames per case: the first compiles shaders, the second fills histories, the third is spare
# The camera moves on a circle that is small against the scene, so that it does not cross a wall.
ORBIT_RADIUS = 1 / 400  # share of the diagonal of the scene's bounding box: a step of about 1/1000 of it per frame
ORBIT_FRAMES = 16  # frames for one turn
# Samples of the path tracer double until a picture takes PATH_TIMES_SLOWEST times as long as the slowest technique and
# at least PATH_SECONDS, so that its curve covers the times of all techniques.
PATH_TIMES_SLOWEST = 8.0
PATH_SECONDS = 2.0
PATH_LEAST_POINTS = 3  # a curve needs three
TRACED = (*LAYERS.values(), "standard_error")  # buffers of the path tracer
MOST_PER_RUN = 64  # most samples per pixel of one run: the range of path.samples_per_run


@dataclass(frozen=True)
class Candidate:
    """A technique with all its settings."""

    gi: str
    quality: str
    settings: Settings
    variant: str = ""  # the swept settings


def machine(adapter: str | None = None) -> dict[str, Any]:
    """Return what the times depend on: adapter, driver, operating system, cores, versions."""
    device = open_device(adapter, large_buffers=True)
    # Count only the cores that this process may use.
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return {
        "adapter": device.adapter_name,
        "backend": device.backend,
        "driver": device.driver,
        "is_cpu": device.is_cpu,
        "os": platform.platform(),
        "cores": cores,
        "python": platform.python_version(),
        "packages": {"wgpu_gi": __version__} | {name: metadata.version(name) for name in PACKAGES},
    }


def measure_scene(
    scene: Scene,
    camera: Camera,
    size: tuple[int, int],
    candidates: Sequence[Candidate],
    truth_of: Callable[[int | None], Truth],
    *,
    frames: int,
    moving: bool = False,
    truth_at: Callable[[int | None, float], Truth] | None = None,
    path_seconds: float = PATH_SECONDS,
    adapter: str | None = None,
    progress: Progress | None = None,
) -> tuple[list[Measurement], list[Reference]]:
    """Measure each candidate over `frames` frames in each case, then the path tracer over the same range of times.

    `truth_of` returns the truth of a number of indirect bounces (None: all); it is called once per number. `moving`
    measures moving pictures, too, and the scene's first animation, if there is one, against `truth_at`, which takes
    seconds as well. `progress` receives the current step and its fraction done. Raises GiError for a picture that
    cannot be measured.
    """
    # Measure the techniques.
    report = progress or (lambda what, fraction: None)
    truths: dict[int | None, Truth] = {}
    measurements = []
    for candidate in candidates:
        bounces = truth_bounces(candidate.settings)
        if bounces not in truths:
            truths[bounces] = truth_of(bounces)
        renderer = Renderer(scene, size=size, camera=camera, settings=candidate.settings, adapter=adapter)
        try:
            measured = _measure_technique(renderer, candidate, truths[bounces], bounces, frames, report)
        finally:
            renderer.release()
        if moving:
            name = title_of(candidate.gi, candidate.quality, candidate.variant)
            step = partial(report, f"{name}: moving")
            errors = measure_moving(scene, camera, size, candidate.settings, frames, step, adapter)
            measured = replace(measured, moving=errors)
            if scene.animations and truth_at is not None:
                step = partial(report, f"{name}: playing")
                at = partial(truth_at, bounces)
                played = measure_played(scene, camera, size, candidate.settings, at, step, adapter)
                measured = replace(measured, played=played)
        measurements.append(measured)

    # Measure the path tracer against each truth.
    slowest = max(m.cases["all"].gpu_ms.median for m in measurements)
    budget = max(path_seconds * 1e3, PATH_TIMES_SLOWEST * slowest)
    like = candidates[0].settings
    renderer = Renderer(scene, size=size, camera=camera, adapter=adapter)
    try:
        references = [_reference(renderer, replace(like, bounces=b), t, budget, report) for b, t in truths.items()]
    finally:
        renderer.release()
    return measurements, references


def _reference(renderer: Renderer, settings: Settings, truth: Truth, budget_ms: float, report: Progress) -> Reference:
    """Return the noise of a truth, and the path tracer's curve against it."""
    curve, smooth = path_curve(renderer, settings, truth, budget_ms, report)
    own = layer_errors(truth.layers, truth)
    noise = {layer: None if errors is None else errors.floor for layer, errors in own.items()}
    return Reference(settings.bounces, truth.source, noise, curve, smooth)


def truth_bounces(settings: Settings) -> int | None:
    """Return the indirect bounces of the truth: the setting, else the number of the technique; None for all.

    A technique without indirect light is compared with all bounces, so its error includes the missing light.
    """
    return settings.bounces if settings.bounces is not None else TECHNIQUES[settings.gi].bounces or None


def _measure_technique(
    renderer: Renderer, candidate: Candidate, truth: Truth, bounces: int | None, frames: int, report: Progress
) -> Measurement:
    name = title_of(candidate.gi, candidate.quality, candidate.variant)

    def picture(frames: int) -> dict[str, Errors | None]:
        camera = replace(candidate.settings.camera, frames=frames)
        renderer.settings = replace(candidate.settings, camera=camera)
        renderer.run(partial(report, f"{name}: picture"), show=tuple(LAYERS.values()))
        try:
            return layer_errors({layer: renderer.read_back(buffer) for layer, buffer in LAYERS.items()}, truth)
        except GiError as error:
            raise GiError(f"{name}: {error}") from None

    # Errors of one frame, and of a still picture.
    errors = picture(1)
    settled_frames = picture_count(candidate.settings, renderer.scene)
    settled = picture(settled_frames) if settled_frames > 1 else errors
    # Times and memory.
    cases = {
        case: measure_case(renderer, case, frames, partial(report, f"{name}: {what}")) for case, what in CASES.items()
    }
    allocated = sum(int(resource.bytes) for resource in renderer.graph.resources.values() if resource.gpu)
    return Measurement(
        candidate.gi,
        candidate.quality,
        bounces,
        errors,
        settled,
        settled_frames,
        cases,
        allocated,
        candidate.variant,
    )


def layer_errors(pictures: dict[str, NDArray[np.float32]], truth: Truth) -> dict[str, Errors | None]:
    """Return the errors of each layer over the pixels that see a surface; None if its truth is black or unknown."""
    errors: dict[str, Errors | None] = dict.fromkeys(LAYERS)
    for layer, t in truth.layers.items():
        if truth.surface.any() and t[truth.surface].mean() > 0:
            errors[layer] = measure(pictures[layer], t, truth.noise.get(layer), truth.surface)
    return errors


def measure_case(renderer: Renderer, case: str, frames: int, report: Callable[[float], None]) -> Case:
    """Time the frames of one of `CASES` after a warm-up.

    In "all", the camera moves and every pass is forced. Frames alternate between wall time and pass times, which may
    slow a frame down; other load on the machine then affects both.
    """
    # Prepare.
    at_rest = renderer.camera
    radius = ORBIT_RADIUS * float(np.linalg.norm(np.ptp(renderer.scene.bounds(), axis=0))) or ORBIT_RADIUS
    timing, device = renderer.graph.timing, renderer.graph.device
    wall, passes, passes_run = [], [], 0
    renderer.run(show=("radiance",))

    # Render pairs of frames, one with timed passes and one without.
    for number, (frame, timed) in enumerate(product(range(-WARM_UP_FRAMES, frames), (False, True))):
        if case != "still":
            renderer.camera = orbit(at_rest, radius, number / ORBIT_FRAMES)
        timing.clear()
        started = time.perf_counter()
        renderer.step(show=("radiance",), force=case == "all", timings=timed, preview=case != "still")
        device.wait()
        elapsed = (time.perf_counter() - started) * 1e3
        if frame >= 0 and timed:
            passes.append({name: sum(samples) for name, samples in timing.samples.items()})
            passes_run = max(passes_run, len(renderer.graph.last_run))
        elif frame >= 0:
            wall.append(elapsed)
        report((number + 1) / (2 * (WARM_UP_FRAMES + frames)))
    renderer.camera = at_rest

    # Summarise.
    measured = {p.name: [frame[p.name] for frame in passes if p.name in frame] for p in renderer.graph.order}
    by_pass = {name: stats(samples) for name, samples in measured.items() if samples}
    return Case(passes_run, stats(wall), stats([sum(frame.values()) for frame in passes]), by_pass)


def stats(samples: Sequence[float]) -> Stats:
    """Return the statistics of one or more samples."""
    return Stats(float(np.median(samples)), float(np.percentile(samples, 95)))


def orbit(camera: Camera, radius: float, turns: float) -> Camera:
    """Return the camera moved on a circle of `radius` metres about its position, in its image plane."""
    world_from_view = camera.world_from_view.copy()
    angle = 2 * np.pi * turns
    world_from_view[:3, 3] += camera.world_from_view[:3, :2] @ (radius * np.array([np.cos(angle), np.sin(angle)]))
    return replace(camera, world_from_view=world_from_view)


def path_curve(
    renderer: Renderer, settings: Settings, truth: Truth, budget_ms: float, report: Progress
) -> tuple[list[PathPoint], list[PathPoint]]:
    """Render with 1, 2, 4 ... samples per pixel until a picture takes `budget_ms` or reaches the noise of the truth.

    Return the pictures, and the same after Open Image Denoise (full images; none if it is not installed). `settings`
    give bounces, seed, diffuse and path.visible_only.
    """
    points: list[PathPoint] = []
    smooth: list[PathPoint] = []
    timing, device = renderer.graph.timing, renderer.graph.device
    renderer.settings = _path_settings(settings, 1)
    renderer.run(show=TRACED, timings=True)  # warm-up: compiles
    smoother = Smoother(renderer) if has_denoiser() else None
    while True:
        spp = 2 ** len(points)
        # A new seed; with the same one, the renderer would continue from the samples of the last picture.
        renderer.settings = replace(_path_settings(settings, spp), seed=settings.seed ^ spp)
        timing.clear()
        started = time.perf_counter()
        renderer.run(partial(report, f"path tracer, {spp} spp"), show=TRACED, timings=True)
        device.wait()
        wall = (time.perf_counter() - started) * 1e3
        gpu = sum(sum(samples) for samples in timing.samples.values())
        pictures: dict[str, NDArray[np.float32]] = {
            layer: renderer.read_back(buffer) for layer, buffer in LAYERS.items()
        }
        errors = layer_errors(pictures, truth)
        points.append(PathPoint(spp, gpu, wall, errors))
        if smoother is not None:
            pictures["full"], ms = smoother(pictures["full"], renderer.read_back("standard_error"))
            alone = dict.fromkeys(LAYERS) | {"full": layer_errors(pictures, truth)["full"]}
            smooth.append(PathPoint(spp, gpu + ms, wall + ms, alone))
        full = errors["full"]
        finished = full is None or full.relmse < (full.floor or 0.0)
        if len(points) >= PATH_LEAST_POINTS and (gpu >= budget_ms or finished):
            return points, smooth


def _path_settings(settings: Settings, spp: int) -> Settings:
    """Return settings of the path tracer with as few runs as possible."""
    return Settings(
        gi="path",
        bounces=settings.bounces,
        spp=spp,
        seed=settings.seed,
        diffuse=settings.diffuse,
        camera=CameraSettings(jitter=False),
        path=PathSettings(samples_per_run=min(spp, MOST_PER_RUN), visible_only=settings.path.visible_only),
    )
