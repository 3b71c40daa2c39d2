"""The glTF reader on damaged and hostile files: a GiError with the place, or a note, never another exception."""

from __future__ import annotations

import copy
import json
import os
import random
import time
import zlib

import numpy as np
import pytest
from unit.gltf_builder import TRIANGLE, GltfBuilder, encode, glb_bytes, triangle_scene

from wgpu_gi.errors import GiError
from wgpu_gi.scene.gltf.load import load_gltf
from wgpu_gi.scene.scene import Scene


def message(path):
    """Load a file that must raise GiError within a second; return the message."""
    start = time.perf_counter()
    with pytest.raises(GiError) as caught:
        load_gltf(path)
    assert time.perf_counter() - start < 1.0
    text = str(caught.value)
    assert "\n" not in text and path.name in text and len(text) < 400
    return text


def write(tmp_path, data, name="scene.glb"):
    path = tmp_path / name
    path.write_bytes(data)
    return path


def full_builder():
    """Return a builder that uses every part of the format, to be damaged."""
    builder = GltfBuilder()
    texture = builder.texture(np.zeros((4, 4, 3), np.uint8), {"wrapS": 33071})
    transform = {"KHR_texture_transform": {"offset": [0, 0.5], "rotation": 1}}
    material = builder.material(
        name="m",
        pbrMetallicRoughness={"baseColorFactor": [1, 1, 1, 1], "baseColorTexture": {"index": texture}},
        normalTexture={"index": texture, "extensions": transform},
        emissiveFactor=[1, 1, 1],
        alphaMode="MASK",
        extensions={"KHR_materials_emissive_strength": {"emissiveStrength": 2}},
    )
    primitive = builder.primitive(
        TRIANGLE,
        np.array([0, 1, 2], np.uint16),
        material=material,
        NORMAL=np.ones((3, 3), np.float32),
        TEXCOORD_0=np.zeros((3, 2), np.float32),
        COLOR_0=np.ones((3, 4), np.float32),
        JOINTS_0=np.zeros((3, 4), np.uint8),
        WEIGHTS_0=np.ones((3, 4), np.float32),
    )
    builder.json["accessors"][0]["sparse"] = {
        "count": 1,
        "indices": {"bufferView": builder.view(b"\1\0\0\0"), "componentType": 5121},
        "values": {"bufferView": builder.view(np.ones(3, np.float32).tobytes())},
    }
    mesh = builder.mesh(primitive, name="shape")
    child = builder.node(root=False, mesh=mesh, name="child", scale=[1, 2, 1])
    builder.node(mesh=mesh, rotation=[0, 0, 0, 1], translation=[1, 2, 3], children=[child])
    builder.add(
        "skins", {"joints": [child], "inverseBindMatrices": builder.accessor(np.eye(4, dtype="f4").reshape(1, 16))}
    )
    builder.node(mesh=mesh, skin=0)
    builder.light(type="spot", spot={"outerConeAngle": 0.5}, intensity=2, color=[1, 1, 1])
    camera = builder.add("cameras", {"type": "perspective", "perspective": {"yfov": 1}})
    builder.node(camera=camera, matrix=np.eye(4).ravel().tolist())
    builder.node(mesh=builder.mesh(builder.primitive(mode=5), builder.primitive()))
    return builder


# The container


def test_missing_folder_and_empty_files(tmp_path):
    assert "does not exist" in message(tmp_path / "nothing.glb")
    (tmp_path / "folder.gltf").mkdir()
    assert "folder" in message(tmp_path / "folder.gltf")
    assert "empty" in message(write(tmp_path, b""))


def test_truncation_at_every_length_raises(tmp_path):
    data = triangle_scene().glb_bytes()
    for length in range(len(data)):
        message(write(tmp_path, data[:length]))
    assert "truncated" in message(write(tmp_path, data[:-1]))


@pytest.mark.parametrize(
    ("data", "problem"),
    [
        (glb_bytes(b"{}", magic=b"PK\3\4"), "does not begin with 'glTF'"),
        (glb_bytes(b"{}", version=1), "version 1"),
        (glb_bytes(b"{"), "not valid JSON"),
        (glb_bytes(b"\xff\xfe"), "not valid JSON"),
        (glb_bytes(b"[" * 100000), "not valid JSON"),
        (glb_bytes(b"[]"), "not an object"),
        (glb_bytes(b'{"a": 1}'), "no asset.version"),
        (glb_bytes(b'{"asset": {"version": "1.0"}}'), "'1.0'"),
        (glb_bytes(b'{"asset": {"version": "2.1", "minVersion": "2.1"}}'), "minVersion"),
        (glb_bytes(b'{"asset": {"version": 2}}'), "must be a string, not 2"),
        (glb_bytes(b'{"asset": []}'), "must be a JSON object"),
        (glb_bytes(b'{"asset": {"version": "2.0"}}'), "no meshes"),
        (glb_bytes(b'{"asset": {"version": "2.0"}, "nodes": 3}'), "nodes must be a list"),
        (glb_bytes(b'{"asset": {"version": "2.0"}, "nodes": [3]}'), "nodes[0] must be a JSON object"),
    ],
)
def test_wrong_containers(tmp_path, data, problem):
    assert problem in message(write(tmp_path, data))


def test_required_extensions_are_named(tmp_path):
    builder = triangle_scene()
    builder.json["extensionsRequired"] = ["KHR_texture_basisu", "ACME_secret"]
    text = message(builder.glb(tmp_path))
    assert "KHR_texture_basisu" in text and "ACME_secret" in text


def test_files_without_triangles_raise(tmp_path):
    builder = GltfBuilder()
    builder.light(type="point")
    assert "no meshes" in message(builder.glb(tmp_path))
    builder.node(mesh=builder.mesh(builder.primitive(mode=1)))
    assert "no triangles" in message(builder.glb(tmp_path))


# Announced sizes without data


def test_accessor_past_its_view(tmp_path):
    builder = triangle_scene()
    builder.json["accessors"][0]["count"] = 40
    text = message(builder.glb(tmp_path))
    assert "accessors[0]: reads past the end of bufferView 0 (needs 480 bytes, has 36)" in text


@pytest.mark.parametrize(("count", "problem"), [(10**12, "past the end"), (10**30, "count must be"), (1e300, "count")])
def test_huge_counts(tmp_path, count, problem):
    builder = triangle_scene()
    builder.json["accessors"][0]["count"] = count
    assert problem in message(builder.glb(tmp_path))


def test_huge_count_without_any_data(tmp_path):
    builder = triangle_scene()
    builder.json["accessors"][0]["count"] = 10**9
    del builder.json["accessors"][0]["bufferView"]
    assert "count 1000000000 is not backed by any data" in message(builder.glb(tmp_path))


def test_huge_buffer_and_sparse_count(tmp_path):
    builder = full_builder()
    builder.json["accessors"][0]["sparse"]["count"] = 10**12
    assert "count must be an integer between 1 and 3" in message(builder.glb(tmp_path))
    path = triangle_scene().gltf(tmp_path)
    document = json.loads(path.read_text())
    document["buffers"][0]["byteLength"] = 10**10
    path.write_text(json.dumps(document))
    assert "buffers[0]: byteLength is 10000000000, but its data has 36" in message(path)


# Wrong values


def edits():
    """Return (path into the JSON, wrong value, what the message must say)."""
    return [
        (("scene",), 7, "scene must be an index into scenes"),
        (("scenes", 0, "nodes", 0), 99, "nodes[0] must be an index into nodes (there are"),
        (("nodes", 1, "mesh"), 5, "nodes[1]: mesh must be an index into meshes (there are 2), not 5"),
        (("nodes", 1, "mesh"), "0", "mesh must be an index into meshes (there are 2), not '0'"),
        (("nodes", 1, "mesh"), -1, "not -1"),
        (("nodes", 1, "mesh"), True, "not True"),
        (("nodes", 1, "children"), 0, "children must be a list"),
        (("nodes", 1, "translation"), [1, 2], "translation must be 3 finite numbers"),
        (("nodes", 1, "translation"), [1, 2, float("nan")], "translation must be 3 finite numbers"),
        (("nodes", 1, "translation"), [1, 2, 1e20], "out of range"),
        (("nodes", 1, "rotation"), [0, 0, 0, 0], "zero quaternion"),
        (("nodes", 1, "name"), 5, "name must be a string"),
        (("nodes", 2, "skin"), 1, "skin must be an index into skins"),
        (("skins", 0, "joints"), [], "no joints"),
        (("skins", 0, "joints"), [77], "joints[0] must be an index into nodes"),
        (("nodes", 4, "matrix"), [0] * 15 + [2], "not affine"),
        (("nodes", 4, "camera"), 1, "camera must be an index into cameras"),
        (("cameras", 0, "type"), "fisheye", "type must be one of perspective, orthographic"),
        (("cameras", 0, "perspective", "yfov"), 0, "yfov must be a finite number between"),
        (("cameras", 0, "perspective", "yfov"), 3.15, "yfov"),
        (("cameras", 0, "perspective"), {}, "yfov is missing"),
        (("meshes", 0, "primitives"), {}, "primitives must be a list"),
        (("meshes", 0, "primitives", 0, "mode"), 7, "mode must be an integer between 0 and 6"),
        (("meshes", 0, "primitives", 0, "material"), 1, "material must be an index into materials"),
        (("meshes", 0, "primitives", 0, "indices"), 50, "indices must be an index into accessors"),
        (("meshes", 0, "primitives", 0, "indices"), 0, "indices must be unsigned integers"),
        (("meshes", 0, "primitives", 0, "attributes", "POSITION"), 99, "POSITION must be an index into accessors"),
        (("meshes", 0, "primitives", 0, "attributes", "NORMAL"), 2, "NORMAL must have 3 components"),
        (("accessors", 0, "count"), -3, "count must be an integer of at least 1, not -3"),
        (("accessors", 0, "count"), 2.5, "count must be an integer"),
        (("accessors", 0, "type"), "VEC5", "type must be one of"),
        (("accessors", 0, "componentType"), 5124, "componentType must be one of"),
        (("accessors", 0, "byteOffset"), -4, "byteOffset"),
        (("accessors", 0, "bufferView"), 99, "bufferView must be an index into bufferViews"),
        (("accessors", 0, "normalized"), 1, "normalized must be true or false"),
        (("accessors", 0, "sparse", "indices", "componentType"), 5126, "componentType"),
        (("accessors", 1, "count"), 2, "has 2 elements for 3 positions"),
        (("bufferViews", 2, "byteLength"), 10**9, "past the end of buffer 0"),
        (("bufferViews", 2, "byteStride"), 4, "byteStride 4 is less than one element"),
        (("bufferViews", 2, "buffer"), 1, "buffer must be an index into buffers"),
        (("buffers", 0, "byteLength"), "many", "byteLength must be an integer"),
        (("materials", 0, "emissiveFactor"), [-1, 0, 0], "emissiveFactor must be 3 finite numbers of at least 0"),
        (("materials", 0, "alphaMode"), "FADE", "alphaMode must be one of OPAQUE, MASK, BLEND"),
        (("materials", 0, "normalTexture", "index"), 4, "index must be an index into textures"),
        (("materials", 0, "normalTexture"), {}, "index is missing"),
        (("materials", 0, "doubleSided"), "yes", "doubleSided must be true or false"),
        (("materials", 0, "pbrMetallicRoughness", "metallicFactor"), None, "metallicFactor must be a finite number"),
        (("textures", 0, "source"), 1, "source must be an index into images"),
        (("textures", 0, "sampler"), 1, "sampler must be an index into samplers"),
        (("samplers", 0, "wrapS"), 5, "wrapS must be one of 10497, 33071, 33648"),
        (("images", 0, "bufferView"), 99, "bufferView must be an index"),
        (("extensions", "KHR_lights_punctual", "lights", 0, "type"), "laser", "lights[0]: type must be one of"),
        (("extensions", "KHR_lights_punctual", "lights", 0, "intensity"), -1, "lights[0]: intensity"),
        (("extensions", "KHR_lights_punctual", "lights", 0, "intensity"), float("nan"), "lights[0]: intensity"),
        (("extensions", "KHR_lights_punctual", "lights", 0, "color"), [1, -1, 1], "lights[0]: color"),
        (("extensions", "KHR_lights_punctual", "lights", 0, "spot", "outerConeAngle"), 3, "outerConeAngle"),
        (("nodes", 3, "extensions", "KHR_lights_punctual", "light"), 1, "light must be an index into lights"),
    ]


@pytest.mark.parametrize(
    ("path", "value", "problem"), edits(), ids=lambda v: ".".join(map(str, v)) if isinstance(v, tuple) else None
)
def test_wrong_values_are_named(tmp_path, path, value, problem):
    builder = full_builder()
    builder.glb_bytes()  # fills in the buffer's length, which the edit may change again
    target = builder.json
    for key in path[:-1]:
        target = target[key]
    target[path[-1]] = value
    data = glb_bytes(json.dumps(builder.json).encode(), bytes(builder.data))
    assert problem in message(write(tmp_path, data))


def test_index_beyond_the_vertices(tmp_path):
    builder = GltfBuilder()
    builder.node(mesh=builder.mesh(builder.primitive(indices=np.array([0, 1, 3], np.uint8))))
    assert "meshes[0].primitives[0]: index 3 is beyond its 3 vertices" in message(builder.glb(tmp_path))


def test_sparse_index_beyond_the_elements(tmp_path):
    builder = full_builder()
    view = builder.json["accessors"][0]["sparse"]["indices"]["bufferView"]
    builder.data[builder.json["bufferViews"][view]["byteOffset"]] = 3
    assert "index 3 is beyond the 3 elements" in message(builder.glb(tmp_path))


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e30])
def test_bad_vertices_name_mesh_and_vertex(tmp_path, value):
    builder = GltfBuilder()
    positions = np.concatenate([TRIANGLE + 5, TRIANGLE])
    positions[4, 1] = value
    builder.node(mesh=builder.mesh(builder.primitive(positions, np.array([3, 4, 5], np.uint8)), name="chair"))
    text = message(builder.glb(tmp_path))
    assert "'chair'" in text and "vertex 4" in text


def test_bad_normals_become_flat_with_a_note(tmp_path):
    builder = GltfBuilder()
    normals = np.array([[0, 0, 1], [np.nan, 0, 0], [0, np.inf, 0]], np.float32)
    builder.node(mesh=builder.mesh(builder.primitive(NORMAL=normals)))
    scene = load_gltf(builder.glb(tmp_path))
    np.testing.assert_array_equal(scene.meshes[0].normals, [[0, 0, 1], [0, 0, 0], [0, 0, 0]])
    assert "2 values of NORMAL" in scene.notes[0]


# The node graph


def test_cycles_and_two_parents(tmp_path):
    builder = triangle_scene()
    builder.json["nodes"] += [{"children": [2]}, {"children": [1]}]
    assert "cycle" in message(builder.glb(tmp_path))
    builder.json["nodes"][1:] = [{"children": [1]}]
    assert "cycle" in message(builder.glb(tmp_path))
    builder.json["nodes"][1:] = [{"children": [0]}, {"children": [0]}]
    assert "child of both nodes[1] and nodes[2]" in message(builder.glb(tmp_path))
    builder.json["nodes"][1:] = [{"children": [0]}]
    assert "not a root" in message(builder.glb(tmp_path))
    builder.json["nodes"][1:] = []
    builder.json["scenes"][0]["nodes"] = [0, 0]
    assert "twice" in message(builder.glb(tmp_path))


def test_very_deep_hierarchy(tmp_path):
    builder = triangle_scene()
    depth = 20000
    builder.json["nodes"] += [{"children": [i + 1], "translation": [1, 0, 0]} for i in range(1, depth)]
    builder.node(root=False, mesh=0)
    builder.json["scenes"][0]["nodes"].append(1)
    scene = load_gltf(builder.glb(tmp_path))
    assert scene.instances[1].world_from_local[0, 3] == depth - 1


# Files outside the folder, images


@pytest.mark.parametrize(
    "uri",
    [
        "../secret.bin",
        "sub/../../secret.bin",
        "%2e%2e/secret.bin",
        "..\\secret.bin",
        "/etc/passwd",
        "//host/share",
        "file:///etc/passwd",
        "http://example.org/a.bin",
        "C:\\a.bin",
        "link.bin",
        "folder_link/secret.bin",
    ],
)
def test_paths_may_not_leave_the_folder(tmp_path, uri):
    folder = tmp_path / "scene"
    (folder / "sub").mkdir(parents=True)
    (tmp_path / "secret.bin").write_bytes(bytes(100))
    os.symlink(tmp_path / "secret.bin", folder / "link.bin")
    os.symlink(tmp_path, folder / "folder_link")
    builder = triangle_scene()
    path = builder.gltf(folder)
    document = json.loads(path.read_text())
    document["buffers"][0]["uri"] = uri
    path.write_text(json.dumps(document))
    assert "leaves the scene's folder" in message(path)
    builder = full_builder()
    builder.json["images"][0] = {"uri": uri}
    assert "leaves the scene's folder" in message(builder.glb(folder))


@pytest.mark.parametrize("uri", ["missing.bin", "", ".", "a\0b", "x" * 5000, "data:;base64,@@@", "data:nothing"])
def test_unusable_buffer_uris(tmp_path, uri):
    path = triangle_scene().gltf(tmp_path)
    document = json.loads(path.read_text())
    document["buffers"][0]["uri"] = uri
    path.write_text(json.dumps(document))
    message(path)


def test_image_of_absurd_size_is_left_out_undecoded(tmp_path):
    png = bytearray(encode(np.zeros((1, 1, 3), np.uint8)))
    for side in (9000, 100000):
        png[16:24] = side.to_bytes(4, "big") * 2
        png[29:33] = zlib.crc32(png[12:29]).to_bytes(4, "big")
        builder = full_builder()
        builder.json["images"][0] = {"bufferView": builder.view(bytes(png))}
        scene = load_gltf(builder.glb(tmp_path))
        assert scene.materials[0].base_color_texture is None
        assert any("pixels" in note for note in scene.notes)


# Random damage


def is_scene_or_error(path):
    """Load a file; it must take less than a second and give a scene or a GiError."""
    start = time.perf_counter()
    try:
        scene = load_gltf(path)
        assert isinstance(scene, Scene) and scene.instances
        assert all(np.isfinite(m.positions).all() and m.triangles.max() < len(m.positions) for m in scene.meshes)
        assert np.isfinite(scene.bounds()).all()
    except GiError as error:
        assert str(error)
    assert time.perf_counter() - start < 1.0


def mutated(value, rng):
    """Return a copy of a JSON value with one random part replaced."""
    strange = [None, True, -1, 0, 1, 7, 2.5, 1e300, 10**30, float("nan"), "", "x", [], {}, [0], [None] * 3, {"a": []}]
    value = copy.deepcopy(value)
    target = value
    while True:
        keys = list(target) if isinstance(target, dict) else list(range(len(target)))
        key = rng.choice(keys)
        if isinstance(target[key], dict | list) and target[key] and rng.random() < 0.9:
            target = target[key]
        elif rng.random() < 0.2:
            del target[key]
            return value
        else:
            target[key] = rng.choice(strange)
            return value


def test_random_json_changes(tmp_path):
    builder = full_builder()
    builder.glb_bytes()
    rng = random.Random(1)
    for _ in range(400):
        text = json.dumps(mutated(builder.json, rng)).encode()
        is_scene_or_error(write(tmp_path, glb_bytes(text, bytes(builder.data))))


def test_random_bytes(tmp_path):
    data = full_builder().glb_bytes()
    rng = random.Random(2)
    for _ in range(400):
        damaged = bytearray(data)
        for _ in range(rng.choice((1, 4, 16))):
            damaged[rng.randrange(len(damaged))] = rng.randrange(256)
        is_scene_or_error(write(tmp_path, bytes(damaged)))
