"""The buffer `instance`: which object of the scene a pixel shows."""

from __future__ import annotations

import numpy as np
import pytest

from wgpu_gi.camera import Camera
from wgpu_gi.options import TECHNIQUES
from wgpu_gi.pictures.display import display_layer
from wgpu_gi.rendering import render
from wgpu_gi.scene.built_in.scenes import BUILTIN_SCENES
from wgpu_gi.scene.scene import Instance, Mesh, PointLight, Scene

TRIANGLE = [[-0.4, -0.4, 0], [0.4, -0.4, 0], [0, 0.4, 0]]


def triangle():
    return Mesh(np.array(TRIANGLE, np.float32), np.array([[0, 1, 2]], np.uint32))


def at(mesh, x):
    world_from_local = np.eye(4)
    world_from_local[0, 3] = x
    return Instance(mesh, world_from_local)


@pytest.mark.parametrize("gi", TECHNIQUES)
def test_instance_numbers_follow_the_order_of_the_scene(gi):
    empty = Mesh(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32))
    twice = triangle()
    scene = Scene([at(triangle(), -1), Instance(empty), at(twice, 0), at(twice, 1)], [PointLight((0, 0, 3))])
    camera = Camera.look_at((0, 0, 3), (0, 0, 0))
    seen = render(scene, size=(96, 32), camera=camera, gi=gi, spp=1, show="instance")
    assert seen.shape == (32, 96)
    middle = seen[16]
    assert [int(v) for v, before in zip(middle, [0, *middle], strict=False) if v != before and v] == [1, 3, 4]
    assert (seen == 0).any()


def test_pixels_lie_in_the_box_of_their_instance():
    scene = BUILTIN_SCENES["cornell-point"]()
    number, position = (render(scene, size=(64, 36), gi="none", show=name) for name in ("instance", "position"))
    assert len(np.unique(number)) > 4
    for i in np.unique(number[number > 0]).astype(int):
        low, high = Scene([scene.instances[i - 1]]).bounds()
        points = np.asarray(position)[number == i]
        assert (points > low - 1e-3).all() and (points < high + 1e-3).all()


def test_each_instance_has_its_own_colour():
    shown = display_layer("instance", np.arange(40, dtype=np.float32)[None])[0]
    assert (shown[0] == 0).all()
    far = np.abs(shown[:, None] - shown[None]).max(-1) + np.eye(40)
    assert far.min() > 0.01
    assert shown.min() >= 0 and shown.max() <= 1
