"""Camera matrices of data sets: all of them lead points to the pixels where the renderer's own projection puts them."""

from __future__ import annotations

import numpy as np
import pytest

from wgpu_gi import Camera
from wgpu_gi.dataset.matrices import NEAR, ORTHOGRAPHIC_FAR, matrices

SIZE = (64, 48)
PERSPECTIVE = Camera.look_at((3, 2, 5), (0.5, 0, -1), (0.2, 1, 0), yfov_deg=55)
ORTHOGRAPHIC = Camera(PERSPECTIVE.world_from_view, orthographic_height=4.0)
POINTS = np.random.default_rng(0).uniform(-2, 2, (100, 3))


def homogeneous(points):
    return np.column_stack([points, np.ones(len(points))])


def pixels_of_renderer(camera):
    clip = homogeneous(POINTS) @ camera.clip_from_world(SIZE, np.zeros(3), NEAR, 100.0).T
    return (clip[:, :2] / clip[:, 3:] * [0.5, -0.5] + 0.5) * SIZE


def test_opencv_matrices_lead_to_the_pixels_of_the_renderer():
    known = matrices(PERSPECTIVE, SIZE)
    camera = homogeneous(POINTS) @ known["opencv_camera_from_world"].T
    assert (camera[:, 2] > 0).all()  # in front
    image = camera[:, :3] @ known["opencv_pixel_from_camera"].T
    assert np.allclose(image[:, :2] / image[:, 2:], pixels_of_renderer(PERSPECTIVE), atol=1e-9)


@pytest.mark.parametrize("camera", [PERSPECTIVE, ORTHOGRAPHIC])
def test_opengl_matrices_lead_to_the_pixels_of_the_renderer(camera):
    known = matrices(camera, SIZE)
    clip = homogeneous(POINTS) @ (known["opengl_clip_from_view"] @ known["opengl_view_from_world"]).T
    pixels = (clip[:, :2] / clip[:, 3:] * [0.5, -0.5] + 0.5) * SIZE
    assert np.allclose(pixels, pixels_of_renderer(camera), atol=1e-9)
    assert (np.abs(clip[:, 2] / clip[:, 3]) < 1).all()


@pytest.mark.parametrize("camera", [PERSPECTIVE, ORTHOGRAPHIC])
def test_inverses_and_axes(camera):
    known = matrices(camera, SIZE)
    assert np.allclose(known["opencv_camera_from_world"] @ known["opencv_world_from_camera"], np.eye(4))
    assert np.allclose(known["opengl_view_from_world"] @ known["opengl_world_from_view"], np.eye(4))
    assert np.array_equal(known["opencv_world_from_camera"][:3, 3], camera.position)
    assert np.allclose(known["opencv_world_from_camera"][:3, 2], -camera.world_from_view[:3, 2])  # looks along +Z
    assert np.linalg.det(known["opencv_camera_from_world"][:3, :3]) == pytest.approx(1)
    assert ("opencv_pixel_from_camera" in known) == (camera.orthographic_height is None)


def test_depth_of_opengl_is_minus_1_at_the_near_plane_and_1_at_the_far_one():
    near = matrices(PERSPECTIVE, SIZE)["opengl_clip_from_view"] @ [0, 0, -NEAR, 1]
    far = matrices(PERSPECTIVE, SIZE)["opengl_clip_from_view"] @ [0, 0, -1, 0]
    assert near[2] / near[3] == pytest.approx(-1) and far[2] / far[3] == pytest.approx(1)
    clip = matrices(ORTHOGRAPHIC, SIZE)["opengl_clip_from_view"]
    assert (clip @ [0, 0, -NEAR, 1])[2] == pytest.approx(-1)
    assert (clip @ [0, 0, -ORTHOGRAPHIC_FAR, 1])[2] == pytest.approx(1)
