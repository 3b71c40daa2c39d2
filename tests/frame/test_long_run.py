"""Memory and time over many frames, scene loads and resizes; `tools/long_run.py` runs for longer."""

from __future__ import annotations

import argparse
import gc

import long_run
import numpy as np
import pytest
import wgpu
from helpers.memory import resident

import wgpu_gi as gi
from wgpu_gi.options import TECHNIQUES

KILOBYTE = 1024.0


def settings(technique):
    return long_run.settings_of(argparse.Namespace(gi=[technique], quality=None))


def test_slope_of_a_noisy_line_lies_within_its_interval():
    """In 95 of 100 cases; 90 is two standard deviations less. Steps, as memory has, count as noise."""
    random, inside = np.random.default_rng(0), 0
    x = np.arange(240.0)
    for _ in range(100):
        fit, half = long_run.slope(x, 3.0 * x + random.normal(0, 50, len(x)))
        inside += abs(fit - 3.0) <= half
    assert inside >= 90
    fit, half = long_run.slope(x, 4096.0 * (x > 100))
    assert fit - half > 0 and long_run.slope(x, np.full(240, 7.0)) == (0.0, 0.0)


@pytest.fixture
def few_samples(monkeypatch):
    """A sample takes as long as a frame."""
    monkeypatch.setattr(long_run, "SAMPLES", 40)


@pytest.mark.usefixtures("few_samples")
def test_growth_per_frame_is_below_a_kilobyte():
    resident()  # skips where memory cannot be read
    part = long_run.frames(settings("none"), 160)
    for name in ("rss", "gpu_bytes"):
        growth, half = part.growth(name)
        assert growth - half < KILOBYTE, f"{name}: {growth:.0f} +- {half:.0f} bytes per frame"
    # Objects come and go within a period of the motion, but none is left over.
    assert abs(part.growth("gpu_objects")[0]) < 0.02 and abs(part.growth("python_blocks")[0]) < 5


@pytest.mark.usefixtures("few_samples")
@pytest.mark.parametrize("kind", [long_run.loads, long_run.resizes])
def test_loads_and_resizes_leave_no_object_behind(kind):
    part = kind(settings("none"), 40)
    for name, most in (("gpu_bytes", 1e4), ("gpu_objects", 0.5), ("python_blocks", 50.0)):
        growth, half = part.growth(name)
        assert abs(growth) - half < most, f"{name}: {growth:.3g} +- {half:.2g} each"


def test_old_gpu_objects_do_not_wait_for_the_cycle_collector():
    """Neither those of an earlier size or scene, nor those of a renderer that is dropped."""

    def objects():
        return wgpu.diagnostics.object_counts.get_dict()["total"]["count"]

    def render(size, scene="cornell"):
        renderer.size, renderer.scene = size, gi.load(scene)
        long_run.show(renderer)

    renderer = gi.Renderer(gi.load("cornell"), settings=settings("ssao"))
    for _ in range(2):
        render((32, 18), "cornell-point")
        render((40, 30))
    gc.collect()
    gc.disable()
    try:
        before = objects()
        for _ in range(3):
            render((32, 18), "cornell-point")
            render((40, 30))
        assert objects() <= before
        for _ in range(2):
            other = gi.Renderer(renderer.scene, size=(32, 18), settings=settings("ssao"))
            long_run.show(other)
            del other
        assert objects() <= before
    finally:
        gc.enable()


@pytest.mark.hour
@pytest.mark.timeout(900)
@pytest.mark.parametrize("technique", TECHNIQUES)
@pytest.mark.parametrize(("kind", "count"), [("frames", 3000), ("loads", 300), ("resizes", 1000)])
def test_long_runs_stay_flat(technique, kind, count):
    resident()
    part = getattr(long_run, kind)(settings(technique), count)
    line, flat = long_run.told(technique, part)
    assert flat, line
