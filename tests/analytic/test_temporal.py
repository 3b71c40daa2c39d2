"""Temporal accumulation: the mean where reprojection finds the surface; history rejection elsewhere."""

from __future__ import annotations

import numpy as np
import pytest
import wgpu
from helpers.vpls import Gatherer

from wgpu_gi.gpu.wgsl.load import load
from wgpu_gi.scene.built_in.scenes import plane_point
from wgpu_gi.techniques.shared.gbuffer import declare_gbuffer
from wgpu_gi.techniques.shared.scene_inputs import share_raster
from wgpu_gi.techniques.shared.temporal import TemporalSettings, declare_accumulate

SIZE = (24, 16)
ALONE = 99  # distance of neighbours, pixels: none is in the picture
SEQUENCE = load("scene/sequence.wgsl").struct_dtype("Sequence")


class Accumulator:
    """A floor whose irradiance and motion are given frame by frame."""

    def __init__(self, frames: int, step: int = ALONE) -> None:
        scene = plane_point()
        self.bench, self.camera = Gatherer(scene, SIZE), scene.cameras[0]
        self.frames, self.step = frames, step
        self.version = self.drawn = 0

    def __call__(self, light: np.ndarray, motion: np.ndarray, again: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """Return the mean (h, w, 3) and the rejected share (h, w); `again`: the light was drawn in the last frame."""
        graph, gpu = self.bench.graph, self.bench.device.gpu
        self.version += 1
        self.drawn += not again
        graph.uniform("sequence", np.array((self.drawn, 0, 0), SEQUENCE))
        graph.uniform("view_before", self.bench.upload.view(self.camera, SIZE, False))
        usage = wgpu.BufferUsage.STORAGE | wgpu.BufferUsage.COPY_SRC
        buffers = [gpu.create_buffer_with_data(data=np.float32(a).ravel(), usage=usage) for a in (light, motion)]
        graph.begin(SIZE)
        scene = share_raster(graph, self.bench.upload)
        gbuffer = declare_gbuffer(graph, scene)[0]
        irradiance, moved = (graph.share(n, b, self.version) for n, b in zip(("light", "motion"), buffers, strict=True))
        settings = TemporalSettings(self.frames)
        found = declare_accumulate(graph, settings, scene, gbuffer, moved, irradiance, step=self.step)
        graph.compile([found.averaged, found.rejected, gbuffer.distance])
        graph.run(check=True)
        self.distance = graph.read_back(gbuffer.distance)[..., 0]
        mean = graph.read_back(found.averaged).reshape(SIZE[1], SIZE[0], 4)
        return mean[..., :3].astype(np.float64), graph.read_back(found.rejected).reshape(SIZE[1], SIZE[0])


def light_of(value, scale=1.0):
    rng = np.random.default_rng(value)
    light = np.ones((SIZE[1], SIZE[0], 4))
    light[..., :3] = rng.random((SIZE[1], SIZE[0], 3)) * scale
    return light


def constant(value):
    light = np.ones((SIZE[1], SIZE[0], 4))
    light[..., :3] = value
    return light


def still(distance):
    motion = np.zeros((SIZE[1], SIZE[0], 4))
    motion[..., 2], motion[..., 3] = distance, 1
    return motion


@pytest.mark.parametrize("scale", [1e-20, 1.0, 1e20])
def test_a_still_view_accumulates_the_mean_of_its_frames(scale):
    accumulate = Accumulator(32)
    first, rejected = accumulate(light_of(0, scale), still(4.0))
    assert (rejected == 1).all() and np.allclose(first, light_of(0, scale)[..., :3], rtol=1e-6)
    for k in range(1, 5):
        mean, rejected = accumulate(light_of(k, scale), still(4.0))
        assert not rejected.any()
    expected = np.mean([light_of(k, scale)[..., :3] for k in range(5)], 0)
    assert np.allclose(mean, expected, rtol=1e-5, atol=2e-5 * scale)


def test_history_at_another_distance_is_rejected():
    accumulate = Accumulator(16)
    accumulate(light_of(0), still(4.0))
    mean, rejected = accumulate(light_of(1), still(4.5))
    assert (rejected == 1).all() and np.allclose(mean, light_of(1)[..., :3])


def test_history_follows_the_motion():
    """Two pixels right and half a pixel down: history is bilinear, and disoccluded pixels have none."""
    accumulate = Accumulator(16)
    accumulate(light_of(0), still(4.0))
    motion = still(4.0)
    motion[..., :2] = (2.0, 0.5)
    mean, rejected = accumulate(light_of(1), motion)
    before, now = light_of(0)[..., :3], light_of(1)[..., :3]
    shifted = (before[:-1, :-2] + before[1:, :-2]) / 2
    assert np.allclose(mean[1:, 2:], (shifted + now[1:, 2:]) / 2, atol=2e-5)
    assert (rejected[:, :2] == 1).all() and np.allclose(mean[:, :2], now[:, :2])
    assert not rejected[1:, 2:].any()


def test_light_that_is_drawn_again_counts_once():
    accumulate = Accumulator(32)
    accumulate(light_of(0), still(4.0))
    for again in (False, True, True):
        mean, _ = accumulate(light_of(1), still(4.0), again)
    assert np.allclose(mean, (light_of(0) + light_of(1))[..., :3] / 2, atol=2e-5)


@pytest.mark.parametrize("frames", [2, 8, 24])
def test_light_lags_by_no_more_than_the_frames(frames):
    """Without neighbours nothing is clipped: 0.1 of the old light is left after `frames` frames."""
    accumulate = Accumulator(frames)
    for _ in range(3 * frames):
        accumulate(constant(1.0), still(4.0))
    for _ in range(frames):
        mean, _ = accumulate(constant(2.0), still(4.0))
    assert np.allclose(mean, 1.9, atol=0.03) and mean.min() >= 1.9 - 1e-3


@pytest.mark.parametrize("after", [(3.0, 3.0, 3.0), (0.1, 0.1, 0.1), (0.2, 1.5, 0.9)])
def test_a_step_of_light_without_noise_is_followed_at_once(after):
    """Brighter, darker, of another colour: the mean of the neighbours says so."""
    accumulate = Accumulator(16, step=1)
    for _ in range(6):
        accumulate(constant(1.0), still(4.0))
    mean, _ = accumulate(constant(after), still(4.0))
    assert np.allclose(mean[4:-4, 4:-4], after, atol=0.05)


def test_rare_bright_samples_keep_their_energy():
    """One sample in twenty has all the light: neither the clip nor the fill changes the mean."""
    accumulate, random, given, means = Accumulator(8, step=1), np.random.default_rng(3), [], []
    for _ in range(80):
        light = constant(1.0)
        light[..., :3] *= 20.0 * (random.random((*light.shape[:2], 1)) < 0.05)
        mean, _ = accumulate(light, still(4.0))
        given.append(light[..., 0].mean())
        means.append(mean.mean())
    assert np.mean(means[8:]) == pytest.approx(np.mean(given[8:]), rel=0.03)


def test_a_new_surface_takes_the_mean_of_its_neighbours():
    """Two columns come into view: they have less of their own noise than a first frame has."""
    accumulate = Accumulator(16, step=3)
    for k in range(8):
        accumulate(light_of(k), still(4.0))
    motion = still(4.0)
    motion[..., 0] = 2.0
    mean, rejected = accumulate(light_of(8), motion)
    now = light_of(8)[..., :3]
    assert (rejected[:, :2] == 1).all()
    assert np.std(mean[:, :2]) < 0.5 * np.std(now[:, :2])
    assert np.mean(mean[:, :2]) == pytest.approx(0.5, abs=0.1)
