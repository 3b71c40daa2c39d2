"""Automatic views: things from outside, rooms from inside at eye height, open rooms through their open side."""

from __future__ import annotations

import math

import numpy as np
import pytest

from wgpu_gi.measure.scenes import make_scene
from wgpu_gi.scene.auto_camera import automatic_camera, inside_camera
from wgpu_gi.scene.built_in.scenes import builtin_scene
from wgpu_gi.scene.built_in.shapes import box, mesh, quad, sphere
from wgpu_gi.scene.scene import Instance, Scene


def placed(scene, angle=0.0, scale=1.0, shift=(0.0, 0.0, 0.0)):
    """The scene without cameras, turned about +Y by `angle` degrees, scaled and moved."""
    m = np.eye(4)
    c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    m[:3, :3] = scale * np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    m[:3, 3] = shift
    return Scene([Instance(i.mesh, m @ i.world_from_local) for i in scene.instances])


def terrain():
    n = 40
    z, x = np.mgrid[:n, :n]
    height = 6 * np.sin(x / 5) * np.cos(z / 6)
    k = np.arange(n * n).reshape(n, n)
    a, b, c, d = k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]
    triangles = np.stack([a, b, c, a, c, d], -1).reshape(-1, 3)
    return Scene([Instance(mesh(np.stack([5 * x, height, 5 * z], -1).reshape(-1, 3), triangles))])


def one(body):
    return Scene([Instance(body)])


def room(*things):
    return Scene([Instance(box((-3, 0, -2), (3, 2.5, 2), inward=True)), *map(Instance, things)])


def thick_room():
    """A room of slabs 20 cm thick, with a table."""
    slabs = [
        ((-3.2, -0.2, -2.2), (3.2, 0, 2.2)),
        ((-3.2, 2.5, -2.2), (3.2, 2.7, 2.2)),
        ((-3.2, 0, -2.2), (-3, 2.5, 2.2)),
        ((3, 0, -2.2), (3.2, 2.5, 2.2)),
        ((-3, 0, -2.2), (3, 2.5, -2)),
        ((-3, 0, 2), (3, 2.5, 2.2)),
        ((-0.5, 0, -0.4), (0.5, 0.8, 0.4)),
    ]
    return Scene([Instance(box(low, high)) for low, high in slabs])


OUTSIDE = {
    "ball": lambda: one(sphere()),
    "box": lambda: one(box((0, 0, 0), (2, 1, 1))),
    "mirrored ball": lambda: Scene([Instance(sphere(), np.diag([-1.0, 1, 1, 1]))]),
    "long box": lambda: one(box((0, 0, 0), (30, 1, 1))),
    "terrain": terrain,
    "floor": lambda: one(quad((0, 0, 0), (0, 0, 2), (2, 0, 0))),
    "street": lambda: make_scene("street", 0),
    "plants": lambda: make_scene("foliage", 0),
    "courtyard": lambda: builtin_scene("courtyard"),
}
INSIDE = {
    "box": lambda: room(box((-1, 0, -0.5), (0, 0.8, 0.5))),
    "empty box": room,
    "thick walls": thick_room,
    **{f"room {seed}": lambda seed=seed: make_scene("room", seed) for seed in (0, 1, 2, 10, 11)},
    **{f"{kind} 0": lambda kind=kind: make_scene(kind, 0) for kind in ("glossy", "textured", "many")},
    "corridor": lambda: builtin_scene("corridor"),
}
PLACES = {"as it is": {}, "turned": {"angle": 90}, "tiny": {"scale": 1e-4}, "far": {"shift": (1e6, -2e6, 3e5)}}


OUTSIDE_AT = [(name, "as it is") for name in OUTSIDE] + [("box", place) for place in PLACES] + [("street", "far")]
INSIDE_AT = [(name, "as it is") for name in INSIDE] + [
    ("thick walls", "turned"),
    ("room 1", "far"),
    ("corridor", "turned"),
]


@pytest.mark.parametrize(("name", "place"), OUTSIDE_AT)
def test_things_are_seen_from_outside(name, place):
    scene = placed(OUTSIDE[name](), **PLACES[place])
    camera = automatic_camera(scene)
    low, high = scene.bounds()
    assert camera.name == "framing"
    assert ((camera.position < low) | (camera.position > high)).any()
    corners = np.array([[(low, high)[k >> a & 1][a] for a in range(3)] for k in range(8)])
    view = (corners - camera.position) @ camera.world_from_view[:3, :3]
    assert (np.abs(view[:, :2]).max(1) < -view[:, 2] * math.tan(camera.yfov / 2)).all()
    assert -camera.world_from_view[1, 2] < 0  # from above


@pytest.mark.parametrize(("name", "place"), INSIDE_AT)
def test_rooms_are_seen_from_inside_at_eye_height(name, place):
    scene = placed(INSIDE[name](), **PLACES[place])
    camera = automatic_camera(scene)
    low, high = scene.bounds()
    assert camera.name == "inside"
    assert (camera.position > low).all() and (camera.position < high).all()
    assert 0.8 < camera.position[1] - low[1] < 4
    assert abs(camera.world_from_view[1, 2]) < 0.13  # about level
    # Along the longer side, or the diagonal.
    size = (high - low)[[0, 2]]
    along = np.abs(camera.world_from_view[[0, 2], 2])
    assert along[size.argmax()] > 0.5


def test_a_tiny_room_has_an_eye_height_of_its_size():
    camera = automatic_camera(placed(room(), scale=1e-3))
    assert camera.name == "inside" and camera.position[1] == pytest.approx(0.45 * 2.5e-3, rel=0.05)


@pytest.mark.parametrize("angle", [0, 37, 90, 180, 250])
def test_a_room_without_a_front_is_seen_through_it(angle):
    """The Cornell box is open towards -Z."""
    cornell = builtin_scene("cornell")
    camera = automatic_camera(placed(cornell, angle))
    a = math.radians(angle)
    inwards = np.array([math.sin(a), 0, math.cos(a)]) * np.sign(cornell.cameras[0].world_from_view[2, 2]) * -1
    assert camera.name == "framing"
    assert -camera.world_from_view[:3, 2] @ inwards > math.cos(math.radians(35))


@pytest.mark.parametrize(
    ("edges", "normal"),
    [
        (((2, 0, 0), (0, 1, 0)), (0, 0, 1)),
        (((0, 1, 0), (2, 0, 0)), (0, 0, -1)),
        (((0, 0, 1), (0, 1, 0)), (-1, 0, 0)),
        (((2, 0, 0), (0, 0, 2)), (0, -1, 0)),
    ],
)
def test_a_single_quad_is_seen_from_its_front(edges, normal):
    camera = automatic_camera(one(quad((0, 0, 0), *edges)))
    assert camera.world_from_view[:3, 2] @ normal > 0.5


def test_small_things_on_a_huge_ground_fill_the_picture():
    """A box of 1 m on a ground of 1e6 m."""
    ground = Instance(quad((-5e5, 0, 5e5), (1e6, 0, 0), (0, 0, -1e6)))
    scene = Scene([ground, Instance(box((-0.5, 0, -0.5), (0.5, 1, 0.5)))])
    camera = automatic_camera(scene)
    assert camera.name == "framing" and np.linalg.norm(camera.position) < 10


@pytest.mark.parametrize("name", ["ball", "terrain", "floor", "courtyard"])
def test_a_view_from_inside_exists_for_any_scene(name):
    scene = OUTSIDE[name]()
    camera = inside_camera(scene)
    assert np.isfinite(camera.world_from_view).all()


@pytest.mark.parametrize(
    "scene", [Scene(), one(mesh([[0, 0, 0]] * 3, [[0, 1, 2]])), one(mesh([[0, 0, 0]], np.zeros((0, 3))))]
)
def test_scenes_without_area_have_a_view(scene):
    for view in (automatic_camera, inside_camera):
        assert np.isfinite(view(scene).world_from_view).all()


def test_views_are_the_same_each_time():
    scene = make_scene("room", 3)
    first, second = automatic_camera(scene), automatic_camera(scene)
    assert np.array_equal(first.world_from_view, second.world_from_view)
