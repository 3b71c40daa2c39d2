"""Times the passes of every technique at full size, while the camera moves and every pass runs; and the main thread.

Passes are timed by timestamps where `timestamps.py` found them right, else by submitting each and waiting, on a CPU by
its processor time (`clock.py`). Frames are repeated for REPEAT_SECONDS: a hundred on a GPU, one or two on a CPU.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from statistics import median

import numpy as np

from ...camera import Camera
from ...options import TECHNIQUES
from ...renderer import Renderer
from ...scene.scene import Scene
from ..bench import ORBIT_FRAMES, ORBIT_RADIUS, orbit
from .budget import Budget
from .clock import clock_for
from .results import MainThread, PassTimes, SceneTimes
from .scenes import VARIANTS, Variant

SIZE = (1920, 1080)
SMALL = (480, 270)  # a sixteenth of the pixels: compiles the shaders and predicts the time
SHOW = ("display",)  # what a window shows
REPEAT_SECONDS = 1.0  # for frames with timed passes, and again for frames without
MOST_FRAMES = 100
FRAMES_AT_LEAST = 4  # a warm-up, one with timed passes, one without; and one for the error of the prediction
THREAD_SIZE, THREAD_FRAMES, THREAD_WARM_UP = (64, 36), 21, 4


def measure_scene(name: str, scene: Scene, camera: Camera, budget: Budget, adapter: str | None = None) -> SceneTimes:
    """Return the times of the techniques in a scene; the budget notes what did not fit."""
    found = SceneTimes(name, SIZE, [])
    for variant in VARIANTS:
        what = f"{variant.title} in {name} at {SIZE[0]}x{SIZE[1]}"
        if not budget.allows(what):
            continue
        with budget.noting(what):
            times = _measure(variant, variant.scene(scene), camera, budget, what, adapter)
            if times is not None:
                found.techniques.append(times)
    return found


def _measure(
    variant: Variant, scene: Scene, camera: Camera, budget: Budget, what: str, adapter: str | None
) -> PassTimes | None:
    """Time a technique; return None if it does not fit the budget."""
    renderer = Renderer(scene, size=SMALL, camera=camera, settings=variant.settings(), adapter=adapter)
    try:
        # Small frames compile the shaders and tell whether the full size fits.
        frame = _moving(renderer, scene, camera)
        frame(False)
        started = time.perf_counter()
        frame(False)
        seconds = (time.perf_counter() - started) * SIZE[0] * SIZE[1] / (SMALL[0] * SMALL[1])
        if not budget.allows(what, FRAMES_AT_LEAST * seconds):
            return None
        renderer.size = SIZE
        frame(False)

        # Frames with timed passes, then frames without.
        timing = renderer.graph.timing
        timing.clock = clock_for(renderer.is_cpu)
        passes: list[dict[str, float]] = []

        def timed() -> None:
            timing.clear()
            frame(True)
            passes.append({name: sum(samples) for name, samples in timing.samples.items()})

        plain: list[float] = []
        _repeat(timed, budget)
        _repeat(lambda: plain.append(frame(False)), budget)
        order = [p.name for p in renderer.graph.order]
        by_pass = {name: median([p[name] for p in passes if name in p]) for name in order if name in passes[-1]}
        allocated = sum(int(resource.bytes) for resource in renderer.graph.resources.values() if resource.gpu)
        return PassTimes(
            variant.title,
            median([sum(p.values()) for p in passes]),
            median(plain) * 1e3,
            by_pass,
            allocated,
            len(plain),
        )
    finally:
        renderer.close()


def _repeat(work: Callable[[], object], budget: Budget) -> None:
    """Do the work once, and again while REPEAT_SECONDS and the budget last."""
    started = time.perf_counter()
    for _ in range(MOST_FRAMES):
        work()
        if time.perf_counter() - started > REPEAT_SECONDS or budget.left < 0:
            return


def _moving(renderer: Renderer, scene: Scene, camera: Camera) -> Callable[[bool], float]:
    """Return a function that renders the next frame of a camera on a circle, with every pass, and returns its seconds.

    Its argument says whether to time the passes.
    """
    radius = ORBIT_RADIUS * float(np.linalg.norm(np.ptp(scene.bounds(), axis=0))) or ORBIT_RADIUS
    device, clock, number = renderer.graph.device, clock_for(renderer.is_cpu), 0

    def frame(timings: bool) -> float:
        nonlocal number
        number += 1
        renderer.camera = orbit(camera, radius, number / ORBIT_FRAMES)
        started = clock()
        renderer.step(show=SHOW, force=True, timings=timings, preview=True)
        device.wait()
        return clock() - started

    return frame


def measure_threads(scene: Scene, camera: Camera, budget: Budget, adapter: str | None = None) -> list[MainThread]:
    """Return the main thread's part of frames of a small picture in which the camera moves."""
    found = []
    radius = ORBIT_RADIUS * float(np.linalg.norm(np.ptp(scene.bounds(), axis=0))) or ORBIT_RADIUS
    for variant in VARIANTS:
        what = f"main thread of {variant.title}"
        if TECHNIQUES[variant.gi].averages_samples or not budget.allows(what):
            continue
        settings = variant.settings()
        with (
            budget.noting(what),
            Renderer(
                variant.scene(scene), size=THREAD_SIZE, camera=camera, settings=settings, adapter=adapter
            ) as renderer,
        ):
            times = []
            for number in range(-THREAD_WARM_UP, THREAD_FRAMES):
                renderer.camera = orbit(camera, radius, number / ORBIT_FRAMES)
                renderer.graph.device.wait()  # the frame before: its threads must not take this one's core
                started = time.thread_time()
                renderer.step(show=SHOW, preview=True)
                times.append((time.thread_time() - started) * 1e3)
            found.append(MainThread(variant.title, median(times[THREAD_WARM_UP:]), len(renderer.graph.last_run)))
    return found
