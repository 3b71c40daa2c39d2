"""Labels of frames against closed forms: a plane, a sphere, and boxes before one another."""

from __future__ import annotations

import numpy as np
import pytest

from wgpu_gi.camera import Camera
from wgpu_gi.dataset.labels import frame_data
from wgpu_gi.errors import GiError
from wgpu_gi.renderer import Renderer, Settings
from wgpu_gi.scene.built_in.shapes import quad
from wgpu_gi.scene.scene import Instance, Material, PointLight, Scene

SIZE = (48, 32)
WALL, CARD = (0.25, 0.5, 0.75), (0.9, 0.1, 0.2)


def card(centre, width, height, name, color=CARD):
    """Return a rectangle that faces +Z."""
    x, y, z = centre
    corner = (x - width / 2, y - height / 2, z)
    return Instance(quad(corner, (width, 0, 0), (0, height, 0), Material(name, (*color, 1.0))), name=name)


def wall_and_card():
    """Return a scene of a wall at z = -4 and a card of 1 by 0.5 at z = -2, lit from the camera."""
    parts = [card((0, 0, -4), 40, 40, "wall", WALL), card((0.25, 0.125, -2), 1, 0.5, "card")]
    return Scene(parts, [PointLight((0, 0, 0), 10.0)])


def labelled(scene, wanted, camera=None, **values):
    """Return the labels of a frame of SIZE; yfov 90 degrees: half the picture's height is the distance."""
    camera = camera or Camera(yfov=np.pi / 2)
    with Renderer(scene, size=SIZE, camera=camera, settings=Settings(gi="path", spp=2, bounces=1)) as renderer:
        return frame_data(renderer, wanted, **values)


def centres():
    """Return the pixel centres on the plane z = -1, (h, w, 2)."""
    width, height = SIZE
    x = (np.arange(width) + 0.5) * 2 / height - width / height
    y = 1 - (np.arange(height) + 0.5) * 2 / height
    return np.stack(np.meshgrid(x, y), -1)


@pytest.fixture(scope="module")
def wall():
    """The labels of a wall with a card in front."""
    return labelled(
        wall_and_card(),
        {"depth_ray", "depth_z", "normal", "albedo", "instance", "category", "objects"},
        category_of=[0, 7],
        categories={7: "cards"},
    )


def on_card():
    """Return where a pixel centre shows the card."""
    x, y = np.moveaxis(centres() * 2, -1, 0)
    return (np.abs(x - 0.25) < 0.5) & (np.abs(y - 0.125) < 0.25)


def test_depth_of_planes(wall):
    depth = np.where(on_card(), 2.0, 4.0)
    np.testing.assert_allclose(wall.depth_z, depth, rtol=1e-6)
    np.testing.assert_allclose(wall.depth_ray, depth * np.sqrt(1 + (centres() ** 2).sum(2)), rtol=1e-6)


def test_normal_and_albedo_of_planes(wall):
    np.testing.assert_allclose(wall.normal, np.broadcast_to([0, 0, 1], wall.normal.shape), atol=1e-4)
    np.testing.assert_allclose(wall.albedo, np.where(on_card()[..., None], CARD, WALL), rtol=1e-5)


def test_ids_and_visible_boxes(wall):
    np.testing.assert_array_equal(wall.instance, np.where(on_card(), 2, 1))
    np.testing.assert_array_equal(wall.category, np.where(on_card(), 7, 0))
    assert [(o.id, o.name, o.category) for o in wall.objects] == [(1, "wall", 0), (2, "card", 7)]
    assert wall.objects[0].box == (0, 0, *SIZE)
    # The card spans x from -0.25 to 0.75 and y from -0.125 to 0.375 at z = -2, so pixels 22 to 30 and 13 to 17.
    assert wall.objects[1].box == (22, 13, 8, 4)
    assert wall.objects[1].visible_pixels == 32


def test_sky_has_the_id_0():
    sky = labelled(Scene([card((0, 0, -1), 1, 1, "card")]), {"instance", "depth_ray", "depth_z", "category"})
    seen = (np.abs(centres()) < 0.5).all(2)
    np.testing.assert_array_equal(sky.instance, seen)
    assert not sky.depth_ray[~seen].any() and not sky.depth_z[~seen].any() and not sky.category.any()


def test_orthographic_depths_are_the_same_along_both():
    camera = Camera(orthographic_height=2.0)
    found = labelled(wall_and_card(), {"depth_ray", "depth_z"}, camera)
    x, y = np.moveaxis(centres(), -1, 0)
    depth = np.where((np.abs(x - 0.25) < 0.5) & (np.abs(y - 0.125) < 0.25), 2.0, 4.0)
    np.testing.assert_allclose(found.depth_z, depth, rtol=1e-6)
    np.testing.assert_allclose(found.depth_ray, depth, rtol=1e-6)


def test_matrices_project_points_to_the_pixels_that_show_them():
    camera = Camera.look_at((1, 2, 3), (0, 0.5, -3), yfov_deg=50)
    found = labelled(wall_and_card(), {"depth_ray", "depth_z", "instance"}, camera)
    # Take the point that each pixel shows back to its centre.
    rows, columns = np.nonzero(found.instance == 1)
    depth = found.depth_z[rows, columns].astype(np.float64)
    pixels = np.stack([columns + 0.5, rows + 0.5, np.ones(len(rows))])
    seen = np.linalg.inv(found.cameras["opencv_pixel_from_camera"]) @ pixels * depth
    world = found.cameras["opencv_world_from_camera"] @ np.vstack([seen, np.ones(len(rows))])
    np.testing.assert_allclose(world[2], -4, atol=1e-5)
    np.testing.assert_allclose(np.linalg.norm(seen, axis=0), found.depth_ray[rows, columns], rtol=1e-6)


def test_direct_and_indirect_light_add_up_to_the_picture():
    found = labelled(wall_and_card(), {"picture", "direct", "indirect", "standard_error"})
    assert found.picture.max() > 0.1
    np.testing.assert_allclose(found.direct + found.indirect, found.picture, rtol=1e-5, atol=1e-6)
    assert found.standard_error.shape == found.picture.shape
    assert found.depth_ray is None and found.instance is None and not found.objects


def test_sphere():
    import trimesh

    from wgpu_gi.scene.load import load

    ball = trimesh.creation.icosphere(subdivisions=5, radius=1.0)
    ball.apply_translation((0, 0, -3))
    found = labelled(load(ball), {"depth_ray", "normal", "instance"})
    # Intersect the rays with the sphere: distance b - sqrt(b^2 - c).
    rays = np.dstack([centres(), -np.ones(SIZE[::-1])])
    rays /= np.linalg.norm(rays, axis=2, keepdims=True)
    b = rays @ (0, 0, -3.0)
    inside = b * b - 8
    certain = np.abs(inside) > 0.02
    np.testing.assert_array_equal(found.instance[certain], (inside > 0)[certain])
    seen = inside > 0.1
    distance = b[seen] - np.sqrt(inside[seen])
    np.testing.assert_allclose(found.depth_ray[seen], distance, atol=2e-3)
    normal = rays[seen] * distance[:, None] - (0, 0, -3)
    np.testing.assert_allclose(found.normal[seen], normal, atol=0.05)


@pytest.mark.parametrize(
    ("wanted", "values", "words"),
    [
        ({"deph_ray"}, {}, "did you mean 'depth_ray'"),
        ("depth_ray", {}, "collection of names"),
        ({"category"}, {"category_of": [1]}, "1 ids for 2 instances"),
        ({"category"}, {"category_of": [0, 3], "categories": {2: "b"}}, "categories lacks"),
        ({"category"}, {"category_of": [0, 0], "categories": {0: "b"}}, "from 1 on"),
    ],
)
def test_wrong_requests_are_refused(wanted, values, words):
    with pytest.raises(GiError, match=words):
        labelled(wall_and_card(), wanted, **values)
