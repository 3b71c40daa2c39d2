"""Rays of cameras: a pixel's ray goes through its centre, depth is the distance along it, rows go down."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers.pictures import shoot

from wgpu_gi.camera import Camera
from wgpu_gi.scene.built_in.scenes import matte
from wgpu_gi.scene.built_in.shapes import box, quad
from wgpu_gi.scene.scene import Instance, PointLight, Scene

BUFFERS = ("position", "depth", "normal")


def camera_rays(camera, size):
    """Origins and unit directions of the pixel centres, (h, w, 3)."""
    width, height = size
    x = ((np.arange(width) + 0.5) / width * 2 - 1) * width / height
    y = 1 - (np.arange(height) + 0.5) / height * 2
    x, y = np.meshgrid(x, y)
    m = camera.world_from_view
    if camera.orthographic_height is not None:
        half = camera.orthographic_height / 2
        origins = m[:3, 3] + half * (x[..., None] * m[:3, 0] + y[..., None] * m[:3, 1])
        return origins, np.broadcast_to(-m[:3, 2], origins.shape)
    half = math.tan(camera.yfov / 2)
    directions = half * (x[..., None] * m[:3, 0] + y[..., None] * m[:3, 1]) - m[:3, 2]
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    return np.broadcast_to(m[:3, 3], directions.shape), directions


CAMERAS = {
    "perspective": Camera.look_at((1.0, 2.0, 3.0), (0.0, 0.2, -4.0), yfov_deg=75.0),
    "rolled": Camera.look_at((1.0, 2.0, 3.0), (0.0, 0.2, -4.0), up=(1.0, 0.5, 0.2), yfov_deg=20.0),
    "straight down": Camera.look_at((0.0, 3.0, 0.0), (0.0, 0.0, 0.0), yfov_deg=60.0),
    "orthographic": Camera(Camera.look_at((1.0, 2.0, 3.0), (0.0, 0.2, -4.0)).world_from_view, orthographic_height=3.0),
}


@pytest.mark.parametrize("name", CAMERAS)
@pytest.mark.parametrize("size", [(16, 9), (5, 11), (1, 1)])
def test_pixels_see_the_plane_where_their_ray_meets_it(name, size):
    camera = CAMERAS[name]
    ground = quad((-500, -1, 500), (1000, 0, 0), (0, 0, -1000))
    got = shoot(Scene([Instance(ground)]), size, camera=camera, spp=1, show=BUFFERS)
    origins, directions = camera_rays(camera, size)
    distance = (-1 - origins[..., 1]) / directions[..., 1]
    expected = origins + distance[..., None] * directions
    seen = (distance > 0) & (np.abs(expected[..., [0, 2]]).max(-1) < 490)
    assert np.array_equal(got["depth"][seen] > 0, np.ones(seen.sum(), bool)) and seen.any()
    assert np.allclose(got["depth"][seen], distance[seen], rtol=1e-4)
    # Positions are interpolated between corners 500 m away: float32 has steps of 3e-5 m there.
    assert (np.linalg.norm(got["position"] - expected, axis=-1)[seen] < 1e-5 * distance[seen] + 3e-4).all()
    assert np.allclose(got["normal"][seen], (0, 1, 0), atol=1e-6)
    assert not got["depth"][distance <= 0].any() and not got["position"][distance <= 0].any()


def test_row_zero_is_on_top_and_column_zero_on_the_left():
    walls = [
        quad((-2, 1, -5), (1, 0, 0), (0, 1, 0), matte((1, 0, 0))),
        quad((1, 1, -5), (1, 0, 0), (0, 1, 0), matte((0, 1, 0))),
        quad((-2, -2, -5), (1, 0, 0), (0, 1, 0), matte((0, 0, 1))),
    ]
    camera = Camera(orthographic_height=4.0)
    got = shoot(Scene([Instance(m) for m in walls]), (4, 4), camera=camera, spp=1, show=("albedo",))["albedo"]
    assert got[0, 0].tolist() == [1, 0, 0] and got[0, 3].tolist() == [0, 1, 0] and got[3, 0].tolist() == [0, 0, 1]
    assert not got[3, 3].any() and not got[1:3].any()


def test_normals_face_the_viewer():
    """Outside a body and inside it, where its own normals point away."""
    room = Instance(box((-1, -1, -1), (1, 1, 1)))
    for camera in (Camera.look_at((0.1, 0.2, 0.3), (1, 0.5, 0)), Camera.look_at((3, 4, 5), (0, 0, 0))):
        got = shoot(Scene([room]), (9, 9), camera=camera, spp=1, show=BUFFERS)
        _, directions = camera_rays(camera, (9, 9))
        seen = got["depth"] > 0
        assert ((got["normal"] * directions).sum(-1)[seen] < 0).all() and seen.any()


def test_jitter_is_a_box_filter():
    """An edge through the middle of a pixel covers half of it; centres see one side only."""
    half = quad((0, -1, 0), (1, 0, 0), (0, 2, 0), matte(0.0, emission=1.0))
    camera = Camera(Camera.look_at((0, 0, 1), (0, 0, 0)).world_from_view, orthographic_height=2.0)
    averaged, centred = (
        shoot(Scene([Instance(half)]), (3, 3), camera=camera, spp=256, jitter=jitter)["radiance"][..., 0]
        for jitter in (True, False)
    )
    assert np.allclose(averaged, [[0, 0.5, 1]] * 3, atol=0.01)
    assert np.array_equal(centred[:, [0, 2]], [[0, 1]] * 3) and set(centred[:, 1]) <= {0.0, 1.0}


def test_near_and_far_objects_are_not_clipped():
    near, far = (Instance(quad((-d, -d, -d), (2 * d, 0, 0), (0, 2 * d, 0))) for d in (1e-3, 100.0))
    for instances, distance in (([near, far], 1e-3), ([far], 100.0)):
        got = shoot(Scene(instances), (3, 3), camera=Camera(), spp=1, show=("depth",))["depth"]
        assert got[1, 1] == pytest.approx(distance, rel=0.01)


def test_inside_of_a_solid_is_visible_and_dark():
    scene = Scene([Instance(box((-1, -1, -1), (1, 1, 1)))], [PointLight((0, 5, 0), 1000.0)])
    got = shoot(scene, (8, 8), camera=Camera(), spp=4, show=("radiance", "depth"))
    assert not got["radiance"].any() and (got["depth"] > 0).all()
