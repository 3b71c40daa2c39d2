"""Virtual point lights against closed forms: their flux adds up to the flux that surfaces reflect."""

from __future__ import annotations

import math

import numpy as np
import pytest
import wgpu
from helpers.skies import gradient_sky

from wgpu_gi.camera import Camera
from wgpu_gi.gpu.capabilities import GPU
from wgpu_gi.gpu.device import open_device
from wgpu_gi.gpu.graph import Graph
from wgpu_gi.renderer import Renderer, Settings
from wgpu_gi.scene.built_in.scenes import cornell_point, matte
from wgpu_gi.scene.built_in.shapes import box, quad
from wgpu_gi.scene.scene import DirectionalLight, Environment, Instance, PointLight, Scene, SpotLight


def resampled(scene, bounces, **fields):
    """Return positions (n, 3) relative to the scene's origin, flux (n, 3) in W and areas (n,) of the lights."""
    settings = Settings(gi="many-light", bounces=bounces, diffuse=True)
    # Resampled by flux alone, VPLs keep the sum of the flux exactly.
    for name, value in {"count": 1024, "importance": "flux", **fields}.items():
        setattr(settings.vpl, name, value)
    settings.camera.jitter = False
    camera = scene.cameras[0] if scene.cameras else Camera.look_at((0.5, 0.4, 0.3), (0, 0.1, 0))
    renderer = Renderer(scene, size=(16, 16), camera=camera, settings=settings)
    renderer.run(show=("indirect",), check=True)
    table = renderer.graph.read_back("vpl/table").reshape(-1, 2, 4)[: settings.vpl.count].copy()
    values = table.view(np.float32).astype(np.float64)
    # The sign of the area marks the last bounce.
    return values[:, 0, :3], values[:, 1, :3], np.abs(values[:, 1, 3])


def closed_box(albedo=0.5, lights=(), emission=0.0):
    walls = box((-1, -1, -1), (1, 1, 1), matte(albedo, emission=emission, double_sided=True))
    return Scene([Instance(walls)], list(lights))


def test_point_light_in_a_closed_box_keeps_its_flux():
    """All of 4 pi I W is reflected once, times the albedo of each channel."""
    scene = closed_box((0.2, 0.5, 0.8), [PointLight((0.3, -0.2, 0.1), 3.0, (1.0, 0.5, 0.25))])
    _, flux, area = resampled(scene, 1)
    expected = 4 * math.pi * 3.0 * np.array([1.0, 0.5, 0.25]) * (0.2, 0.5, 0.8)
    assert np.allclose(flux.sum(0), expected, rtol=2e-3)
    # Their areas cover the walls; where several VPLs are close by chance, a little less.
    assert 0.85 * 24 < area.sum() < 1.03 * 24


@pytest.mark.slow
def test_bounces_in_a_closed_box_sum_their_flux():
    """rho + rho^2 + ... of the light."""
    scene = closed_box(0.5, [PointLight((0.3, -0.2, 0.1), 3.0)])
    for bounces, expected in ((1, 0.5), (2, 0.75), (3, 0.875), (None, 1.0)):
        _, flux, _ = resampled(scene, bounces, paths=16384)
        assert flux.sum(0) == pytest.approx([4 * math.pi * 3.0 * expected] * 3, rel=0.02)


def test_the_last_candidate_of_a_path_stands_for_all_further_bounces():
    """In a box of albedo 0.9, bounces after the twelfth hold 28 % of the light."""
    scene = closed_box(0.9, [PointLight((0.3, -0.2, 0.1), 3.0)])
    _, flux, _ = resampled(scene, None, paths=16384)
    assert flux.sum(0) == pytest.approx([4 * math.pi * 3.0 * 9] * 3, rel=0.03)


def test_a_gpu_traces_more_paths_of_the_same_light(monkeypatch):
    """The threads of a GPU trace at least `least_walks` paths, however few are asked for; their flux is the same."""
    scene = closed_box(0.5, [PointLight((0.3, -0.2, 0.1), 3.0)])
    device = open_device(large_buffers=True)
    monkeypatch.setattr(device, "capabilities", GPU)
    _, flux, _ = resampled(scene, 3, paths=64)
    assert flux.sum(0) == pytest.approx([4 * math.pi * 3.0 * 0.875] * 3, rel=0.02)


@pytest.mark.parametrize("blocks", [1, 255, 257, 5000])
def test_blocks_are_summed_in_order(blocks):
    """Cumulative sums match those of numpy within rounding, never fall, and repeat bit by bit."""
    device = open_device(large_buffers=True)
    weights = np.random.default_rng(blocks).random(blocks).astype(np.float32) ** 8
    weights[::3] = 0.0
    shared = device.gpu.create_buffer_with_data(data=weights, usage=wgpu.BufferUsage.STORAGE)
    graph = Graph(device)
    graph.begin()
    totals = graph.buffer("totals", count=blocks)
    reads = {"block_sums": graph.share("block_sums", shared)}
    graph.compute("sum", "many_light/vpl/prefix_sum.wgsl", over=1, reads=reads, writes={"totals": totals})
    graph.compile([totals])
    runs = []
    for _ in range(2):
        graph.run(force=True)
        runs.append(graph.read_back(totals).ravel().copy())
    graph.release()
    assert np.array_equal(runs[0], runs[1])
    assert runs[0] == pytest.approx(np.cumsum(weights.astype(np.float64)), rel=1e-5)
    assert (np.diff(runs[0]) >= 0).all()


@pytest.mark.parametrize("lamps, bounces, most", [(1, 3, 1.6), (40, 1, 2.6), (40, 3, 2.8)])
def test_lights_share_the_area_of_the_walls(lamps, bounces, most):
    """Many lamps and bounces light the same walls: VPL areas add up to at most 2.8 times that of the walls."""
    scene = closed_box(0.5, [PointLight((0.3, -0.2, 0.1), 3.0 / lamps) for _ in range(lamps)])
    _, _, area = resampled(scene, bounces)
    assert 0.85 * 24 < area.sum() < most * 24


def test_spot_and_sun_keep_their_flux():
    """A spot's whole cone falls on the floor; a sun's flux is lux times area times cosine."""
    floor = Instance(quad((-2, 0, -2), (0, 0, 4), (4, 0, 0), matte(0.6)))
    half = 0.4
    spot = SpotLight((0, 1, 0), (0, -1, 0), half, half + 1e-4, 5.0)
    _, flux, _ = resampled(Scene([floor], [spot]), 1)
    assert flux.sum(0) == pytest.approx([0.6 * 5.0 * 2 * math.pi * (1 - math.cos(half))] * 3, rel=0.01)
    sun = DirectionalLight((0.6, -0.8, 0.0), 10.0)
    _, flux, _ = resampled(Scene([floor], [sun]), 1)
    assert flux.sum(0) == pytest.approx([0.6 * 10.0 * 0.8 * 16] * 3, rel=0.01)


def test_emitter_keeps_its_flux():
    """An emissive closed box: pi L A W from all walls, reflected once."""
    _, flux, _ = resampled(closed_box(0.5, emission=2.0), 1, paths=16384)
    # Double-sided: half of the light leaves outwards.
    assert flux.sum(0) == pytest.approx([0.5 * math.pi * 2.0 * 24] * 3, rel=0.02)


@pytest.mark.parametrize("pictured", [False, True])
def test_environment_keeps_its_flux(pictured):
    """A floor below and above a sky: irradiance pi L for a constant one, integrated over both sides for a picture."""
    floor = Instance(quad((-2, 0, -2), (0, 0, 4), (4, 0, 0), matte(0.6)))
    sky = Environment((1.0, 2.0, 3.0), gradient_sky(16, 5.0) if pictured else None)
    position, flux, _ = resampled(Scene([floor], environment=sky), 1, paths=16384)
    assert len(np.unique(position, axis=0)) > 500
    if not pictured:
        assert np.allclose(flux.sum(0), 2 * 0.6 * math.pi * 16 * np.array([1.0, 2.0, 3.0]), rtol=0.01)
        return
    image = np.asarray(sky.image, np.float64)
    theta = (np.arange(image.shape[0]) + 0.5) / image.shape[0] * math.pi
    weight = np.abs(np.cos(theta)) * np.sin(theta) * (math.pi / image.shape[0]) * (2 * math.pi / image.shape[1])
    irradiance = (image * weight[:, None, None]).sum((0, 1)) * (1.0, 2.0, 3.0)
    assert np.allclose(flux.sum(0), 0.6 * 16 * irradiance, rtol=0.03)


@pytest.mark.parametrize("importance", ["flux", "view", "grid"])
def test_importance_keeps_the_flux(importance):
    """Importance changes how flux is divided: more lights where the view is, each with less flux."""
    scene = closed_box(0.5, [PointLight((0.3, -0.2, 0.1), 3.0)])
    _, flux, _ = resampled(scene, 1, importance=importance)
    assert flux.sum(0) == pytest.approx([0.5 * 4 * math.pi * 3.0] * 3, rel=0.03)
    spread = flux[:, 0].std() / flux[:, 0].mean()
    # Texels of a point light's map have equal solid angles, so a grid of them has equal fluxes.
    assert spread < 1e-3 if importance != "view" else spread > 0.05


def test_every_nth_light_is_a_stratified_sample():
    scene = closed_box(0.5, [PointLight((0.3, -0.2, 0.1), 3.0)])
    position, flux, _ = resampled(scene, 1)
    mean = (flux[:, :1] * position).sum(0) / flux[:, 0].sum()
    for first in range(16):
        part = slice(first, None, 16)
        assert flux[part].sum() == pytest.approx(flux.sum() / 16, rel=1e-3)
        assert np.abs((flux[part, :1] * position[part]).sum(0) / flux[part, 0].sum() - mean).max() < 0.1


def test_black_surfaces_make_black_lights():
    _, flux, _ = resampled(closed_box(0.0, [PointLight((0, 0, 0), 3.0)]), None)
    assert not flux.any()


@pytest.mark.parametrize("bounces, most", [(1, 0.12), (3, 0.2)])
@pytest.mark.parametrize("importance", ["flux", "view"])
def test_lights_are_temporally_coherent(importance, bounces, most):
    """If the lamp moves by 0.2 % of the room's diagonal in a still view, few VPLs move further than 5 % of it."""
    scene = cornell_point()
    length = float(np.linalg.norm(np.diff(scene.bounds(), axis=0)))
    before = resampled(scene, bounces, importance=importance)[0]
    scene.lights[0].position = np.asarray(scene.lights[0].position) + 0.002 * length * np.array((0.6, 0.0, 0.8))
    after = resampled(scene, bounces, importance=importance)[0]
    way = np.linalg.norm(after - before, axis=-1) / length
    assert (way > 0.05).mean() <= most
    assert np.median(way) <= 0.01
