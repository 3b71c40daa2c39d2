"""How the mouse moves a camera."""

from __future__ import annotations

import math

import numpy as np
import pytest

from wgpu_gi.camera import Camera
from wgpu_gi.scene.built_in.shapes import box
from wgpu_gi.scene.scene import Instance, Scene
from wgpu_gi.viewer import navigation

PIVOT = np.array([1.0, 2.0, 3.0])
CAMERA = Camera.look_at((1, 3, 8), PIVOT, yfov_deg=40)


def place_of(camera, point):
    """Where a point is on a square picture, from the middle, in shares of its height, right and down."""
    clip = camera.clip_from_world((100, 100), np.zeros(3), 0.1, 100.0) @ (*point, 1.0)
    return np.array([clip[0], -clip[1]]) / clip[3] / 2


def assert_rigid(camera):
    axes = camera.world_from_view[:3, :3]
    assert np.allclose(axes.T @ axes, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1)


def test_orbit_keeps_the_pivot_where_it_is():
    turned = navigation.orbit(CAMERA, PIVOT, 0.4, -0.2)
    assert np.allclose(place_of(turned, PIVOT), place_of(CAMERA, PIVOT))
    assert np.linalg.norm(turned.position - PIVOT) == pytest.approx(np.linalg.norm(CAMERA.position - PIVOT))
    assert not np.allclose(turned.position, CAMERA.position)
    assert_rigid(turned)


def test_orbit_turns_the_scene_with_the_drag():
    front = PIVOT + (CAMERA.position - PIVOT) / 4
    right, down = place_of(navigation.orbit(CAMERA, PIVOT, 0.1, 0.1), front) - place_of(CAMERA, front)
    assert right > 0
    assert down > 0


def test_turns_never_roll_nor_pass_the_poles():
    camera = CAMERA
    for _ in range(500):
        camera = navigation.orbit(camera, PIVOT, 0.13, 0.07)
    assert_rigid(camera)
    assert abs(camera.world_from_view[1, 0]) < 1e-9  # the camera's right stays level
    assert camera.world_from_view[1, 1] > 0
    assert camera.position[1] > PIVOT[1] + 5  # as far up as it goes


def test_camera_beyond_the_pole_can_only_turn_back():
    down = Camera.look_at((0, 5, 0), (0, 0, 0))
    assert np.allclose(navigation.look(down, 0.0, 0.3).world_from_view, down.world_from_view)
    assert navigation.look(down, 0.0, -0.3).world_from_view[1, 2] < 1 - 1e-3
    assert_rigid(navigation.look(down, 0.5, -0.3))


def test_look_turns_on_the_spot():
    turned = navigation.look(CAMERA, 0.1, 0.1)
    assert np.allclose(turned.position, CAMERA.position)
    right, down = place_of(turned, PIVOT) - place_of(CAMERA, PIVOT)
    assert right < 0
    assert down < 0


def test_pan_moves_the_pivot_with_the_drag():
    moved, pivot = navigation.pan(CAMERA, PIVOT, 0.2, -0.1)
    assert np.allclose(place_of(moved, pivot), place_of(CAMERA, PIVOT))
    assert np.allclose(place_of(moved, PIVOT) - place_of(CAMERA, PIVOT), (0.2, -0.1))


def test_pan_of_a_parallel_projection():
    camera = Camera.look_at((0, 0, 5), (0, 0, 0))
    camera.orthographic_height = 4.0
    moved, _ = navigation.pan(camera, (0, 0, 0), 0.25, 0.0)
    assert np.allclose(moved.position, (-1, 0, 5))


def test_zoom_goes_to_the_pivot_but_not_through_it():
    camera = navigation.zoom(CAMERA, PIVOT, 0.5, 10.0)
    assert np.linalg.norm(camera.position - PIVOT) == pytest.approx(np.linalg.norm(CAMERA.position - PIVOT) / 2)
    for _ in range(100):
        camera = navigation.zoom(camera, PIVOT, 0.5, 10.0)
    assert np.linalg.norm(camera.position - PIVOT) == pytest.approx(navigation.NEAREST * 10.0)
    flat = navigation.zoom(Camera(orthographic_height=3.0), PIVOT, 0.5, 10.0)
    assert flat.orthographic_height == 1.5


def test_fly_goes_along_the_view_and_up_in_the_world():
    forward = -CAMERA.world_from_view[:3, 2]
    assert np.allclose(navigation.fly(CAMERA, (0, 0, 2)).position, CAMERA.position + 2 * forward)
    assert np.allclose(navigation.fly(CAMERA, (0, 1.5, 0)).position, CAMERA.position + np.array((0, 1.5, 0)))
    assert navigation.fly(CAMERA, (1, 0, 0)).position[0] > CAMERA.position[0]


@pytest.mark.parametrize("aspect", [0.4, 1.0, 2.5])
@pytest.mark.parametrize("height", [None, 1.0])
def test_frame_all_sees_every_corner(aspect, height):
    scene = Scene([Instance(box((-1, 0, 2), (3, 1, 9)))])
    camera = Camera.look_at((5, 5, 5), (0, 0, 0), yfov_deg=50)
    camera.orthographic_height = height
    placed = navigation.frame_all(camera, scene, aspect)
    low, high = scene.bounds()
    corners = np.array([[(low, high)[k >> a & 1][a] for a in range(3)] for k in range(8)])
    size = (round(100 * aspect), 100)
    for corner in corners:
        clip = placed.clip_from_world(size, np.zeros(3), 0.1, 100.0) @ (*corner, 1.0)
        assert np.abs(clip[:2] / clip[3]).max() < 1.0 + 1e-9


@pytest.mark.parametrize("scene", [Scene([]), Scene([Instance(box((-1, 0, 2), (3, 1, 9)))])])
def test_pivot_is_before_the_camera(scene):
    for target in ((0, 0, 0), (9, 9, 9)):
        camera = Camera.look_at((5, 5, 5), target)
        pivot = navigation.pivot_of(camera, scene)
        ahead = (pivot - camera.position) @ -camera.world_from_view[:3, 2]
        assert math.isfinite(ahead)
        assert ahead > 0
