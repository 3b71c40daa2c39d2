"""Drawn cameras: in the ranges asked for, free, outside of bodies, not before a wall; closed forms of boxes decide."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

import wgpu_gi as gi
from wgpu_gi.dataset.cameras import RoomCameras, SphereCameras, cameras_from, draw_camera
from wgpu_gi.dataset.surroundings import Surroundings, _through_picture

ROOM = np.array([[0, 0, 0], [6, 3, 8.0]])
PILLAR = np.array([[2, 0, 3], [3, 3, 4.0]])
CRATE = np.array([[4, 0, 5], [5, 1.2, 6.0]])


def box(bounds, inwards=False):
    """Return an instance of a box whose faces look outwards, or inwards."""
    corners = np.array([[bounds[k >> a & 1][a] for a in range(3)] for k in range(8)], np.float32)
    quads = [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]
    triangles = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))], np.uint32)
    return gi.Instance(gi.Mesh(corners, triangles[:, ::-1] if inwards else triangles, [gi.Material()]))


@pytest.fixture(scope="module")
def room():
    return Surroundings.of(gi.Scene([box(ROOM, inwards=True), box(PILLAR)]))


def distance_to(bounds, point):
    return float(np.linalg.norm(np.maximum(np.maximum(bounds[0] - point, point - bounds[1]), 0)))


def depth(origin, directions, bodies):
    """Return the distance of the walls of the room and of `bodies` along rays from inside the room."""
    ends = (ROOM[:, None] - origin) / directions
    nearest = ends.max(0).min(-1)
    for body in bodies:
        ends = (body[:, None] - origin) / directions
        near, far = ends.min(0).max(-1), ends.max(0).min(-1)
        nearest = np.where((far >= near) & (near > 0), np.minimum(near, nearest), nearest)
    return nearest


def test_test_boxes_have_the_right_faces():
    mesh = box(ROOM).mesh
    corners = mesh.positions[mesh.triangles].astype(float)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("nc,nc->n", normals, corners.mean(1) - ROOM.mean(0)) > 0).all()


@pytest.mark.parametrize("boxes", [np.zeros((0, 2, 3)), CRATE[None]])
def test_cameras_in_a_room_are_free_and_see_it(room, boxes):
    surroundings = Surroundings(room.scene, room.sight, boxes)
    cube = room.sight.side
    cameras = RoomCameras(height=(0.5, 2.0), clearance=0.3, view=2.0, yfov_deg=(50, 70), elevation_deg=(-20, 10))
    random = np.random.default_rng(3)
    for _ in range(40):
        camera, drawn = draw_camera(cameras, surroundings, random, 1.5)
        p = camera.position
        assert (p > ROOM[0] + 0.3 - cube).all() and (p < ROOM[1] - 0.3 + cube).all()
        assert 0.5 - cube <= p[1] <= 2.0 + cube
        assert all(distance_to(body, p) > 0.3 - cube for body in (PILLAR, *boxes))
        assert np.median(depth(p, _through_picture(camera, 1.5), [PILLAR, *boxes])) > 2.0 - 2 * cube
        assert 50 <= drawn["yfov_deg"] <= 70 and drawn["position"] == p.tolist()
        forward = -camera.world_from_view[:3, 2]
        assert -20 - 1e-6 <= math.degrees(math.asin(forward[1])) <= 10 + 1e-6


def test_cameras_in_a_room_reach_all_of_it(room):
    random = np.random.default_rng(0)
    cameras = RoomCameras(height=(1.0, 2.0), clearance=0.2, view=0.5)
    places = np.array([draw_camera(cameras, room, random, 1.0)[0].position for _ in range(60)])
    assert {(x > 3, z > 4) for x, _, z in places} == {(a, b) for a in (False, True) for b in (False, True)}


def test_the_roof_of_a_room_is_no_floor_but_the_top_of_a_wall_in_the_open_is():
    """Where a column runs within a wall, the only space is above it."""
    room = Surroundings.of(gi.Scene([box(ROOM, inwards=True)]))
    ground, wall = np.array([[0, -1, 0], [6, 0, 8.0]]), np.array([[0, 0, 0], [6, 3, 0.01]])
    court = Surroundings.of(gi.Scene([box(ground), box(wall)]))
    cube = room.sight.side
    assert room.spaces(3, 0.001) == [] and np.allclose(room.spaces(3, 4), [(0, 3, False)], atol=cube)
    assert np.allclose(court.spaces(3, 0.001)[0].floor, 3, atol=cube)
    assert np.allclose(court.spaces(3, 4)[0].floor, 0, atol=cube) and court.spaces(3, 4)[0].is_open


def test_cameras_stay_below_the_ceiling_above_a_cabinet():
    cabinet = np.array([[0, 0, 0], [6, 1.5, 4.0]])
    surroundings = Surroundings.of(gi.Scene([box(ROOM, inwards=True), box(cabinet)]))
    random = np.random.default_rng(2)
    cameras = RoomCameras(height=(1.0, 2.5), clearance=0.05, view=0.1)
    heights = [draw_camera(cameras, surroundings, random, 1.5)[0].position[1] for _ in range(60)]
    assert 1.0 - surroundings.sight.side < min(heights) and max(heights) < 3.0


def test_directions_on_a_sphere_are_uniform_between_elevations():
    body = Surroundings.of(gi.Scene([box(np.array([[-1, -1, -1], [1, 1, 1.0]]))]))
    cameras = SphereCameras(distance=(4, 6), elevation_deg=(-30, 60), roll_deg=(10, 10))
    random, found = np.random.default_rng(1), []
    for _ in range(200):
        camera, drawn = draw_camera(cameras, body, random, 1.5)
        assert 4 <= np.linalg.norm(camera.position) <= 6 and drawn["tries"] == 1
        assert np.allclose(camera.world_from_view[:3, 2], camera.position / np.linalg.norm(camera.position))
        level = np.cross([0, 1, 0], camera.world_from_view[:3, 2])
        roll = camera.world_from_view[:3, 0] @ level / np.linalg.norm(level)
        assert roll == pytest.approx(math.cos(math.radians(10)))
        found.append(camera.position / np.linalg.norm(camera.position))
    heights = np.array(found)[:, 1]
    low, high = math.sin(math.radians(-30)), math.sin(math.radians(60))
    # Uniform in the sine of the elevation; 4 standard errors of the mean of a uniform distribution, and of a direction.
    assert heights.min() >= low and heights.max() <= high
    assert abs(heights.mean() - (low + high) / 2) < 4 * (high - low) / math.sqrt(12 * 200)
    assert np.abs(np.array(found)[:, [0, 2]].mean(0)).max() < 4 / math.sqrt(2 * 200)


def test_cameras_are_not_inside_a_body_or_behind_a_placed_box():
    body = Surroundings.of(gi.Scene([box(np.array([[-1, -1, -1], [1, 1, 1.0]]))]))
    with pytest.raises(gi.GiError, match=r"no camera was found: of 1000, 1000 were inside or behind something; change"):
        draw_camera(SphereCameras(distance=(0.3, 0.5), clearance=0.0), body, np.random.default_rng(0), 1.0)
    wall = np.array([[[-9, -9, 3.8], [9, 9, 4.0]]])
    blocked = Surroundings(body.scene, body.sight, wall)
    ahead = SphereCameras(distance=(4.5, 5.0), azimuth_deg=(0, 0), elevation_deg=(0, 0))
    assert draw_camera(ahead, body, np.random.default_rng(0), 1.0)[1]["tries"] == 1
    with pytest.raises(gi.GiError, match="had something before the target"):
        draw_camera(ahead, blocked, np.random.default_rng(0), 1.0)


def test_cameras_on_a_path_pass_its_keys(tmp_path, room):
    keys = [
        {"frame": 0, "position": [1, 1.5, 1], "target": [4, 1, 6]},
        {"frame": 10, "position": [5, 1.5, 1], "target": [1, 1, 6]},
    ]
    (tmp_path / "keys.json").write_text(json.dumps(keys))
    still = cameras_from({"kind": "path", "path": "keys.json"}, "camera", tmp_path)
    for share, x in ((0.0, 1), (0.5, 3), (1.0, 5)):
        camera, _ = draw_camera(still, room, np.random.default_rng(0), 1.0, share)
        assert np.allclose(camera.position, [x, 1.5, 1])
    moved = cameras_from({"kind": "path", "path": "keys.json", "shift": 0.2, "turn_deg": 5}, "camera", tmp_path)
    positions = [draw_camera(moved, room, np.random.default_rng(i), 1.0, 0.5)[0].position for i in range(9)]
    assert np.abs(np.array(positions) - [3, 1.5, 1]).max() <= 0.2 and np.std(positions, 0).min() > 0.02


def test_the_same_generator_draws_the_same_camera(room):
    a, b = (draw_camera(RoomCameras(), room, np.random.default_rng([7, 3]), 1.5) for _ in range(2))
    assert np.array_equal(a[0].world_from_view, b[0].world_from_view) and a[1] == b[1]


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"kind": "spere"}, "camera.kind: there is no 'spere'; did you mean 'sphere'?"),
        ({}, "camera.kind: there is no None; available: sphere, room, path"),
        (
            {"kind": "room", "hight": 1},
            "camera.hight: cameras of the kind room have no such field; did you mean 'height'?",
        ),
        ({"kind": "room", "height": [2, 1]}, "camera.height must be a number, or [least, most], not [2, 1]"),
        ({"kind": "room", "height": "tall"}, "camera.height must hold finite numbers, not 'tall'"),
        ({"kind": "room", "height": float("nan")}, "camera.height must hold finite numbers"),
        ({"kind": "room", "yfov_deg": 200}, "camera.yfov_deg must lie between"),
        ({"kind": "room", "view": -1}, "camera.view must be a number from 0, not -1"),
        ({"kind": "sphere", "target": [1, 2]}, "camera.target must be three numbers"),
        ({"kind": "path"}, "camera.path is missing"),
        ({"kind": "path", "path": 3}, "camera.path must be the name of a .json file of keys, not 3"),
        ({"kind": "path", "path": "none.json"}, "none.json"),
    ],
)
def test_wrong_fields_are_named(tmp_path, table, message):
    with pytest.raises(gi.GiError) as error:
        cameras_from(table, "camera", tmp_path)
    assert message in str(error.value)


def test_a_number_stands_for_a_range(tmp_path):
    assert cameras_from({"kind": "room", "height": 1.7}, "camera", tmp_path) == RoomCameras(height=(1.7, 1.7))
