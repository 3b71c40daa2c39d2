"""Measuring, with a stand-in for the renderer whose frames take known times."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

import wgpu_gi as gi
from wgpu_gi.errors import GiError
from wgpu_gi.measure import bench
from wgpu_gi.measure.bench import Candidate, layer_errors, measure_case, measure_scene, orbit, stats, truth_bounces
from wgpu_gi.measure.results import CASES, Stats
from wgpu_gi.measure.truth import LAYERS, Truth
from wgpu_gi.options import Settings

SIZE = (4, 2)
FRAMES = 10


class FakeTiming:
    def __init__(self):
        self.samples = {}

    def clear(self):
        self.samples.clear()


class FakeRenderer:
    """A technique with a pass `shade` (2 ms for each frame so far) and one `maps` (10 ms) that runs only if forced."""

    values = (2.0, 1.0, 1.0)  # of radiance, direct, indirect
    alive = 0

    def __init__(self, scene, *, size, camera, settings=None, adapter=None):
        FakeRenderer.alive += 1
        self.scene, self.size, self.camera, self.settings = scene, size, camera, settings
        resources = {"a": SimpleNamespace(bytes=np.int64(100), gpu=[1]), "culled": SimpleNamespace(bytes=7, gpu=[])}
        device = SimpleNamespace(wait=lambda: None)
        order = [SimpleNamespace(name="maps"), SimpleNamespace(name="shade")]
        self.graph = SimpleNamespace(timing=FakeTiming(), device=device, resources=resources, order=order, last_run={})
        self.seen = None
        self.frames = []  # (moved, forced, timed)

    def run(self, progress=None, *, show=(), timings=False):
        self.seen = self.camera
        if timings:
            self.graph.timing.samples["path/trace"] = [1.0] * self.settings.spp

    def step(self, *, show, force, timings, preview):
        moved, self.seen = self.seen is not self.camera, self.camera
        assert not moved or preview  # frames of a moving camera may be previews
        self.frames.append((moved, force, timings))
        ran = {"shade": 2.0 * len(self.frames)} if moved or force else {}
        ran |= {"maps": 10.0} if force else {}
        self.graph.last_run = ran
        if timings:
            self.graph.timing.samples |= {name: [ms] for name, ms in ran.items()}
        return bool(ran)

    def read_back(self, name):
        value = dict(zip(LAYERS.values(), self.values, strict=True))[name]
        if self.settings.gi == "path":
            value *= 1 + 1 / self.settings.spp
        return np.full((SIZE[1], SIZE[0], 3), value, np.float32)

    def release(self):
        FakeRenderer.alive -= 1


@pytest.fixture(autouse=True)
def stand_in(monkeypatch):
    monkeypatch.setattr(bench, "Renderer", FakeRenderer)
    monkeypatch.setattr(bench, "has_denoiser", lambda: False)
    monkeypatch.setattr(FakeRenderer, "values", FakeRenderer.values)
    monkeypatch.setattr(FakeRenderer, "alive", 0)


@pytest.fixture
def renderer():
    scene = gi.load("cornell")
    return FakeRenderer(scene, size=SIZE, camera=scene.cameras[0], settings=Settings(gi="none"))


def truth(full=2.0, direct=1.0, indirect=1.0, noise=0.0):
    shape = (SIZE[1], SIZE[0], 3)
    layers = {"full": full, "direct": direct, "indirect": indirect}
    arrays = {name: np.full(shape, value, np.float32) for name, value in layers.items()}
    return Truth("a file", arrays, {n: np.full(shape, noise, np.float32) for n in layers}, np.ones(shape[:2], bool))


def test_statistics():
    assert stats([3.0, 1.0, 2.0]) == Stats(2.0, pytest.approx(2.9))
    assert stats([7.0]) == Stats(7.0, 7.0)


def test_still_frames_run_nothing(renderer):
    at_rest = renderer.camera
    case = measure_case(renderer, "still", FRAMES, lambda fraction: None)
    assert (case.passes_run, case.gpu_ms, case.passes) == (0, Stats(0.0, 0.0), {})
    assert case.wall_ms.median >= 0
    assert renderer.camera is at_rest
    assert not any(moved or forced for moved, forced, _ in renderer.frames)


def test_moving_camera_runs_passes_that_depend_on_it(renderer):
    at_rest = renderer.camera
    case = measure_case(renderer, "camera", FRAMES, lambda fraction: None)
    assert (case.passes_run, list(case.passes)) == (1, ["shade"])
    assert renderer.camera is at_rest
    assert all(moved and not forced for moved, forced, _ in renderer.frames)


def test_all_moving_forces_every_pass_and_skips_the_warm_up(renderer):
    fractions = []
    case = measure_case(renderer, "all", FRAMES, fractions.append)
    assert case.passes_run == 2
    assert all(moved and forced for moved, forced, _ in renderer.frames)
    # Every second frame measures the passes.
    total = 2 * (bench.WARM_UP_FRAMES + FRAMES)
    assert [timed for _, _, timed in renderer.frames] == [False, True] * (total // 2)
    counted = [2.0 * number for number in range(2 * bench.WARM_UP_FRAMES + 2, total + 1, 2)]
    assert list(case.passes.items()) == [("maps", Stats(10.0, 10.0)), ("shade", stats(counted))]
    assert case.gpu_ms.median == pytest.approx(stats(counted).median + 10.0)
    assert fractions[-1] == 1.0
    assert fractions == sorted(fractions)


def test_orbit_is_small_and_closed():
    camera = gi.Camera.look_at((1, 2, 3), (0, 0, 0))
    places = [orbit(camera, 0.1, k / 8) for k in range(9)]
    for place in places:
        offset = place.position - camera.position
        assert np.linalg.norm(offset) == pytest.approx(0.1)
        assert offset @ camera.world_from_view[:3, 2] == pytest.approx(0.0, abs=1e-12)  # across the view
        assert np.array_equal(place.world_from_view[:3, :3], camera.world_from_view[:3, :3])
    assert all(np.linalg.norm(a.position - b.position) > 0.05 for a, b in pairwise(places))
    assert np.allclose(places[0].position, places[8].position)
    assert np.array_equal(camera.position, (1, 2, 3))


def test_bounces_of_the_truth():
    assert truth_bounces(Settings(gi="none")) is None
    assert truth_bounces(Settings(gi="path")) is None
    assert truth_bounces(Settings(gi="none", bounces=2)) == 2


def test_errors_are_of_surfaces_and_known_layers():
    t = truth(indirect=0.0, noise=0.1)
    del t.layers["direct"]
    t.surface[0] = False
    pictures = {name: np.full((SIZE[1], SIZE[0], 3), 3.0, np.float32) for name in LAYERS}
    pictures["full"][0] = 100.0
    errors = layer_errors(pictures, t)
    assert (errors["direct"], errors["indirect"]) == (None, None)
    floor = 0.01 / (4 + 0.04)
    assert errors["full"].relmse == pytest.approx(1 / 4.04 - floor)
    assert (errors["full"].bias, errors["full"].floor) == (pytest.approx(0.5), pytest.approx(floor))
    assert errors["full"].pixels == SIZE[0]


def measured(candidates, truth_of, **options):
    scene = gi.load("cornell")
    return measure_scene(scene, scene.cameras[0], SIZE, candidates, truth_of, frames=2, **options)


def test_scene_measures_each_candidate_and_the_path_tracer():
    candidates = [Candidate("none", quality, Settings(gi="none")) for quality in ("low", "high")]
    asked, seen = [], []

    def truth_of(bounces):
        asked.append(bounces)
        return truth(noise=0.001)

    techniques, references = measured(
        candidates, truth_of, path_seconds=0.01, progress=lambda what, done: seen.append(what)
    )
    assert [(m.gi, m.quality, m.bounces, m.bytes) for m in techniques] == [
        ("none", "low", None, 100),
        ("none", "high", None, 100),
    ]
    assert list(techniques[0].cases) == list(CASES)
    assert techniques[0].errors["full"].bias == pytest.approx(0.0)
    assert asked == [None]
    (reference,) = references
    assert reference.truth == "a file"
    assert reference.noise["full"] == pytest.approx(1e-6 / 4.04)
    # A picture of n samples takes n ms here; the end is when it takes 8 times as long as the slowest technique.
    slowest = max(m.cases["all"].gpu_ms.median for m in techniques)
    spp = [p.spp for p in reference.curve]
    assert spp == [2**k for k in range(len(spp))]
    assert spp[-2] < 8 * slowest <= spp[-1]
    assert reference.curve[0].errors["full"].bias == pytest.approx(1.0)
    assert (reference.curve[3].gpu_ms, reference.curve[3].errors["full"].bias) == (8.0, pytest.approx(0.125))
    assert {"none, low: still", "none, high: all moving"} <= set(seen)
    assert FakeRenderer.alive == 0


def test_path_tracer_stops_at_the_noise_of_the_truth():
    _, references = measured([Candidate("none", "low", Settings(gi="none"))], lambda _: truth(noise=1.0))
    assert [p.spp for p in references[0].curve] == [1, 2, 4]


def test_picture_that_cannot_be_measured_is_named(monkeypatch):
    monkeypatch.setattr(FakeRenderer, "values", (float("nan"), 1.0, 1.0))
    with pytest.raises(GiError, match=r"none, low: .*NaN"):
        measured([Candidate("none", "low", Settings(gi="none"))], lambda _: truth())
    assert FakeRenderer.alive == 0
