"""Optical flow and occlusion against closed forms: planes seen by a moving camera, and objects that move and bend."""

from __future__ import annotations

from copy import copy

import numpy as np
import pytest
from helpers.animated import SLIDE, WIDTH, animated_scene

from wgpu_gi.camera import Camera
from wgpu_gi.dataset.labels import frame_data
from wgpu_gi.errors import GiError
from wgpu_gi.renderer import Renderer, Settings
from wgpu_gi.scene.built_in.shapes import quad
from wgpu_gi.scene.scene import Instance, Mesh, MorphTarget, Scene, Skin

SIZE = (48, 32)
FOCAL = 16.0  # pixels: a length at the distance 1


def card(centre, width, height, name):
    """Return a rectangle that faces +Z."""
    x, y, z = centre
    corner = (x - width / 2, y - height / 2, z)
    return Instance(quad(corner, (width, 0, 0), (0, height, 0)), name=name)


def moved(x=0.0, y=0.0, z=0.0, turn=0.0):
    """Return a matrix that turns about Z, then translates."""
    matrix = np.eye(4)
    matrix[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
    matrix[:3, 3] = x, y, z
    return matrix


def camera_at(matrix, **fields):
    """Return a camera whose picture's half height is the distance."""
    return Camera(**{"world_from_view": matrix, "yfov": np.pi / 2} | fields)


FRONT = camera_at(np.eye(4))


def labelled(first, second, camera=FRONT, camera_then=None, wanted=("flow", "occlusion", "instance", "depth_z")):
    """Return the labels of `first`, a list of instances, with `second` as the second time."""
    with Renderer(Scene(first), size=SIZE, camera=camera, settings=Settings(gi="none")) as renderer:
        return frame_data(renderer, wanted, second=(Scene(second), camera_then or camera))


def centres():
    """Return the pixel centres, (h, w, 2), in pixels from the top left corner."""
    return np.stack(np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5), -1)


def inside(places):
    """Return where places lie in the picture."""
    return ((places >= 0) & (places < SIZE)).all(-1)


def on_plane(places, z):
    """Return the x and y of the points of the plane z < 0 at places of the picture of FRONT."""
    return (places - (24, 16)) * (1, -1) * -z / FOCAL


def test_camera_beside_itself():
    """A camera that moves by 0.5 m shifts points at the distance d by 0.5 * 16 / d pixels; the card hides more wall."""
    parts = [card((0, 0, -4), 40, 40, "wall"), card((0.23, 0.11, -2), 1, 0.5, "card")]
    found = labelled(parts, parts, camera_then=camera_at(moved(x=0.5)))
    expected = np.where(found.instance == 2, -4.0, -2.0)
    np.testing.assert_allclose(found.flow[..., 0], expected, atol=1e-5)
    np.testing.assert_allclose(found.flow[..., 1], 0, atol=1e-5)
    # The wall is hidden where the way from the second camera to it meets the card, half way.
    x, y = np.moveaxis((on_plane(centres(), -4) + np.array([0.5, 0])) / 2, -1, 0)
    behind = (np.abs(x - 0.23) < 0.5) & (np.abs(y - 0.11) < 0.25) & (found.instance == 1)
    assert behind.sum() == 8
    np.testing.assert_array_equal(found.occlusion, behind | ~inside(centres() + found.flow))


def test_object_that_moves_and_turns():
    first = [card((0, 0, -4), 40, 40, "wall"), card((0, 0, 0), 1, 0.6, "card")]
    second = [first[0], copy(first[1])]
    first[1].world_from_local, second[1].world_from_local = moved(0.1, 0.05, -2, 0.3), moved(0.4, -0.1, -1.5, 0.9)
    found = labelled(first, second)
    seen = found.instance == 2
    assert seen.sum() > 20
    points = np.dstack([on_plane(centres(), -2), np.full(SIZE[::-1], -2.0), np.ones(SIZE[::-1])])[seen]
    points = points @ (moved(0.4, -0.1, -1.5, 0.9) @ np.linalg.inv(moved(0.1, 0.05, -2, 0.3))).T
    places = points[:, :2] / 1.5 * FOCAL * (1, -1) + (24, 16)
    np.testing.assert_allclose(found.flow[seen], places - centres()[seen], atol=1e-4)
    np.testing.assert_allclose(found.flow[~seen], 0, atol=1e-9)
    assert not found.occlusion[seen].any()
    # The wall is hidden where the card stands at the second time.
    local = np.dstack([on_plane(centres(), -1.5), np.full(SIZE[::-1], -1.5), np.ones(SIZE[::-1])])
    x, y, *_ = np.moveaxis(local @ np.linalg.inv(moved(0.4, -0.1, -1.5, 0.9)).T, -1, 0)
    np.testing.assert_array_equal(found.occlusion, ~seen & (np.abs(x) < 0.5) & (np.abs(y) < 0.3))


@pytest.mark.parametrize("kind", ["skin", "morph", "positions"])
def test_object_whose_vertices_move(kind):
    """Joints, weights of a morph target, or new positions move all vertices alike, as a translation does."""
    first = card((0, 0, -2), 1.5, 1, "card")
    base, shift = first.mesh, np.array([0.3, -0.2, 0.4])
    shifted = np.tile(np.float32(shift), (4, 1))
    if kind == "skin":
        skin = Skin(np.zeros((4, 1), np.uint16), np.ones((4, 1), np.float32))
        first.mesh = Mesh(base.positions, base.triangles, base.materials, skin=skin)
        first.joint_matrices = np.eye(4)[None]
        second = copy(first)
        second.joint_matrices = moved(*shift)[None]
    elif kind == "morph":
        first.mesh = Mesh(base.positions, base.triangles, base.materials, morph_targets=[MorphTarget(shifted * 2)])
        first.morph_weights = (0.0,)
        second = copy(first)
        second.morph_weights = (0.5,)
    else:
        second = copy(first)
        second.mesh = Mesh(base.positions + shifted, base.triangles, base.materials)
    found = labelled([first], [second])
    seen = found.instance == 1
    points = on_plane(centres(), -2)[seen] + shift[:2]
    places = points / 1.6 * FOCAL * (1, -1) + (24, 16)
    np.testing.assert_allclose(found.flow[seen], places - centres()[seen], atol=1e-4)
    np.testing.assert_array_equal(found.occlusion[seen], ~inside(places))


def test_sky_turns_with_the_camera():
    angle = 0.2
    turn = np.eye(4)
    turn[:3, :3] = [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
    turn[:3, 3] = 5, 6, -7  # the sky has no parallax; the card is behind the second camera
    parts = [card((0, 0, -2), 1, 1, "card")]
    found = labelled(parts, parts, camera_then=camera_at(turn))
    sky = found.instance == 0
    ways = np.dstack([on_plane(centres(), -1), np.full(SIZE[::-1], -1.0)]) @ turn[:3, :3]
    places = ways[..., :2] / -ways[..., 2:] * FOCAL * (1, -1) + (24, 16)
    np.testing.assert_allclose(found.flow[sky], (places - centres())[sky], atol=1e-4)
    np.testing.assert_array_equal(found.occlusion[sky], ~inside(places)[sky])


def test_points_behind_the_second_camera():
    parts = [card((0, 0, -2), 2, 2, "card")]
    found = labelled(parts, parts, camera_then=camera_at(moved(z=-3)))
    seen = found.instance == 1
    assert not found.flow[seen].any() and found.occlusion[seen].all()
    assert not found.occlusion[~seen].any()


def test_parallel_rays():
    """Without perspective, a metre covers 16 pixels at all depths."""
    parts = [card((0, 0, -4), 40, 40, "wall"), card((0.23, 0.11, -2), 1, 0.5, "card")]
    views = [camera_at(moved(x=x), orthographic_height=2.0) for x in (0.0, 0.25)]
    found = labelled(parts, parts, *views)
    np.testing.assert_allclose(found.flow, np.broadcast_to((-4.0, 0.0), found.flow.shape), atol=1e-5)
    np.testing.assert_array_equal(found.occlusion, ~inside(centres() + found.flow))


def test_animation_between_two_times():
    """The wall slides by 0.8 m a second; a picture of 50 degrees shows a metre at 4 m as 32 / (8 tan 25) pixels."""
    scene = animated_scene()
    with Renderer(scene, size=SIZE, camera=scene.cameras[0], settings=Settings(gi="none")) as renderer:
        renderer.time = 0.25
        found = frame_data(renderer, {"flow", "instance", "occlusion"}, second=(scene.at(0.5), scene.cameras[0]))
    wall = found.instance == 2
    assert wall.sum() > 20
    across = WIDTH / SLIDE * 0.25 * SIZE[1] / (8 * np.tan(np.radians(25)))
    np.testing.assert_allclose(found.flow[wall], np.broadcast_to((across, 0), found.flow[wall].shape), atol=1e-4)
    np.testing.assert_allclose(found.flow[~wall], 0, atol=1e-6)
    assert not found.occlusion[wall].any() and found.occlusion.any()


def test_far_from_the_origin():
    """At 100 km, float32 coordinates are 8 mm coarse, those of the flow are not."""
    parts = [card((0, 0, -4), 40, 40, "wall"), card((0, 0, 0), 1, 0.5, "card")]
    second = [copy(part) for part in parts]
    for one, two in zip(parts, second, strict=True):
        one.world_from_local, two.world_from_local = moved(x=1e5), moved(x=1e5)
    parts[1].world_from_local, second[1].world_from_local = moved(x=1e5, z=-2), moved(x=1e5 + 0.25, z=-2)
    found = labelled(parts, second, camera_at(moved(x=1e5)))
    np.testing.assert_allclose(found.flow[..., 0], np.where(found.instance == 2, 2.0, 0.0), atol=1e-3)


@pytest.mark.parametrize(
    "rays",
    [
        ([[0, 0, 0]], [[0, 0, 0]], [1]),
        ([[0, 0, 0]], [[0, 0, 1]], [0]),
        ([[0, 0, np.nan]], [[0, 0, 1]], [1]),
        ([[0, 0]], [[0, 1]], [1]),
        ([[0, 0, 0]], [[0, 0, 1]], [[1]]),
        ("a", "b", "c"),
    ],
)
def test_rays_that_are_none(rays):
    with Renderer(Scene([card((0, 0, -2), 1, 1, "card")]), size=SIZE) as renderer, pytest.raises(GiError, match="rays"):
        renderer.reaches(*rays)


def test_rays_reach_their_limits():
    with Renderer(Scene([card((0, 0, -2), 1, 1, "card")]), size=SIZE) as renderer:
        starts, ways = np.zeros((4, 3)), np.array([[0, 0, -1], [0, 0, -0.5], [0, 0, -1], [0, 1, 0]])
        assert renderer.reaches(starts, ways, [1.9, 4.1, np.inf, np.inf]).tolist() == [True, False, False, True]


def test_labels_do_not_depend_on_frames_before():
    parts = [card((0, 0, -4), 40, 40, "wall"), card((0.23, 0.11, -2), 1, 0.5, "card")]
    second = [parts[0], copy(parts[1])]
    second[1].world_from_local = moved(x=0.3)
    wanted = {"depth_ray", "normal", "instance", "flow", "occlusion", "amodal"}
    with Renderer(Scene(parts), size=SIZE, camera=FRONT, settings=Settings(gi="none")) as renderer:
        alone = frame_data(renderer, wanted, second=(Scene(second), FRONT))
        renderer.release()
        renderer.scene = Scene([card((0, 0, -3), 1, 1, "other"), *second])
        frame_data(renderer, wanted, second=(Scene([card((1, 0, -3), 1, 1, "other"), *parts]), FRONT))
        renderer.release()
        renderer.scene = Scene(parts)
        again = frame_data(renderer, wanted, second=(Scene(second), FRONT))
    for name, array in alone.arrays().items():
        np.testing.assert_array_equal(getattr(again, name), array)
    assert again.objects == alone.objects


def test_nothing_moves_and_nothing_is_hidden():
    rng = np.random.default_rng(3)
    parts = [card(rng.uniform((-1, -1, -6), (1, 1, -1)), *rng.uniform(0.3, 2, 2), f"{k}") for k in range(8)]
    found = labelled(parts, parts, wanted=("flow", "occlusion"))
    np.testing.assert_allclose(found.flow, 0, atol=1e-9)
    assert not found.occlusion.any()
    assert found.instance is None


@pytest.mark.parametrize(
    ("second", "words"),
    [
        (None, "need a second time"),
        (Scene(), r"pair \(scene, camera\)"),
        ((Scene(), FRONT), "has 0 instances, that of the first 1"),
        ((Scene([Instance(quad((0, 0, -9), (1, 0, 0), (0, 1, 0)))]), FRONT), None),
        ((Scene([Instance(Mesh(np.zeros((3, 3), np.float32), np.array([[0, 1, 2]])))]), FRONT), "other triangles"),
    ],
)
def test_second_times_that_do_not_fit(second, words):
    with Renderer(Scene([card((0, 0, -2), 1, 1, "card")]), size=SIZE, settings=Settings(gi="none")) as renderer:
        if words is None:
            assert frame_data(renderer, {"flow"}, second=second).flow is not None
        else:
            with pytest.raises(GiError, match=words):
                frame_data(renderer, {"flow"}, second=second)
