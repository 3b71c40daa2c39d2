"""Animations: tracks against glTF's formulas, poses against straightforward code, and players against their source."""

import math

import numpy as np
import pytest

from wgpu_gi.camera import Camera
from wgpu_gi.errors import GiError
from wgpu_gi.scene.animation import Animation, Attachment, Channel, Node, Skeleton, Track
from wgpu_gi.scene.built_in.shapes import box, quad
from wgpu_gi.scene.check import check_scene
from wgpu_gi.scene.deformation import is_deformed, posed_mesh
from wgpu_gi.scene.player import Player, find_animation
from wgpu_gi.scene.scene import (
    DirectionalLight,
    Instance,
    Material,
    MorphTarget,
    PointLight,
    Scene,
    Skin,
    SpotLight,
)
from wgpu_gi.scene.tracks import value_at

HALF = math.sqrt(0.5)


def turn(axis, angle):
    """Return the quaternion of a turn about an axis."""
    return [*(np.array(axis) * math.sin(angle / 2)), math.cos(angle / 2)]


def animated(*channels, attachments=(), skeletons=(), name=""):
    return Animation(name, list(channels), list(attachments), list(skeletons))


# Tracks


@pytest.mark.parametrize(("time", "value"), [(-1, 3), (0, 3), (1, 3), (1.999, 3), (2, 5), (2.5, 5), (3, -1), (9, -1)])
def test_steps(time, value):
    assert value_at(Track([1, 2, 3], [3, 5, -1], "step"), time) == [value]


@pytest.mark.parametrize(("time", "value"), [(0, 3), (1, 3), (1.25, 3.5), (2, 5), (2.5, 2), (3, -1), (9, -1)])
def test_linear(time, value):
    assert value_at(Track([1, 2, 3], [3, 5, -1]), time) == pytest.approx([value])


def test_a_cubic_track_is_the_polynomial_that_its_keys_sample():
    """A spline through values and slopes of a cubic polynomial is that polynomial, whatever the spacing of its keys."""
    times = np.array([0.5, 1.0, 4.0, 4.25])
    values = np.stack(
        [np.polyval([6, 0, -5], times), np.polyval([2, 0, -5, 1], times), np.polyval([6, 0, -5], times)], 1
    )
    track = Track(times, values, "cubic")
    for time in (0.5, 0.7, 1.0, 2.2, 3.9, 4.1, 4.25):
        assert value_at(track, time) == pytest.approx([np.polyval([2, 0, -5, 1], time)])
    assert value_at(track, 9.0) == value_at(track, 4.25)


def test_in_and_out_tangents_differ():
    """At t = 1/2: v_0 / 2 + v_1 / 2 + t_d (b_0 - a_1) / 8."""
    track = Track([0, 2], [[100, 0, 8], [16, 1, 100]], "cubic")
    assert value_at(track, 1.0) == pytest.approx([0.5 + 2 * (8 - 16) / 8])


@pytest.mark.parametrize("angle", [1e-12, 1e-7, 1e-3, 1.0, 3.0, math.pi - 1e-9])
def test_turns_at_constant_speed(angle):
    track = Track([0, 1], [turn((0, 0, 1), 0.2), turn((0, 0, 1), 0.2 + angle)])
    for share in (0.0, 0.25, 0.5, 1.0):
        np.testing.assert_allclose(value_at(track, share, True), turn((0, 0, 1), 0.2 + share * angle), atol=1e-12)


def test_turns_take_the_shorter_way():
    """-q turns as q does: from 0 to 270 degrees is a quarter back."""
    back = turn((0, 1, 0), 1.5 * math.pi)
    np.testing.assert_allclose(
        value_at(Track([0, 1], [[0, 0, 0, 1], back]), 0.5, True), turn((0, 1, 0), -math.pi / 4), atol=1e-12
    )


def test_quaternions_are_normalised():
    linear = Track([0, 1], [[0, 0, 0, 2.0], [0, 0, 3.0, 3.0]])
    np.testing.assert_allclose(value_at(linear, 0.5, True), turn((0, 0, 1), math.pi / 4), atol=1e-12)
    cubic = Track([0, 1], [[[0] * 4, [0, 0, 0, 1], [0] * 4], [[0] * 4, [0, 0, 1, 0], [0] * 4]], "cubic")
    np.testing.assert_allclose(value_at(cubic, 0.5, True), [0, 0, HALF, HALF])
    vanishing = Track([0, 1], [[[0] * 4, [0, 0, 0, 1], [0] * 4], [[0] * 4, [0, 0, 0, -1], [0] * 4]], "cubic")
    assert np.isfinite(value_at(vanishing, 0.5, True)).all()


def test_equal_times_jump():
    track = Track([0, 1, 1, 2], [0, 1, 5, 6])
    assert [value_at(track, t)[0] for t in (0.5, 1.0, 1.5)] == [0.5, 5, 5.5]


# Poses


def figure(count=40, joints=5, targets=3, seed=0):
    """Return an instance of random vertices, influences and displacements."""
    rng = np.random.default_rng(seed)
    mesh = box((0, 0, 0), (1, 1, 1))
    mesh.positions, mesh.triangles = rng.normal(size=(count, 3)).astype("f4"), np.arange(count // 3 * 3).reshape(-1, 3)
    mesh.normals = rng.normal(size=(count, 3)).astype("f4")
    mesh.tangents = np.column_stack([rng.normal(size=(count, 3)), np.ones(count)]).astype("f4")
    weights = rng.random((count, 8))
    skin = rng.integers(0, joints, (count, 8)).astype(np.uint16), weights / weights.sum(1, keepdims=True)
    mesh.skin = Skin(skin[0], skin[1].astype("f4"))
    mesh.morph_targets = [MorphTarget(*rng.normal(size=(3, count, 3)).astype("f4")) for _ in range(targets)]
    mesh.morph_targets[1].normals = None
    matrices = np.tile(np.eye(4), (joints, 1, 1))
    matrices[:, :3] = rng.normal(size=(joints, 3, 4))
    return Instance(mesh, joint_matrices=matrices, morph_weights=tuple(rng.normal(size=targets)))


def test_the_pose_is_that_of_the_formula():
    """sum_i w_i J_i (p + sum_t m_t d_t), vertex by vertex."""
    instance = figure()
    check_scene(Scene([instance]))
    posed, mesh = posed_mesh(instance), instance.mesh
    for v in range(len(mesh.positions)):
        matrix = sum(
            float(w) * instance.joint_matrices[j]
            for j, w in zip(mesh.skin.joints[v], mesh.skin.weights[v], strict=True)
        )
        moved = {}
        for name in ("positions", "normals", "tangents"):
            moved[name] = getattr(mesh, name)[v, :3].astype(float)
            for target, weight in zip(mesh.morph_targets, instance.morph_weights, strict=True):
                if getattr(target, name) is not None:
                    moved[name] = moved[name] + weight * getattr(target, name)[v].astype(float)
        # Rows of weights sum to 1 to the rounding of float32, which the homogeneous coordinate does not divide away.
        position = (matrix @ [*moved["positions"], 1])[:3]
        np.testing.assert_allclose(posed.positions[v], position, rtol=1e-12, atol=1e-12)
        for name in ("normals", "tangents"):
            direction = matrix[:3, :3] @ moved[name]
            np.testing.assert_allclose(getattr(posed, name)[v, :3], direction / np.linalg.norm(direction), atol=1e-12)
    assert posed.triangles is mesh.triangles and posed.skin is None and not posed.morph_targets
    assert (posed.tangents[:, 3] == 1).all() and not is_deformed(Instance(posed))


def test_bounds_are_those_of_the_pose():
    instance = figure()
    instance.world_from_local = np.diag([2.0, -1, 3, 1])
    instance.world_from_local[:3, 3] = 5, 6, 7
    corners = posed_mesh(instance).positions * [2, -1, 3] + [5, 6, 7]
    np.testing.assert_allclose(Scene([instance]).bounds(), [corners.min(0), corners.max(0)])


def test_a_mesh_without_pose_is_itself():
    instance = figure()
    instance.joint_matrices, instance.morph_weights = None, ()
    assert posed_mesh(instance) is instance.mesh and not is_deformed(instance)
    box_of_bind = np.stack([instance.mesh.positions.min(0), instance.mesh.positions.max(0)])
    np.testing.assert_allclose(Scene([instance]).bounds(), box_of_bind)


# Players


def arm_scene():
    """Return a scene in which an arm of two nodes turns and carries a box, a lamp, a sun and a camera."""
    shoulder = Node(translation=(1, 0, 0))
    wrist = Node(shoulder, translation=(0, 2, 0), scale=(3, 3, 3))
    still = Node(translation=(0, 0, 9))
    parts = [
        Instance(box((0, 0, 0), (1, 1, 1), Material())),
        SpotLight((0, 0, 0), (0, 0, -1), 0.1, 0.5),
        DirectionalLight((0, 0, -1)),
        Camera(),
    ]
    scene = Scene(
        [parts[0], Instance(box((0, 0, 0), (1, 1, 1)))], [*parts[1:3], PointLight((1, 2, 3))], None, [parts[3]]
    )
    shift = np.eye(4)
    shift[:3, 3] = 0, 1, 0
    attachments = [Attachment(part, wrist, shift) for part in parts] + [Attachment(scene.lights[2], still)]
    quarter = Channel(shoulder, "rotation", Track([1, 3], [turn((0, 0, 1), 0), turn((0, 0, 1), math.pi / 2)]))
    scene.animations = [animated(quarter, attachments=attachments, name="wave")]
    return scene


def test_nodes_place_what_they_carry():
    """The wrist is at (1, 2, 0) at first, and after a quarter turn at (1 - 2, 0, 0); the shift is scaled by 3."""
    scene = arm_scene()
    check_scene(scene)
    first, last, middle = scene.at(0.0), scene.at(3.0), scene.at(2)
    np.testing.assert_allclose(first.instances[0].world_from_local[:3, 3], [1, 5, 0], atol=1e-12)
    expected = [[0, -3, 0, -4], [3, 0, 0, 0], [0, 0, 3, 0], [0, 0, 0, 1]]
    np.testing.assert_allclose(last.instances[0].world_from_local, expected, atol=1e-12)
    np.testing.assert_allclose(last.lights[0].position, [-4, 0, 0], atol=1e-12)
    np.testing.assert_allclose(last.lights[0].direction, [0, 0, -1], atol=1e-12)
    np.testing.assert_allclose(last.cameras[0].world_from_view[:3, :2], [[0, -1], [1, 0], [0, 0]], atol=1e-12)
    np.testing.assert_allclose(middle.lights[0].position, [1 - 5 * HALF, 5 * HALF, 0], atol=1e-12)
    for posed in (first, last, middle):
        check_scene(posed)
        assert posed.instances[1] is scene.instances[1] and posed.instances[0].mesh is scene.instances[0].mesh
        assert posed.lights[2] is scene.lights[2] and tuple(scene.lights[2].position) == (1, 2, 3)
    assert tuple(scene.lights[0].position) == (0, 0, 0) and (scene.instances[0].world_from_local == np.eye(4)).all()


def test_times_outside_are_limited_and_poses_can_be_posed_again():
    scene = arm_scene()
    for time, same in ((-5, 0), (99, 3)):
        a, b = (scene.at(t).instances[0].world_from_local for t in (time, same))
        np.testing.assert_array_equal(a, b)
    again = scene.at(1.5).at(3)
    np.testing.assert_array_equal(again.instances[0].world_from_local, scene.at(3).instances[0].world_from_local)
    with pytest.raises(GiError, match="finite number of seconds"):
        scene.at(math.nan)


def test_fields_of_lights_cameras_and_materials():
    """Values are limited to what the field allows, where splines leave it."""
    scene = arm_scene()
    material, lamp, camera = scene.instances[0].mesh.materials[0], scene.lights[0], scene.cameras[0]
    spline = [[[0, 0], [0.5, 1], [9, 9]], [[-9, -9], [0.5, 1], [0, 0]]]
    scene.animations = [
        animated(
            Channel(material, "roughness", Track([0, 1], np.array(spline)[:, :, :1], "cubic")),
            Channel(material, "emission", Track([0, 1], [[0, 1, 2], [2, 1, 0]]), Track([0, 1], [10, 30])),
            Channel(lamp, "intensity", Track([0, 1], [2, 4])),
            Channel(lamp, "outer_cone_angle", Track([0, 1], [0.5, 0.01])),
            Channel(lamp, "range", Track([0, 1], [0, 4], "step")),
            Channel(camera, "yfov", Track([0, 1], [1, 0.5])),
        )
    ]
    check_scene(scene)
    posed = scene.at(0.5)
    check_scene(posed)
    assert posed.materials[0].roughness == 1.0 and posed.materials[0].emission == pytest.approx((20, 20, 20))
    assert posed.lights[0].intensity == 3 and posed.lights[0].range is None and posed.cameras[0].yfov == 0.75
    end = scene.at(1)
    assert end.lights[0].inner_cone_angle == end.lights[0].outer_cone_angle == 0.01 and end.lights[0].range == 4
    assert posed.instances[0].mesh is not scene.instances[0].mesh and material.roughness == 1.0
    assert posed.instances[0].mesh.positions is scene.instances[0].mesh.positions


def test_joints_pose_a_skin_relative_to_the_first():
    """Joint matrices are local_from_bind: world = translation to the first joint, times them."""
    root = Node(translation=(100, 0, 0))
    tip = Node(root, translation=(0, 1, 0))
    mesh = quad((0, 0, 0), (1, 0, 0), (0, 1, 0))
    mesh.skin = Skin(np.array([[0], [0], [1], [1]], np.uint16), np.ones((4, 1), np.float32))
    bind = np.tile(np.eye(4), (2, 1, 1))
    bind[1, 1, 3] = -1
    instance = Instance(mesh)
    walk = Channel(root, "translation", Track([0, 1], [[100, 0, 0], [200, 0, 0]]))
    bend = Channel(tip, "rotation", Track([0, 1], [turn((0, 0, 1), 0), turn((0, 0, 1), math.pi / 2)]))
    scene = Scene([instance], animations=[animated(walk, bend, skeletons=[Skeleton([instance], [root, tip], bind)])])
    check_scene(scene)
    posed = scene.at(1.0).instances[0]
    np.testing.assert_allclose(posed.world_from_local[:3, 3], [200, 0, 0])
    world = posed_mesh(posed).positions + posed.world_from_local[:3, 3]
    np.testing.assert_allclose(world, [[200, 0, 0], [201, 0, 0], [200, 2, 0], [200, 1, 0]], atol=1e-12)
    assert instance.joint_matrices is None


def test_morph_weights_are_a_tuple():
    mesh = quad((0, 0, 0), (1, 0, 0), (0, 1, 0))
    mesh.morph_targets = [MorphTarget(np.ones((4, 3), np.float32)), MorphTarget()]
    instance = Instance(mesh, morph_weights=(0.0, 0.0))
    track = Track([0, 2], [[0, 0], [1, 4]])
    scene = Scene([instance], animations=[animated(Channel(instance, "morph_weights", track))])
    check_scene(scene)
    posed = scene.at(1).instances[0]
    assert posed.morph_weights == (0.5, 2.0)
    np.testing.assert_allclose(posed_mesh(posed).positions, mesh.positions + 0.5)


def test_a_part_scaled_to_zero_is_tiny_and_returns():
    scene = arm_scene()
    wrist = scene.animations[0].attachments[0].node
    vanish = Channel(wrist, "scale", Track([0, 1, 2], [[0, 0, 0], [1, 0, 0], [1, 1, 1]]))
    scene.animations = [animated(vanish, attachments=scene.animations[0].attachments)]
    for time in (0.0, 0.5, 1.0, 1.5):
        posed = scene.at(time)
        check_scene(posed)
        assert np.abs(np.linalg.svd(posed.instances[0].world_from_local[:3, :3])[1][2]) <= max(time - 1, 2e-6)


def test_a_player_keeps_its_copies_and_takes_over_changes_of_its_source():
    scene = arm_scene()
    player = Player(scene, "wave")
    player.pose(0.0)
    instance, lamp, camera = player.scene.instances[0], player.scene.lights[0], player.scene.cameras[0]
    assert player.posed(scene.cameras[0]) is camera and player.source is scene
    other = Camera()
    assert player.posed(other) is other
    scene.lights[0].intensity = 7.0
    scene.instances.append(Instance(box((0, 0, 0), (1, 1, 1))))
    scene.environment, scene.lights[1:] = None, []
    player.pose(3.0)
    assert player.scene.instances[0] is instance and player.scene.lights[0] is lamp
    assert lamp.intensity == 7.0 and len(player.scene.instances) == 3 and len(player.scene.lights) == 1
    np.testing.assert_allclose(lamp.position, [-4, 0, 0], atol=1e-12)


def test_animations_are_found_by_name_and_index():
    scene = arm_scene()
    second = animated(*scene.animations[0].channels, name="1")
    scene.animations.append(second)
    scene.animations.append(animated(*second.channels, name="run"))
    found = [find_animation(scene, key) for key in (None, 0, "wave", "1", 1, "2", "run", 2)]
    assert [scene.animations.index(a) for a in found] == [0, 0, 0, 1, 1, 2, 2, 2]
    for key, words in (("walk", "no animation 'walk'; available: wave, 1, run"), (3, "last is 2"), (-1, "last is 2")):
        with pytest.raises(GiError, match=words):
            find_animation(scene, key)
    with pytest.raises(GiError, match="has no animation"):
        find_animation(Scene(), None)
    assert "wave 3 s, 1 3 s, run 3 s" in str(scene)


# Checks


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda a: setattr(a.attachments[0].node.parent, "parent", a.attachments[0].node), "below itself"),
        (lambda a: setattr(a.attachments[0].node, "rotation", (0, 0, 1)), r"node.rotation must be 4 numbers"),
        (lambda a: setattr(a.attachments[0].node, "matrix", np.ones((4, 3))), r"node.matrix must be None or a finite"),
        (lambda a: setattr(a.channels[0], "path", "weights"), "path must be one of 'translation', 'rotation', 'scale'"),
        (lambda a: setattr(a.channels[0], "track", Track([0], [[0, 0, 0, 0]])), "zero quaternions"),
        (lambda a: setattr(a.channels[0], "track", Track([0], [[1, 0, 0]])), r"values must be a numpy array \(n, 4\)"),
        (lambda a: setattr(a.attachments[0], "node_from_part", np.eye(3)), "node_from_part must be"),
        (lambda a: a.skeletons.append(Skeleton([], [], np.zeros((0, 4, 4)))), "inverse_bind must have a matrix for"),
    ],
)
def test_wrong_animations_are_named(change, words):
    scene = arm_scene()
    change(scene.animations[0])
    with pytest.raises(GiError, match=r"scene\.animations\[0\]\..*" + words):
        check_scene(scene)


def test_a_pose_depends_on_the_time_alone():
    """Where a track leaves the range of coordinates, or aims a light nowhere, the part is as in the scene."""
    node, lamp = Node(), SpotLight((0, 0, 0), (0.0, -1.0, 0.0))
    instance = Instance(quad((0, 0, 0), (1, 0, 0), (0, 1, 0)))
    far = Track([0, 1], [[[0, 0, 0], [1, 0, 0], [1e17, 0, 0]], [[0, 0, 0], [2, 0, 0], [0, 0, 0]]], "cubic")
    away = Channel(lamp, "direction", Track([0, 1], [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]))
    scene = Scene([instance], [lamp], animations=[animated(Channel(node, "translation", far), away)])
    scene.animations[0].attachments.append(Attachment(instance, node))
    player = Player(scene)
    for time in (1.0, 0.5):
        player.pose(time)
        expected = scene.at(time)
        np.testing.assert_array_equal(
            player.scene.instances[0].world_from_local, expected.instances[0].world_from_local
        )
        assert player.scene.lights[0].direction == expected.lights[0].direction
    np.testing.assert_array_equal(player.scene.instances[0].world_from_local, np.eye(4))
    assert player.scene.lights[0].direction == (0.0, -1.0, 0.0)
