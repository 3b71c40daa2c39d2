"""Morph targets and skins of glTF files at rest, against positions worked out by hand (glTF 2.0, 3.7.2.2, 3.7.3)."""

import math

import numpy as np
import pytest
from unit.gltf_builder import TRIANGLE, GltfBuilder, corners, only_mesh

from wgpu_gi.errors import GiError
from wgpu_gi.scene.files.notes import Notes
from wgpu_gi.scene.gltf.load import load_gltf

UP = np.tile(np.array([0, 1, 0], np.float32), (3, 1))
RIGHT = np.tile(np.array([1, 0, 0], np.float32), (3, 1))


def world_positions(scene, k=0):
    """Return the world positions of the vertices of instance k."""
    matrix = scene.instances[k].world_from_local
    return scene.instances[k].mesh.positions @ matrix[:3, :3].T + matrix[:3, 3]


# Morph targets


@pytest.mark.parametrize(
    ("mesh", "node", "move"),
    [
        ({}, {}, (0, 0)),
        ({"weights": [1.0, 0.0]}, {}, (0, 1)),
        ({"weights": [0.25, -0.5]}, {}, (-0.5, 0.25)),
        ({"weights": [0.0, 0.0]}, {"weights": [0.0, 1.0]}, (1, 0)),
        ({"weights": [1.0, 1.0]}, {"weights": [0.0, 0.0]}, (0, 0)),
        ({"weights": [1.0, 1.0]}, {"weights": None}, (1, 1)),
        ({"weights": [0.5]}, {}, (0, 0.5)),
        ({"weights": [1, 0, 9]}, {}, (0, 1)),
    ],
)
def test_morph_targets_move_by_the_weights_of_the_node_or_else_of_the_mesh(tmp_path, mesh, node, move):
    """p + w0 (0, 1, 0) + w1 (1, 0, 0)."""
    builder = GltfBuilder()
    targets = [{"POSITION": builder.accessor(UP)}, {"POSITION": builder.accessor(RIGHT)}]
    builder.node(mesh=builder.mesh(builder.primitive(targets=targets), **mesh), **node)
    np.testing.assert_allclose(corners(only_mesh(builder, tmp_path)), [TRIANGLE + np.float32([*move, 0])])


def test_nodes_with_other_weights_share_no_mesh(tmp_path):
    builder = GltfBuilder()
    mesh = builder.mesh(builder.primitive(targets=[{"POSITION": builder.accessor(UP)}]), weights=[2.0])
    for weights in ([0.0], [1.0], [1.0]):
        builder.node(mesh=mesh, weights=weights)
    builder.node(mesh=mesh)
    scene = load_gltf(builder.glb(tmp_path))
    assert [float(i.mesh.positions[:, 1].min()) for i in scene.instances] == [0, 1, 1, 2]
    assert len(scene.meshes) == 3


def test_sparse_and_quantised_targets(tmp_path):
    builder = GltfBuilder()
    sparse = {
        "count": 1,
        "indices": {"bufferView": builder.view(b"\2\0\0\0"), "componentType": 5121},
        "values": {"bufferView": builder.view(np.array([0, 0, 4], np.float32).tobytes())},
    }
    lift = builder.add("accessors", {"count": 3, "type": "VEC3", "componentType": 5126, "sparse": sparse})
    small = np.zeros((3, 4), np.int8)
    small[:, 0] = (127, -127, 0)
    steps = builder.add("accessors", {"bufferView": builder.view(small.tobytes()), "count": 3, "type": "VEC3"})
    builder.json["accessors"][steps] |= {"componentType": 5120, "normalized": True}
    builder.json["bufferViews"][-1]["byteStride"] = 4
    primitive = builder.primitive(targets=[{"POSITION": lift}, {"POSITION": steps}])
    builder.node(mesh=builder.mesh(primitive, weights=[0.5, 1.0]))
    expected = TRIANGLE + np.float32([[1, 0, 0], [-1, 0, 0], [0, 0, 2]])
    np.testing.assert_allclose(corners(only_mesh(builder, tmp_path)), [expected], atol=1e-6)


def test_normals_tangents_colors_and_texture_coordinates_morph(tmp_path):
    """Directions are normalised after the sum; tangents keep their w; colours are limited to 1."""
    builder = GltfBuilder()
    moves = {
        "NORMAL": np.tile(np.float32([1, 0, -1]), (3, 1)),
        "TANGENT": np.tile(np.float32([-1, 0, 2]), (3, 1)),
        "COLOR_0": np.full((3, 3), 0.5, np.float32),
        "TEXCOORD_0": np.full((3, 2), 0.25, np.float32),
        "_CUSTOM": np.zeros((3, 3), np.float32),
    }
    target = {name: builder.accessor(values) for name, values in moves.items()}
    primitive = builder.primitive(
        targets=[target],
        NORMAL=np.tile(np.float32([0, 0, 1]), (3, 1)),
        TANGENT=np.tile(np.float32([1, 0, 0, -1]), (3, 1)),
        COLOR_0=np.tile(np.float32([0.25, 0.75, 0, 0.5]), (3, 1)),
        TEXCOORD_0=np.zeros((3, 2), np.float32),
    )
    builder.node(mesh=builder.mesh(primitive, weights=[0.5]))
    mesh = only_mesh(builder, tmp_path)
    half = math.sqrt(0.5)
    np.testing.assert_allclose(mesh.normals, [[half, 0, half]] * 3, atol=1e-6)
    np.testing.assert_allclose(
        mesh.tangents, [[0.5 / math.hypot(0.5, 1), 0, 1 / math.hypot(0.5, 1), -1]] * 3, atol=1e-6
    )
    np.testing.assert_allclose(mesh.colors, [[0.5, 1, 0.25, 0.5]] * 3)
    np.testing.assert_allclose(mesh.texcoords0, [[0.125, 0.125]] * 3)


def test_a_broken_target_is_ignored_and_the_others_apply(tmp_path):
    builder = GltfBuilder()
    short, lift = builder.accessor(UP[:2]), builder.accessor(UP)
    targets = [{"POSITION": short}, {"POSITION": 99}, 5, {"POSITION": lift}]
    builder.node(mesh=builder.mesh(builder.primitive(targets=targets), weights=[1.0, 1.0, 1.0, 3.0]))
    scene = load_gltf(builder.glb(tmp_path))
    np.testing.assert_allclose(corners(scene.meshes[0]), [TRIANGLE + np.float32([0, 3, 0])])
    assert sum("targets[" in note for note in scene.notes) == 3
    with pytest.raises(GiError, match=r"targets\["):
        load_gltf(builder.glb(tmp_path), notes=Notes(strict=True))


def test_absurd_weights_leave_nothing_to_show(tmp_path):
    builder = GltfBuilder()
    builder.node(mesh=builder.mesh(builder.primitive(targets=[{"POSITION": builder.accessor(UP)}]), weights=[1e300]))
    with pytest.raises(GiError, match="no triangles to show"):
        load_gltf(builder.glb(tmp_path))


def test_morph_targets_move_before_the_skin_turns(tmp_path):
    """The joint turns by a quarter about Z: (x, y) + (0, 1) becomes (-y - 1, x)."""
    builder = GltfBuilder()
    weights, bound = np.tile(np.float32([1, 0, 0, 0]), (3, 1)), np.zeros((3, 4), np.uint8)
    primitive = builder.primitive(targets=[{"POSITION": builder.accessor(UP)}], JOINTS_0=bound, WEIGHTS_0=weights)
    half = math.sqrt(0.5)
    builder.add("skins", {"joints": [builder.node(rotation=[0, 0, half, half])]})
    builder.node(mesh=builder.mesh(primitive, weights=[1.0]), skin=0)
    moved = world_positions(load_gltf(builder.glb(tmp_path)))
    np.testing.assert_allclose(moved, [[-1, 0, 0], [-1, 1, 0], [-2, 0, 0]], atol=1e-6)


# Skins


def test_skinned_mesh_is_posed_by_its_joints_at_rest(tmp_path):
    builder = GltfBuilder()
    weights = np.array([[1, 0, 0, 0], [0.5, 0.5, 0, 0], [0, 1, 0, 0]], np.float32)
    bound = np.array([[0, 1, 0, 0]] * 3, np.uint8)
    normals = np.tile(np.array([1, 0, 0], np.float32), (3, 1))
    mesh = builder.mesh(builder.primitive(NORMAL=normals, JOINTS_0=bound, WEIGHTS_0=weights))
    half = math.sqrt(0.5)
    second = builder.node(root=False, translation=[0, 1, 0])
    first = builder.node(translation=[100, 0, 0], rotation=[0, 0, half, half], children=[second])
    inverse = np.stack([np.eye(4), np.eye(4)]).astype(np.float32)
    inverse[1, 3, 1] = -1.0  # column-major: translation by -1 along Y
    matrices = builder.accessor(inverse.reshape(2, 16))
    builder.add("skins", {"joints": [first, second], "inverseBindMatrices": matrices})
    builder.node(mesh=mesh, skin=0, translation=[7, 7, 7])
    scene = load_gltf(builder.glb(tmp_path))
    matrix = scene.instances[0].world_from_local
    world = scene.meshes[0].positions @ matrix[:3, :3].T + matrix[:3, 3]
    np.testing.assert_allclose(world, [[100, 0, 0], [100, 1, 0], [99, 0, 0]], atol=1e-5)
    np.testing.assert_allclose(scene.meshes[0].normals, [[0, 1, 0]] * 3, atol=1e-6)
    assert not scene.notes and scene.meshes[0].skin is None


def skinned(bound, weights, joints=((10, 0, 0), (20, 0, 0)), **more):
    """Return a builder of a triangle whose joints translate, with the attributes JOINTS_0, WEIGHTS_0 and `more`."""
    builder = GltfBuilder()
    bound, weights = np.array([bound] * 3, np.uint8), np.array([weights] * 3, np.float32)
    mesh = builder.mesh(builder.primitive(JOINTS_0=bound, WEIGHTS_0=weights, **more))
    builder.add("skins", {"joints": [builder.node(translation=list(place)) for place in joints]})
    builder.node(mesh=mesh, skin=0, translation=[0, 7, 0])
    return builder


def test_all_sets_of_influences_count(tmp_path):
    """x + 0.25 * 10 + 0.25 * 20 + 0.5 * 30."""
    more = {
        "JOINTS_1": np.array([[2, 0, 0, 0]] * 3, np.uint16),
        "WEIGHTS_1": np.array([[128, 0, 0, 0]] * 3, np.uint8),
    }
    builder = skinned([0, 1, 0, 0], [0.25, 0.25, 0, 0], ((10, 0, 0), (20, 0, 0), (30, 0, 0)), **more)
    index = builder.json["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_1"]
    builder.json["accessors"][index]["normalized"] = True
    scale = 0.5 + 128 / 255  # the sum of the weights, by which they are divided
    expected = TRIANGLE + np.float32([(7.5 + 30 * 128 / 255) / scale, 0, 0])
    np.testing.assert_allclose(world_positions(load_gltf(builder.glb(tmp_path))), expected, rtol=1e-6)


@pytest.mark.parametrize(
    ("bound", "weights", "x", "problem"),
    [
        ([1, 0, 0, 0], [0, 0, 0, 0], 20, "3 vertices have no skin weights; they follow their first joint"),
        ([1, 0, 0, 0], [np.nan, -1, 0, 0], 20, "no skin weights"),
        ([0, 9, 0, 0], [0.5, 0.5, 0, 0], 10, "refers to joint 9 of 2; it was ignored"),
        ([9, 0, 0, 0], [1, 0, 0, 0], 10, "refers to joint 9 of 2"),
    ],
)
def test_broken_influences_leave_the_vertex_with_a_joint(tmp_path, bound, weights, x, problem):
    scene = load_gltf(skinned(bound, weights).glb(tmp_path))
    np.testing.assert_allclose(world_positions(scene), TRIANGLE + np.float32([x, 0, 0]))
    assert any(problem in note for note in scene.notes)


def test_a_mesh_whose_skin_is_broken_stands_at_its_node(tmp_path):
    builder = skinned([0, 0, 0, 0], [1, 0, 0, 0])
    builder.json["skins"][0]["joints"] = []
    np.testing.assert_allclose(world_positions(load_gltf(builder.glb(tmp_path))), TRIANGLE + np.float32([0, 7, 0]))
    builder.json["skins"][0]["joints"] = [0]
    del builder.json["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"]
    scene = load_gltf(builder.glb(tmp_path))
    np.testing.assert_allclose(world_positions(scene), TRIANGLE + np.float32([0, 7, 0]))
    assert "no JOINTS_0 and WEIGHTS_0; the mesh is shown without its skin" in scene.notes[0]
