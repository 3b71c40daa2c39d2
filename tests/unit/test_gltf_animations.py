"""Animations of glTF files (3.11, KHR_animation_pointer): what moves, and what is left out of damaged ones."""

import math

import numpy as np
import pytest
from unit.gltf_builder import TRIANGLE, GltfBuilder, triangle_scene

from wgpu_gi.errors import GiError
from wgpu_gi.scene.check import check_scene
from wgpu_gi.scene.deformation import posed_mesh
from wgpu_gi.scene.files.notes import Notes
from wgpu_gi.scene.gltf.load import load_gltf

HALF = math.sqrt(0.5)
TURN = [0, 0, HALF, HALF]  # a quarter about Z


def channel(builder, times, values, target, number=0, **sampler):
    """Add a channel to the animation `number`; `target` is a JSON target, or a pointer."""
    animations = builder.json.setdefault("animations", [])
    while len(animations) <= number:
        animations.append({"samplers": [], "channels": []})
    if isinstance(target, str):
        target = {"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": target}}}
    keys = np.asarray(times, np.float32)
    values = values if isinstance(values, int) else builder.accessor(np.asarray(values, np.float32))
    animations[number]["samplers"].append({"input": builder.accessor(keys), "output": values, **sampler})
    entry = {"sampler": len(animations[number]["samplers"]) - 1, "target": target}
    animations[number]["channels"].append(entry)


def world(instance):
    """Return the world positions of a posed instance."""
    matrix = np.asarray(instance.world_from_local)
    return posed_mesh(instance).positions @ matrix[:3, :3].T + matrix[:3, 3]


def loaded(builder, folder):
    """Load the builder's file, which must have no damage; check the scene."""
    scene = load_gltf(builder.glb(folder), notes=Notes(strict=True))
    check_scene(scene)
    return scene


def at(scene, time, animation=None):
    """Return the scene at a time, checked."""
    posed = scene.at(time, animation)
    check_scene(posed)
    return posed


# Nodes


@pytest.mark.parametrize(
    ("interpolation", "values", "time", "expected"),
    [
        ("STEP", [[1, 0, 0], [2, 0, 0]], 1.9, 1),
        ("LINEAR", [[1, 0, 0], [2, 0, 0]], 1.25, 1.25),
        (None, [[1, 0, 0], [2, 0, 0]], 1.75, 1.75),
        ("CUBICSPLINE", [[9, 9, 9], [1, 0, 0], [4, 0, 0], [0, 0, 0], [2, 0, 0], [9, 9, 9]], 1.5, 1.5 + 4 / 8),
    ],
)
def test_translations(tmp_path, interpolation, values, time, expected):
    builder = triangle_scene()
    more = {"interpolation": interpolation} if interpolation else {}
    channel(builder, [1, 2], values, {"node": 0, "path": "translation"}, **more)
    scene = loaded(builder, tmp_path)
    assert scene.animations[0].duration == 2 and not scene.notes
    np.testing.assert_allclose(world(at(scene, time).instances[0]), TRIANGLE + np.float32([expected, 0, 0]), atol=1e-6)
    np.testing.assert_allclose(world(scene.instances[0]), TRIANGLE)


def test_rotation_and_scale_of_a_parent_move_lights_and_cameras_below(tmp_path):
    """The parent turns by a quarter, and scales by 2; quantised quaternions are normalised."""
    builder = GltfBuilder()
    lamp = builder.light(type="spot", spot={})
    eye = builder.node(camera=builder.add("cameras", {"type": "perspective", "perspective": {"yfov": 1}}))
    builder.json["nodes"][lamp]["translation"] = builder.json["nodes"][eye]["translation"] = [1, 0, 0]
    shape = builder.node(mesh=builder.mesh(), translation=[1, 0, 0])
    builder.json["scenes"][0]["nodes"] = []
    parent = builder.node(children=[lamp, eye, shape])
    small = builder.accessor(np.round(np.array([[0, 0, 0, 1], TURN]) * 127).astype(np.int8), normalized=True)
    channel(builder, [0, 1], small, {"node": parent, "path": "rotation"})
    channel(builder, [0, 1], [[1, 1, 1], [2, 2, 2]], {"node": parent, "path": "scale"})
    scene = loaded(builder, tmp_path)
    posed = at(scene, 1.0)
    np.testing.assert_allclose(posed.lights[0].position, [0, 2, 0], atol=1e-12)
    np.testing.assert_allclose(posed.cameras[0].world_from_view[:3, 3], [0, 2, 0], atol=1e-12)
    np.testing.assert_allclose(posed.cameras[0].world_from_view[:3, :2], [[0, -1], [1, 0], [0, 0]], atol=1e-12)
    np.testing.assert_allclose(world(posed.instances[0]), [[0, 2, 0], [0, 4, 0], [-2, 2, 0]], atol=1e-12)


def test_animations_have_names_and_lengths_of_their_own(tmp_path):
    builder = triangle_scene()
    channel(builder, [0, 1], [[0, 0, 0], [1, 0, 0]], {"node": 0, "path": "translation"}, 0)
    channel(builder, [0, 3], [[1, 1, 1], [3, 3, 3]], {"node": 0, "path": "scale"}, 1)
    builder.json["animations"][0]["name"] = "slide"
    scene = loaded(builder, tmp_path)
    assert [(a.name, a.duration) for a in scene.animations] == [("slide", 1), ("", 3)]
    np.testing.assert_allclose(world(at(scene, 3, 1).instances[0]), 3 * TRIANGLE)
    np.testing.assert_allclose(world(at(scene, 3, "slide").instances[0]), TRIANGLE + np.float32([1, 0, 0]))
    assert "slide 1 s, unnamed 3 s" in str(scene)


def test_an_object_scaled_to_zero_at_rest_appears(tmp_path):
    builder = GltfBuilder()
    builder.node(mesh=builder.mesh(), scale=[0, 0, 0])
    channel(builder, [0, 1], [[0, 0, 0], [1, 1, 1]], {"node": 0, "path": "scale"})
    scene = loaded(builder, tmp_path)
    assert np.abs(world(scene.instances[0])).max() < 1e-8
    np.testing.assert_allclose(world(at(scene, 1).instances[0]), TRIANGLE)


def test_instanced_nodes_move_together(tmp_path):
    builder = GltfBuilder()
    places = builder.accessor(np.array([[0, 0, 0], [0, 5, 0]], np.float32))
    extension = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": places}}}
    builder.node(mesh=builder.mesh(), extensions=extension)
    channel(builder, [0, 1], [[0, 0, 0], [1, 0, 0]], {"node": 0, "path": "translation"})
    posed = at(loaded(builder, tmp_path), 1.0)
    for instance, y in zip(posed.instances, (0, 5), strict=True):
        np.testing.assert_allclose(world(instance), TRIANGLE + np.float32([1, y, 0]))


# Skins and morph targets


def skinned(joints=2, **mesh):
    """Return a builder of a triangle of two joints: the second, at (0, 1, 0) of the first, moves the last vertex."""
    builder = GltfBuilder()
    bound = np.array([[0, 0, 0, 0], [0, 0, 0, 0], [1, 0, 0, 0]], np.uint8)
    weights = np.tile(np.float32([1, 0, 0, 0]), (3, 1))
    primitive = builder.primitive(JOINTS_0=bound, WEIGHTS_0=weights, **mesh)
    tip = builder.node(root=False, translation=[0, 1, 0])
    first = builder.node(translation=[100, 0, 0], children=[tip])
    inverse = np.stack([np.eye(4), np.eye(4)]).astype(np.float32)
    inverse[1, 3, 1] = -1.0  # column-major: translation by -1 along Y
    builder.add("skins", {"joints": [first, tip], "inverseBindMatrices": builder.accessor(inverse.reshape(2, 16))})
    builder.node(mesh=builder.mesh(primitive), skin=0, translation=[7, 7, 7])
    return builder


def test_a_skin_moves_with_its_joints(tmp_path):
    """The tip is lifted by 3; the root walks to x = 200. The rest pose is that of the same file without animation."""
    builder = skinned()
    still = load_gltf(builder.glb(tmp_path))
    channel(builder, [0, 1], [[0, 1, 0], [0, 4, 0]], {"node": 0, "path": "translation"})
    channel(builder, [0, 1], [[100, 0, 0], [200, 0, 0]], {"node": 1, "path": "translation"})
    scene = loaded(builder, tmp_path)
    assert still.meshes[0].skin is None and scene.meshes[0].skin.joints.dtype == np.uint16
    assert scene.meshes[0].skin.joints.shape == (3, 1)  # columns that no vertex needs are left out
    np.testing.assert_allclose(world(scene.instances[0]), world(still.instances[0]), atol=1e-5)
    posed = at(scene, 1.0).instances[0]
    np.testing.assert_allclose(world(posed), [[200, 0, 0], [201, 0, 0], [200, 4, 0]], atol=1e-5)
    np.testing.assert_allclose(posed.world_from_local[:3, 3], [200, 0, 0])


def test_all_influence_sets_are_kept(tmp_path):
    """x + 0.5 * 10 + 0.25 * 20 + 0.25 * 40, as joints 0, 1 and 2 walk; the second set is of normalised bytes."""
    builder = GltfBuilder()
    bound = [np.array([[k, k + 1, 0, 0]] * 3, np.uint8) for k in (0, 2)]
    quarter = builder.accessor(np.array([[85, 0, 0, 0]] * 3, np.uint8), normalized=True)
    first = builder.accessor(np.array([[2 / 3, 1 / 3, 0, 0]] * 3, np.float32))
    primitive = builder.primitive(JOINTS_0=bound[0], WEIGHTS_0=first, JOINTS_1=bound[1], WEIGHTS_1=quarter)
    joints = [builder.node() for _ in range(4)]
    builder.add("skins", {"joints": joints})
    builder.node(mesh=builder.mesh(primitive), skin=0)
    for joint, x in zip(joints, (10, 20, 40, 1e9), strict=True):
        channel(builder, [0, 1], [[0, 0, 0], [x, 0, 0]], {"node": joint, "path": "translation"})
    scene = loaded(builder, tmp_path)
    x = (2 / 3 * 10 + 1 / 3 * 20 + 1 / 3 * 40) / (4 / 3)
    np.testing.assert_allclose(world(at(scene, 1).instances[0]), TRIANGLE + np.float32([x, 0, 0]), rtol=1e-6)
    assert scene.meshes[0].skin.joints.shape == (3, 3)


def morphing(weights=(), node=(), sparse=False):
    """Return a builder of a triangle with two targets: up by 1, and right by 1 (sparse: the last vertex alone)."""
    builder = GltfBuilder()
    up, right = (builder.accessor(np.tile(np.float32(move), (3, 1))) for move in ([0, 1, 0], [1, 0, 0]))
    if sparse:
        places = {"bufferView": builder.view(b"\2\0\0\0"), "componentType": 5121}
        values = {"bufferView": builder.view(np.array([1, 0, 0], np.float32).tobytes())}
        entry = {"count": 1, "indices": places, "values": values}
        right = builder.add("accessors", {"count": 3, "type": "VEC3", "componentType": 5126, "sparse": entry})
    targets = [{"POSITION": up}, {"POSITION": right}]
    mesh = builder.mesh(
        builder.primitive(targets=targets), weights=list(weights), extras={"targetNames": ["up", "right"]}
    )
    builder.node(mesh=mesh, **({"weights": list(node)} if node else {}))
    return builder


@pytest.mark.parametrize("sparse", [False, True])
def test_morph_weights(tmp_path, sparse):
    builder = morphing(weights=(0.5, 0), sparse=sparse)
    channel(builder, [0, 1], [0.5, 0, 1, 4], {"node": 0, "path": "weights"})
    scene = loaded(builder, tmp_path)
    assert scene.instances[0].morph_weights == (0.5, 0.0)
    assert [target.name for target in scene.meshes[0].morph_targets] == ["up", "right"]
    x = np.float32([[0, 0, 0], [0, 0, 0], [1, 0, 0]]) if sparse else np.float32([1, 0, 0])
    np.testing.assert_allclose(world(at(scene, 0.5).instances[0]), TRIANGLE + np.float32([0, 0.75, 0]) + 2 * x)


def test_cubic_and_quantised_weights(tmp_path):
    """The keys of a spline hold all in-tangents, then all values, then all out-tangents: at 1/2, (1 + 8) / 8 more."""
    builder = morphing()
    cubic = [9, 9, 0, 0, 1, 8, 0, 0, 0, 1, 9, 9]
    channel(builder, [0, 1], cubic, {"node": 0, "path": "weights"}, interpolation="CUBICSPLINE")
    small = builder.accessor(np.array([0, 0, 255, 51], np.uint8), normalized=True)
    channel(builder, [0, 1], small, {"node": 0, "path": "weights"}, 1)
    scene = loaded(builder, tmp_path)
    assert at(scene, 0.5).instances[0].morph_weights == pytest.approx((1 / 8, 0.5 + 1))
    assert at(scene, 1, 1).instances[0].morph_weights == pytest.approx((1, 0.2))


def test_quantised_targets_and_directions(tmp_path):
    """Normals move as well and get unit length; a target's bytes are normalised."""
    builder = GltfBuilder()
    moves = np.zeros((3, 4), np.int8)
    moves[:, 0] = 127
    steps = builder.add("accessors", {"bufferView": builder.view(moves.tobytes()), "count": 3, "type": "VEC3"})
    builder.json["accessors"][steps] |= {"componentType": 5120, "normalized": True}
    builder.json["bufferViews"][-1]["byteStride"] = 4
    targets = [{"POSITION": steps, "NORMAL": steps}]
    primitive = builder.primitive(NORMAL=np.tile(np.float32([0, 0, 1]), (3, 1)), targets=targets)
    builder.node(mesh=builder.mesh(primitive))
    channel(builder, [0, 1], [0, 1], {"node": 0, "path": "weights"})
    posed = posed_mesh(at(loaded(builder, tmp_path), 1.0).instances[0])
    np.testing.assert_allclose(posed.positions, TRIANGLE + np.float32([1, 0, 0]))
    np.testing.assert_allclose(posed.normals, [[HALF, 0, HALF]] * 3)


def test_weights_move_before_the_skin(tmp_path):
    """The joints stand, turned by a quarter: (x, y) + (0, 1) becomes (-y - 1, x)."""
    builder = GltfBuilder()
    weights, bound = np.tile(np.float32([1, 0, 0, 0]), (3, 1)), np.zeros((3, 4), np.uint8)
    up = builder.accessor(np.tile(np.float32([0, 1, 0]), (3, 1)))
    primitive = builder.primitive(targets=[{"POSITION": up}], JOINTS_0=bound, WEIGHTS_0=weights)
    builder.add("skins", {"joints": [builder.node(rotation=TURN)]})
    builder.node(mesh=builder.mesh(primitive), skin=0)
    channel(builder, [0, 1], [0, 1], {"node": 1, "path": "weights"})
    posed = at(loaded(builder, tmp_path), 1.0).instances[0]
    np.testing.assert_allclose(world(posed), [[-1, 0, 0], [-1, 1, 0], [-2, 0, 0]], atol=1e-6)


def test_triangles_that_only_the_bind_pose_makes_flat_are_kept(tmp_path):
    """A line, which a target opens to a triangle; triangles that use a vertex twice are left out."""
    builder = GltfBuilder()
    line = np.float32([[0, 0, 0], [1, 0, 0], [2, 0, 0], [9, 9, 9]])
    up = builder.accessor(np.float32([[0, 0, 0], [0, 1, 0], [0, 0, 0], [0, 0, 0]]))
    primitive = builder.primitive(line, np.array([0, 1, 2, 0, 2, 2], np.uint16), targets=[{"POSITION": up}])
    builder.node(mesh=builder.mesh(primitive))
    channel(builder, [0, 1], [0, 1], {"node": 0, "path": "weights"})
    scene = loaded(builder, tmp_path)
    np.testing.assert_allclose(world(at(scene, 1).instances[0]), [[0, 0, 0], [1, 1, 0], [2, 0, 0]])
    assert scene.triangle_count == 1 and len(scene.meshes[0].morph_targets[0].positions) == 3


def test_points_follow_their_joints_and_targets(tmp_path):
    builder = GltfBuilder()
    places = np.float32([[0, 0, 0], [np.nan, 0, 0], [1, 0, 0], [0, 1, 0]])
    bound = np.array([[0, 0, 0, 0]] * 3 + [[1, 0, 0, 0]], np.uint8)
    up = builder.accessor(np.float32([[0, 0, 0], [0, 0, 0], [0, 5, 0], [0, 0, 0]]))
    weights = np.tile(np.float32([1, 0, 0, 0]), (4, 1))
    primitive = builder.primitive(places, mode=0, JOINTS_0=bound, WEIGHTS_0=weights, targets=[{"POSITION": up}])
    joints = [builder.node(), builder.node()]
    builder.add("skins", {"joints": joints})
    node = builder.node(mesh=builder.mesh(primitive), skin=0)
    channel(builder, [0, 1], [[0, 0, 0], [10, 0, 0]], {"node": joints[1], "path": "translation"})
    channel(builder, [0, 1], [0, 1], {"node": node, "path": "weights"})
    scene = load_gltf(builder.glb(tmp_path))
    posed = at(scene, 1.0).instances[0]
    centres = world(posed).reshape(3, -1, 3).mean(1)
    np.testing.assert_allclose(centres, [[0, 0, 0], [1, 5, 0], [10, 1, 0]], atol=1e-5)


def test_instanced_skins_and_several_primitives(tmp_path):
    """Each copy stands relative to the first joint; the primitives have different numbers of influences."""
    builder = skinned()
    other = builder.primitive(
        TRIANGLE + np.float32([0, 0, 1]),
        JOINTS_0=np.array([[0, 1, 0, 0]] * 3, np.uint8),
        WEIGHTS_0=np.array([[0.5, 0.5, 0, 0]] * 3, np.float32),
    )
    builder.json["meshes"][0]["primitives"].append(other)
    places = builder.accessor(np.array([[0, 0, 0], [0, 5, 0]], np.float32))
    builder.json["nodes"][2]["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": places}}}
    channel(builder, [0, 1], [[0, 1, 0], [0, 4, 0]], {"node": 0, "path": "translation"})
    posed = at(loaded(builder, tmp_path), 1.0)
    expected = np.float32([[100, 0, 0], [101, 0, 0], [100, 4, 0], [100, 1.5, 1], [101, 1.5, 1], [100, 2.5, 1]])
    for instance, y in zip(posed.instances, (0, 5), strict=True):
        np.testing.assert_allclose(world(instance), expected + np.float32([0, y, 0]), atol=1e-5)
    assert posed.instances[0].mesh is posed.instances[1].mesh


# Pointers


def pointed():
    """Return a builder of a scene with all that pointers reach."""
    builder = GltfBuilder()
    strength = {"KHR_materials_emissive_strength": {"emissiveStrength": 4}}
    material = builder.material(emissiveFactor=[1, 0.5, 0], alphaMode="MASK", extensions=strength)
    targets = [{"POSITION": builder.accessor(np.ones((3, 3), np.float32))}] * 2
    mesh = builder.mesh(builder.primitive(material=material, targets=targets), weights=[0.25, 0.5])
    builder.node(mesh=mesh, translation=[0, 0, 1])
    builder.node(mesh=mesh, weights=[0, 0])
    builder.light(type="spot", spot={"outerConeAngle": 0.5}, intensity=2)
    builder.light(type="point", range=3)
    builder.node(camera=builder.add("cameras", {"type": "perspective", "perspective": {"yfov": 1}}))
    builder.node(camera=builder.add("cameras", {"type": "orthographic", "orthographic": {"ymag": 1, "xmag": 1}}))
    return builder


LIGHT = "/extensions/KHR_lights_punctual/lights"
PBR, LAYER = "/materials/0/pbrMetallicRoughness", "/materials/0/extensions/KHR_materials"
STRENGTH = f"{LAYER}_emissive_strength/emissiveStrength"


@pytest.mark.parametrize(
    ("pointer", "values", "field", "expected"),
    [
        (f"{LIGHT}/0/intensity", [2, 6], "lights[0].intensity", 4),
        (f"{LIGHT}/1/color", [[0, 0, 0], [1, 0.5, 0]], "lights[1].color", (0.5, 0.25, 0)),
        (f"{LIGHT}/1/range", [3, 5], "lights[1].range", 4),
        (f"{LIGHT}/0/spot/outerConeAngle", [0.5, 0.7], "lights[0].outer_cone_angle", 0.6),
        (f"{LIGHT}/0/spot/innerConeAngle", [0.0, 0.2], "lights[0].inner_cone_angle", 0.1),
        ("/cameras/0/perspective/yfov", [1, 0.5], "cameras[0].yfov", 0.75),
        ("/cameras/1/orthographic/ymag", [1, 2], "cameras[1].orthographic_height", 3),
        (f"{PBR}/baseColorFactor", [[1] * 4, [0, 1, 0, 1]], "materials[0].base_color", (0.5, 1, 0.5, 1)),
        (f"{PBR}/metallicFactor", [0, 1], "materials[0].metallic", 0.5),
        (f"{PBR}/roughnessFactor", [1, 0], "materials[0].roughness", 0.5),
        ("/materials/0/alphaCutoff", [0, 1], "materials[0].alpha_cutoff", 0.5),
        ("/materials/0/emissiveFactor", [[0, 0, 0], [1, 1, 0]], "materials[0].emission", (2, 2, 0)),
        (STRENGTH, [4, 8], "materials[0].emission", (6, 3, 0)),
        (f"{LAYER}_ior/ior", [1.5, 2], "materials[0].ior", 1.75),
        (f"{LAYER}_clearcoat/clearcoatFactor", [0, 1], "materials[0].clearcoat", 0.5),
        (f"{LAYER}_transmission/transmissionFactor", [0, 1], "materials[0].transmission", 0.5),
        ("/nodes/0/translation", [[0, 0, 0], [2, 0, 0]], "instances[0].world_from_local[0, 3]", 1),
        ("/nodes/1/weights", [0, 0, 1, 1], "instances[1].morph_weights", (0.5, 0.5)),
        ("/nodes/0/weights/1", [0, 1], "instances[0].morph_weights", (0.25, 0.5)),
        ("/meshes/0/weights", [0, 0, 1, 2], "instances[0].morph_weights", (0.5, 1)),
    ],
)
def test_pointers(tmp_path, pointer, values, field, expected):
    builder = pointed()
    builder.json["extensionsUsed"] = ["KHR_animation_pointer"]
    channel(builder, [0, 1], values, pointer)
    scene = loaded(builder, tmp_path)
    assert not scene.notes
    assert eval(f"scene.{field}", {"scene": at(scene, 0.5)}) == pytest.approx(expected)


def test_emission_is_factor_times_strength_of_the_same_time(tmp_path):
    """At 1/2: 0.5 * 6."""
    builder = pointed()
    channel(builder, [0, 1], [[0, 0, 0], [1, 1, 1]], "/materials/0/emissiveFactor")
    channel(builder, [0, 1], [4, 8], STRENGTH)
    assert at(loaded(builder, tmp_path), 0.5).materials[0].emission == pytest.approx((3, 3, 3))


# Damage


def keys(builder, times, values, **sampler):
    channel(builder, times, values, {"node": 0, "path": "translation"}, **sampler)


ROWS = [[0, 0, 0], [1, 0, 0]]
DAMAGE = {
    "missing node": (lambda b: channel(b, [0, 1], ROWS, {"node": 9, "path": "translation"}), "index into nodes"),
    "no target": (lambda b: channel(b, [0, 1], ROWS, {}), "path is missing"),
    "unknown path": (lambda b: channel(b, [0, 1], ROWS, {"node": 0, "path": "visibility"}), "path must be one of"),
    "no pointer": (lambda b: channel(b, [0, 1], ROWS, {"path": "pointer"}), "pointer is missing"),
    "unknown pointer": (lambda b: channel(b, [0, 1], ROWS, "/nodes/0/name"), "'/nodes/0/name' cannot be animated"),
    "other pointer": (lambda b: channel(b, [0, 1], ROWS, "nodes/0/scale"), "cannot be animated"),
    "pointer to nothing": (lambda b: channel(b, [0, 1], [0, 1], f"{LIGHT}/7/intensity"), "aims at light 7"),
    "pointer to a weight": (lambda b: channel(b, [0, 1], [0, 1], "/nodes/0/weights/0"), "morph target 0 of 0"),
    "unsorted": (lambda b: keys(b, [1, 0], ROWS), "must be finite and increase"),
    "NaN time": (lambda b: keys(b, [0, math.nan], ROWS), "must be finite and increase"),
    "NaN value": (lambda b: keys(b, [0, 1], [[0, 0, 0], [math.nan, 0, 0]]), "values must be finite"),
    "far": (lambda b: keys(b, [0, 1], [[0, 0, 0], [1e30, 0, 0]]), "values must be finite, at most"),
    "too few values": (lambda b: keys(b, [0, 1, 2], ROWS), "output must have 3 elements of 3 numbers, not (2, 3)"),
    "too few tangents": (lambda b: keys(b, [0, 1], ROWS, interpolation="CUBICSPLINE"), "must have 6 elements"),
    "wrong width": (lambda b: keys(b, [0, 1], [[0] * 4] * 2), "2 elements of 3 numbers, not (2, 4)"),
    "no keys": (lambda b: keys(b, [], np.zeros((0, 3))), "0 keys"),
    "integers": (lambda b: keys(b, [0, 1], b.accessor(np.ones((2, 3), np.uint8))), "floats or normalized integers"),
    "times in pairs": (lambda b: keys(b, ROWS, ROWS), "input must hold floats"),
    "too many keys": (lambda b: keys(b, np.arange(65537), np.zeros((65537, 3))), "65537 keys"),
    "zero quaternion": (
        lambda b: channel(b, [0, 1], [[0, 0, 0, 1], [0] * 4], {"node": 0, "path": "rotation"}),
        "zero quaternion",
    ),
    "weights without targets": (
        lambda b: channel(b, [0, 1], [0, 1], {"node": 0, "path": "weights"}),
        "mesh without morph targets",
    ),
    "no accessor": (lambda b: keys(b, [0, 1], 99), "index into accessors"),
    "no sampler": (
        lambda b: (keys(b, [0, 1], ROWS), b.json["animations"][0]["channels"][0].update(sampler=4)),
        "index into samplers",
    ),
    "a matrix": (
        lambda b: (keys(b, [0, 1], ROWS), b.json["nodes"][0].update(matrix=np.eye(4).ravel().tolist())),
        "has a matrix",
    ),
    "no object": (lambda b: b.json.update(animations=[7]), "must be a JSON object"),
    "no list": (lambda b: b.json.update(animations=[{"channels": 5}]), "channels must be a list"),
    "strange interpolation": (lambda b: keys(b, [0, 1], ROWS, interpolation="BEZIER"), "interpolation must be one of"),
}


@pytest.mark.parametrize("name", DAMAGE)
def test_a_damaged_channel_is_left_out_with_a_note(tmp_path, name):
    """The others play on; strict loading refuses the file in the same words."""
    break_it, words = DAMAGE[name]
    builder = triangle_scene()
    break_it(builder)
    channel(builder, [0, 1], [[1, 1, 1], [3, 3, 3]], {"node": 0, "path": "scale"}, 1)
    scene = load_gltf(builder.glb(tmp_path))
    check_scene(scene)
    assert any(words in note for note in scene.notes), scene.notes
    size = 1.0 if name == "a matrix" else 2.0
    if name == "a matrix":
        assert not scene.animations
    else:
        assert np.abs(world(at(scene, 0.5, len(scene.animations) - 1).instances[0])).max() == pytest.approx(size)
    with pytest.raises(GiError, match="strict"):
        load_gltf(builder.glb(tmp_path), notes=Notes(strict=True))


def test_a_channel_without_a_node_is_for_extensions(tmp_path):
    builder = triangle_scene()
    channel(builder, [0, 1], ROWS, {"path": "translation"})
    scene = loaded(builder, tmp_path)
    assert not scene.animations and "has no node; the channel was left out" in scene.notes[0]


def test_of_two_channels_with_one_target_the_first_plays(tmp_path):
    builder = morphing()
    channel(builder, [0, 1], ROWS, {"node": 0, "path": "translation"})
    channel(builder, [0, 1], [[5, 5, 5]] * 2, "/nodes/0/translation")
    channel(builder, [0, 1], [0, 0, 1, 1], {"node": 0, "path": "weights"})
    channel(builder, [0, 1], [0, 9], "/nodes/0/weights/1")
    scene = load_gltf(builder.glb(tmp_path))
    posed = at(scene, 1.0).instances[0]
    assert posed.world_from_local[0, 3] == 1 and posed.morph_weights == (1, 1)
    assert sum("same target" in note for note in scene.notes) == 2


def test_a_skin_whose_joints_are_wrong_leaves_the_mesh_at_its_node(tmp_path):
    """A joint out of range costs the skin; one on a cycle of nodes is a root."""
    builder = skinned()
    channel(builder, [0, 1], [[0, 1, 0], [0, 4, 0]], {"node": 0, "path": "translation"})
    builder.json["skins"][0]["joints"] = [0, 99]
    scene = load_gltf(builder.glb(tmp_path))
    np.testing.assert_allclose(world(at(scene, 1).instances[0]), TRIANGLE + np.float32([7, 7, 7]))
    builder.json["skins"][0]["joints"] = [1, 0]
    builder.json["nodes"][0]["children"] = [1]
    scene = load_gltf(builder.glb(tmp_path))
    assert any("cycle" in note for note in scene.notes)
    at(scene, 1)


def test_joints_out_of_range_in_vertices(tmp_path):
    builder = skinned()
    builder.json["skins"][0]["joints"] = [1]
    channel(builder, [0, 1], [[0, 0, 0], [5, 0, 0]], {"node": 1, "path": "translation"})
    scene = load_gltf(builder.glb(tmp_path))
    assert any("refers to joint 1 of 1" in note for note in scene.notes)
    at(scene, 1)


def test_displacements_that_are_not_finite_are_zero(tmp_path):
    builder = morphing()
    bad = builder.accessor(np.float32([[np.nan, 0, 0], [0, 1, 0], [0, np.inf, 0]]))
    builder.json["meshes"][0]["primitives"][0]["targets"] = [{"POSITION": bad}, {"POSITION": 77}]
    channel(builder, [0, 1], [0, 0, 1, 1], {"node": 0, "path": "weights"})
    scene = load_gltf(builder.glb(tmp_path))
    assert any("2 values of POSITION" in note for note in scene.notes)
    np.testing.assert_allclose(
        world(at(scene, 1).instances[0]), TRIANGLE + np.float32([[0, 0, 0], [0, 1, 0], [0, 0, 0]])
    )
