"""Measures an adapter within a budget of time: first whether it computes rightly, then how fast."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable
from typing import Any

from ...camera import Camera
from ...gpu.device import Device, list_adapters, open_device
from ...scene.scene import Scene
from ..bench import machine
from .budget import Budget
from .builds import measure_build
from .checks import run_checks
from .passes import measure_scene, measure_threads
from .rays import measure_rays
from .results import AdapterReport
from .scenes import cornell, pebble
from .source_tests import checkout, run_tests
from .timestamps import check_timestamps
from .truth_errors import measure_errors

CPU_CLOCK = "processor time: of the main thread, and of all others over the cores"
RESERVE = 0.05  # of the time, for the step that is running when the rest is over
Progress = Callable[[float, str], None]


def measure_adapter(
    seconds: float,
    adapter: str | None = None,
    sponza: tuple[Scene, Camera] | None = None,
    progress: Progress | None = None,
) -> AdapterReport:
    """Measure what fits into `seconds`; `left_out` of the report says what did not.

    `sponza`: Crytek's Sponza, which the package does not ship. Raises GiError without an adapter.
    """
    budget = Budget((1 - RESERVE) * seconds, progress)
    budget.show("adapter")
    device = open_device(adapter, large_buffers=True)
    report = _described(device, adapter)
    flags = device.compute_timestamps, device.render_timestamps
    try:
        _measure(report, device, budget, adapter, sponza)
    finally:
        device.compute_timestamps, device.render_timestamps = flags
    if sponza is None:
        budget.left_out.append("Sponza: the package does not ship it; --sponza PATH names its file")
    report.left_out, report.memory, report.seconds = budget.left_out, peak_memory(), budget.spent
    return report


def _described(device: Device, adapter: str | None) -> AdapterReport:
    """Return a report that describes the adapter."""
    known = next((a for a in list_adapters() if a.name == device.adapter_name and a.backend == device.backend), None)
    return AdapterReport(
        machine(adapter) | {"clock": CPU_CLOCK if device.is_cpu else "of the wall"},
        list(known.features) if known else sorted(device.features),
        {name: int(value) for name, value in (known.limits if known else device.limits).items()},
        list(known.needs_newer_driver) if known else [],
    )


def _measure(
    report: AdapterReport,
    device: Device,
    budget: Budget,
    adapter: str | None,
    sponza: tuple[Scene, Camera] | None,
) -> None:
    """Fill the report in the order of importance."""
    # Is it right?
    report.checks = run_checks(budget, adapter=adapter)
    report.errors = measure_errors(budget, adapter)
    if budget.allows("timestamps"):
        with budget.noting("timestamps"):
            report.timestamps = check_timestamps(device, adapter)

    # How fast is it? Rays and hierarchies, then whole frames.
    scenes: list[tuple[str, Callable[[], tuple[Scene, Camera]]]] = [("pebble", pebble)]
    if sponza is not None:
        scenes.append(("Sponza", lambda: sponza))
    for name, make in scenes:
        what = f"rays and hierarchy of {name}"
        if budget.allows(what):
            with budget.noting(what):
                _add_rays(report, name, *make(), device, adapter)
    room, camera = cornell()
    report.threads = measure_threads(room, camera, budget, adapter)
    report.scenes = [measure_scene("Cornell", room, camera, budget, adapter)]
    if sponza is not None:
        report.scenes.append(measure_scene("Sponza", *sponza, budget, adapter))

    # The tests of a checkout know only the adapter that is chosen by default.
    folder = checkout()
    if folder is not None and adapter is None and budget.allows("shader tests of the checkout"):
        report.tests = run_tests(folder, budget.left)


def _add_rays(
    report: AdapterReport,
    name: str,
    scene: Scene,
    camera: Camera,
    device: Device,
    adapter: str | None,
) -> None:
    """Add the times of a scene's upload, and the rates of its rays."""
    with device.use():
        build, upload = measure_build(name, scene, device)
        report.builds.append(build)
        try:
            report.rays += measure_rays(name, scene, camera, device, upload, adapter)
        finally:
            upload.release()


def peak_memory() -> int | None:
    """Return the largest resident set of this process, in bytes; None where the system does not tell."""
    try:
        resource: Any = importlib.import_module("resource")
    except ImportError:
        return None
    peak = int(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
    return peak if sys.platform == "darwin" else 1024 * peak
