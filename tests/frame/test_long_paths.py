"""Pictures do not depend on how the path tracer divides its work, however many steps its paths take."""

from dataclasses import replace

import numpy as np
import pytest

import wgpu_gi as gi
from wgpu_gi.gpu.capabilities import GPU
from wgpu_gi.gpu.device import open_device
from wgpu_gi.options import Settings
from wgpu_gi.renderer import Renderer
from wgpu_gi.scene.built_in.shapes import sphere
from wgpu_gi.techniques.reference import PathSettings


def bright_cave() -> gi.Scene:
    """A lamp in a bright sphere of many triangles, so that paths are long and rays visit many nodes."""
    white = gi.Material(base_color=(0.95, 0.95, 0.95, 1.0), double_sided=True)
    places = ((4.0, (0, 0, 0)), (1.0, (1.5, 0, -1)), (1.0, (-1.5, 0, -1)))
    shapes = [sphere(centre, radius, 4, white) for radius, centre in places]
    return gi.Scene(
        [gi.Instance(shape) for shape in shapes],
        [gi.PointLight((0.0, 2.0, 0.0), 10.0)],
        cameras=[gi.Camera.look_at((0, 0, 3), (0, 0, 0))],
    )


@pytest.mark.parametrize("samples_per_run", [1, 64])
def test_every_sample_is_taken_once(samples_per_run):
    scene = bright_cave()
    renderers = [
        Renderer(
            scene,
            size=(16, 9),
            settings=Settings(gi="path", spp=64, diffuse=True, path=PathSettings(samples_per_run=k)),
        )
        for k in (8, samples_per_run)
    ]
    for renderer in renderers:
        renderer.run(show=("radiance",))
    expected, got = (renderer.read_back() for renderer in renderers)
    assert got == pytest.approx(expected, rel=1e-4)


def test_the_way_of_a_gpu_gives_the_same_picture(monkeypatch):
    """Two chunks in flight, of few workgroups each, and another budget of steps."""
    settings = Settings(gi="path", spp=24, path=PathSettings(samples_per_run=12))
    pictures = []
    device = open_device(large_buffers=True)  # a renderer's
    for capabilities in (device.capabilities, replace(GPU, path_steps=500, chunk_seconds=(1e-6, 2e-6, 3e-6))):
        monkeypatch.setattr(device, "capabilities", capabilities)
        with Renderer(bright_cave(), size=(40, 20), settings=settings) as renderer:
            renderer.run(show=("radiance",))
            pictures.append(renderer.read_back())
    assert pictures[1] == pytest.approx(pictures[0], rel=1e-4)


def test_forced_frames_repeat_their_work():
    renderer = Renderer(bright_cave(), size=(16, 9), settings=Settings(gi="path", spp=32))
    renderer.run(show=("radiance",))
    before = renderer.read_back()
    assert not renderer.step(show=("radiance",))
    assert renderer.step(show=("radiance",), force=True)
    renderer.run(show=("radiance",))
    assert np.array_equal(renderer.read_back(), before)
