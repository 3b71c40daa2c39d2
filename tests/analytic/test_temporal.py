"""Temporal accumulation: the mean where reprojection finds the surface; history rejection elsewhere."""

from __future__ import annotations

import numpy as np
import pytest
import wgpu
from helpers.vpls import Gatherer

from wgpu_gi.scene.built_in.scenes import plane_point
from wgpu_gi.techniques.many_light.clusters import Clusters
from wgpu_gi.techniques.many_light.denoise import declare_temporal
from wgpu_gi.techniques.many_light.gather import Gathered
from wgpu_gi.techniques.shared.gbuffer import declare_gbuffer
from wgpu_gi.techniques.shared.scene_inputs import share_raster
from wgpu_gi.techniques.shared.temporal import TemporalSettings

SIZE = (24, 16)


class Accumulator:
    """A floor whose irradiance and motion are given frame by frame."""

    def __init__(self, frames: int) -> None:
        self.bench = Gatherer(plane_point(), SIZE)
        self.frames = frames
        self.version = 0

    def __call__(self, light: np.ndarray, motion: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the mean (h, w, 3) and the rejected share (h, w)."""
        graph, gpu = self.bench.graph, self.bench.device.gpu
        self.version += 1
        usage = wgpu.BufferUsage.STORAGE | wgpu.BufferUsage.COPY_SRC
        buffers = [gpu.create_buffer_with_data(data=np.float32(a).ravel(), usage=usage) for a in (light, motion)]
        graph.begin(SIZE)
        scene = share_raster(graph, self.bench.upload)
        gbuffer = declare_gbuffer(graph, scene)[0]
        irradiance, moved = (graph.share(n, b, self.version) for n, b in zip(("light", "motion"), buffers, strict=True))
        gathered = Gathered(irradiance, None, irradiance, 1, Clusters({}, {}))
        found = declare_temporal(graph, TemporalSettings(self.frames), scene, gbuffer, moved, gathered)
        graph.compile([found.gathered.irradiance, found.rejected, gbuffer.distance])
        graph.run(check=True)
        self.distance = graph.read_back(gbuffer.distance)[..., 0]
        mean = graph.read_back(found.gathered.irradiance).reshape(SIZE[1], SIZE[0], 4)
        return mean[..., :3].astype(np.float64), graph.read_back(found.rejected).reshape(SIZE[1], SIZE[0])


def light_of(value, scale=1.0):
    rng = np.random.default_rng(value)
    light = np.ones((SIZE[1], SIZE[0], 4))
    light[..., :3] = rng.random((SIZE[1], SIZE[0], 3)) * scale
    return light


def still(distance):
    motion = np.zeros((SIZE[1], SIZE[0], 4))
    motion[..., 2], motion[..., 3] = distance, 1
    return motion


@pytest.mark.parametrize("scale", [1e-20, 1.0, 1e20])
def test_a_still_view_accumulates_the_mean_of_its_frames(scale):
    accumulate = Accumulator(16)
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
