"""The built-in scene that moves: the figure's mesh and weights, its gait, and where everything is over time."""

from __future__ import annotations

import numpy as np
import pytest
from unit.test_builtin import directions, is_watertight, nearest_hit, volume

from wgpu_gi.scene.built_in.figure import MOST_INFLUENCES, make_figure
from wgpu_gi.scene.built_in.gait import joint_matrices, make_gait
from wgpu_gi.scene.built_in.surface_nets import surface_net
from wgpu_gi.scene.built_in.walk import DURATION, walk
from wgpu_gi.scene.deformation import posed_mesh
from wgpu_gi.scene.scene import Mesh

TIMES = (0.0, 0.37, 1.5, 3.0, 4.6, DURATION)


@pytest.fixture(scope="module")
def scene():
    return walk(1500)


def as_mesh(positions, triangles):
    return Mesh(positions.astype(np.float32), triangles.astype(np.uint32))


def world_triangles(scene, names=None):
    found = []
    for instance in scene.instances:
        if names is None or instance.name in names:
            points = posed_mesh(instance).positions.astype(np.float64)
            points = points @ instance.world_from_local[:3, :3].T + instance.world_from_local[:3, 3]
            found.append(points[instance.mesh.triangles])
    return np.concatenate(found)


def instance_of(scene, name):
    return next(i for i in scene.instances if i.name == name)


def test_a_surface_net_of_a_ball_is_the_ball():
    centre, radius, cell = np.array((0.1, 0.2, -0.3)), 0.5, 0.05

    def ball(points):
        return np.linalg.norm(points - centre, axis=1) - radius

    positions, normals, triangles = surface_net(ball, centre - 0.6, centre + 0.6, cell)
    distance = np.linalg.norm(positions - centre, axis=1)
    np.testing.assert_allclose(distance, radius, atol=0.1 * cell)  # some would leave their cells
    assert np.median(np.abs(distance - radius)) < 1e-9
    np.testing.assert_allclose(normals, (positions - centre) / distance[:, None], atol=1e-3)
    mesh = as_mesh(positions, triangles)
    assert is_watertight(mesh) and len(positions) - len(triangles) / 2 == 2
    assert volume(mesh) == pytest.approx(4 / 3 * np.pi * radius**3, rel=0.01)


@pytest.mark.parametrize("vertices, joints", [(1500, 21), (6000, 60)])
def test_a_figure_has_a_closed_skin_and_weights_of_all_its_joints(vertices, joints):
    figure = make_figure(vertices, joints)
    assert len(figure.positions) == pytest.approx(vertices, rel=0.08)
    mesh = as_mesh(figure.positions, figure.triangles)
    assert is_watertight(mesh) and 0.06 < volume(mesh) < 0.075  # cubic metres: a person
    low, high = figure.positions.min(0), figure.positions.max(0)
    assert -0.01 < low[1] < 0.005 and 1.75 < high[1] < 1.8
    np.testing.assert_allclose(np.linalg.norm(figure.normals, axis=1), 1.0)
    # Weights: at most four, sorted, sums of one, and each joint has some.
    assert figure.weights.shape == (len(figure.positions), MOST_INFLUENCES)
    assert (figure.weights >= 0).all() and (np.diff(figure.weights, axis=1) <= 0).all()
    np.testing.assert_allclose(figure.weights.sum(1), 1.0)
    assert len(figure.names) == len(set(figure.names)) == joints
    assert set(figure.joints[figure.weights > 0]) == set(range(joints))
    assert (figure.parents < np.arange(joints)).all() and figure.parents[0] == -1


def test_a_gait_repeats_and_keeps_a_foot_on_the_ground():
    figure = make_figure(1500)
    gait = make_gait(figure)
    np.testing.assert_allclose(gait.rotations[0], gait.rotations[-1], atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(gait.rotations, axis=-1), 1.0)
    assert gait.heights[0] == pytest.approx(gait.heights[-1]) and np.ptp(gait.heights) < 0.1
    assert 1.0 < gait.stride < 1.6
    # The right side does half a cycle later what the left side does.
    left, right = (figure.names.index(f"{side} thigh") for side in ("left", "right"))
    np.testing.assert_allclose(gait.rotations[:12, left, 0], gait.rotations[12:24, right, 0], atol=1e-12)
    # At rest, joints leave the skin where it is.
    rest = np.tile((0.0, 0.0, 0.0, 1.0), (len(figure.names), 1))
    np.testing.assert_allclose(joint_matrices(figure, rest), np.tile(np.eye(4), (len(rest), 1, 1)), atol=1e-15)


def test_the_scene_begins_and_ends_at_rest(scene):
    for time in (0.0, DURATION):
        posed = scene.at(time)
        for mine, its in zip(scene.instances, posed.instances, strict=True):
            np.testing.assert_allclose(mine.world_from_local, its.world_from_local, atol=1e-9)
            if its.joint_matrices is not None:
                np.testing.assert_allclose(mine.joint_matrices, its.joint_matrices, atol=1e-9)
        np.testing.assert_allclose(scene.lights[0].position, posed.lights[0].position, atol=1e-9)
    assert scene.animations[0].duration == DURATION


@pytest.mark.parametrize("time", TIMES)
def test_the_figure_walks_on_the_floor_within_the_room(scene, time):
    points = world_triangles(scene.at(time), {"figure"}).reshape(-1, 3)
    assert abs(points[:, 1].min()) < 0.02 and 1.6 < points[:, 1].max() < 1.8
    assert (points.min(0) > (-2.5, -0.02, -2.4)).all() and (points.max(0) < (3.0, 1.8, 2.4)).all()


@pytest.mark.parametrize("time", TIMES)
def test_the_lamp_hangs_below_its_cord(scene, time):
    lamp = np.array(scene.at(time).lights[0].position)
    assert np.linalg.norm(lamp - (-0.3, 2.6, 0.4)) == pytest.approx(0.72) and lamp[1] < 2.0


def test_the_door_lets_light_in_only_while_it_is_open(scene):
    rays = directions(4000)
    for time, opened in ((0.0, False), (1.5, True), (3.0, True), (DURATION, False)):
        posed = scene.at(time)
        bright = np.array(posed.lights[1].position)
        distance = nearest_hit(bright, rays, world_triangles(posed, {i.name for i in posed.instances} - {"figure"}))
        ends = bright + rays * distance[:, None]
        assert np.isfinite(distance).all()
        assert bool((ends[:, 2] > -2.5).any()) == opened
