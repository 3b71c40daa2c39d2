"""Reports on adapters that were not measured."""

from __future__ import annotations

from wgpu_gi.measure.adapter.results import (
    AdapterReport,
    Build,
    CheckResult,
    MainThread,
    PassTimes,
    RayRate,
    SceneTimes,
    TestRun,
    Timestamps,
    TruthError,
)


def made_report(adapter="A <fast> GPU", factor=1.0, passed=True):
    """Return a report with an entry of every kind; times are proportional to `factor`."""
    machine = {
        "adapter": adapter,
        "backend": "Vulkan",
        "driver": "driver 1",
        "is_cpu": False,
        "os": "Linux",
        "cores": 8,
        "clock": "of the wall",
        "packages": {"wgpu_gi": "0.2.0"},
    }
    passes = {"gbuffer": 1.0 * factor, "gather": 2.0 * factor}
    times = PassTimes("many-light", 3.0 * factor, 3.5 * factor, passes, 2**20, 100)
    return AdapterReport(
        machine,
        ["timestamp-query"],
        {"max-texture-dimension-2d": 16384},
        ["a fault"],
        [Timestamps("compute", 0.98, True), Timestamps("raster", None, False)],
        [CheckResult("light", "sun, none", "a floor", passed, 0.001 if passed else 0.5, 0.003)],
        TestRun(10, 1, 2, ["tests/shader/test_a.py::test_b"], False),
        [RayRate("pebble", 81_920, "shadow", 2e9 / factor, 0.5)],
        [Build("pebble", 81_920, 700.0 * factor, 600.0 * factor, 1.0 * factor, 2**23)],
        [SceneTimes("Cornell", (1920, 1080), [times])],
        [TruthError("Cornell, spot", "many-light", 0.003, -0.01, 0.0006, -0.001, 24)],
        [MainThread("many-light", 2.0 * factor, 25)],
        2**30,
        ["path in Cornell: the time was over"],
        61.0,
    )
