"""The glTF reader on damaged and hostile files: a note and what is left, or a GiError; never another exception."""

from __future__ import annotations

import copy
import json
import os
import random
import time
import zlib

import numpy as np
import pytest
from unit.gltf_builder import TRIANGLE, GltfBuilder, corners, encode, glb_bytes, triangle_scene

from wgpu_gi.errors import GiError
from wgpu_gi.scene.files.notes import Notes
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


def noted(path):
    """Load a file that is damaged: strict loading refuses it with a note of the scene that is returned."""
    scene = load_gltf(path)
    with pytest.raises(GiError) as caught:
        load_gltf(path, notes=Notes(strict=True))
    refused = str(caught.value)
    assert "--strict" in refused and "\n" not in refused
    assert any(refused.startswith(note.rstrip(".")) for note in scene.notes), (refused, scene.notes)
    return scene


def shown(scene):
    """Return the numbers of triangles, lights and cameras of a scene."""
    return scene.triangle_count, len(scene.lights), len(scene.cameras)


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
        (glb_bytes(b'{"asset": {"version": 1}}'), "no asset.version"),
        (glb_bytes(b'{"asset": []}'), "no asset.version"),
        (glb_bytes(b'{"asset": {"version": "2.0"}}'), "no meshes"),
        (glb_bytes(b'{"asset": {"version": "2.0"}, "nodes": 3}'), "nodes must be a list"),
        (glb_bytes(b'{"asset": {"version": "2.0"}, "nodes": [3]}'), "nodes[0] must be a JSON object"),
    ],
)
def test_wrong_containers(tmp_path, data, problem):
    assert problem in message(write(tmp_path, data))


def test_required_extensions_that_are_unknown_are_noted(tmp_path):
    builder = triangle_scene()
    builder.json["extensionsRequired"] = builder.json["extensionsUsed"] = ["KHR_materials_iridescence", "ACME_secret"]
    surface, secret = sorted(noted(builder.glb(tmp_path)).notes, key=lambda note: "ACME_secret" in note)
    assert "requires 'KHR_materials_iridescence', not supported" in surface and "requires 'ACME_secret'" in secret
    builder.json["extensionsRequired"] = builder.json["extensionsUsed"] = ["KHR_materials_iridescence"]
    assert load_gltf(builder.glb(tmp_path), notes=Notes(strict=True)).notes == [surface]


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
    scene = noted(builder.glb(tmp_path))
    assert "count must be an integer between 0 and 3" in scene.notes[0] and shown(scene) == (2, 1, 1)
    path = triangle_scene().gltf(tmp_path)
    document = json.loads(path.read_text())
    document["buffers"][0]["byteLength"] = 10**10
    path.write_text(json.dumps(document))
    assert "buffers[0]: byteLength is 10000000000, but its data has 36" in message(path)


# Wrong values


ALL = (5, 1, 1)  # triangles, lights and cameras of the undamaged file
NO_SHAPE = (2, 1, 1)  # without the first mesh, which three nodes show


def edits():
    """Return (path into the JSON, wrong value, what the note says, triangles, lights and cameras that are left)."""
    primitive = ("meshes", 0, "primitives", 0)
    light = ("extensions", "KHR_lights_punctual", "lights", 0)
    return [
        # Scenes and nodes.
        (("scene",), 7, "scene must be an index into scenes", ALL),
        (("scene",), "hello", "scene must be an index into scenes", ALL),
        (("scenes", 0, "name"), 42, "name must be a string, not 42; it was ignored", ALL),
        (("scenes", 0, "nodes", 0), 99, "nodes[0] must be an index into nodes (there are", (3, 1, 1)),
        (("nodes", 1, "mesh"), 5, "nodes[1]: mesh must be an index into meshes (there are 2), not 5", (4, 1, 1)),
        (("nodes", 1, "mesh"), "0", "mesh must be an index into meshes (there are 2), not '0'", (4, 1, 1)),
        (("nodes", 1, "mesh"), -1, "not -1", (4, 1, 1)),
        (("nodes", 1, "mesh"), True, "not True", (4, 1, 1)),
        (("nodes", 1, "children"), 0, "children must be a list", (4, 1, 1)),
        (("nodes", 1, "children"), [0, 99], "children[1] must be an index into nodes", ALL),
        (("nodes", 1, "translation"), [1, 2], "translation must be 3 finite numbers", ALL),
        (("nodes", 1, "translation"), [1, 2, float("nan")], "translation must be 3 finite numbers", ALL),
        (("nodes", 1, "translation"), [1, 2, 1e20], "out of range", (3, 1, 1)),
        (("nodes", 1, "rotation"), [0, 0, 0, 0], "zero quaternion", ALL),
        (("nodes", 1, "name"), 5, "name must be a string", ALL),
        (("nodes", 1, "extensions"), "none", "extensions must be a JSON object", ALL),
        (("nodes", 4, "matrix"), [0] * 15 + [2], "not affine", (5, 1, 0)),
        # Skins: the mesh is shown without.
        (("nodes", 2, "skin"), 1, "skin must be an index into skins", ALL),
        (("skins", 0, "joints"), [], "no joints; the mesh is shown without its skin", ALL),
        (("skins", 0, "joints"), [77], "joints[0] must be an index into nodes", ALL),
        (("skins", 0, "inverseBindMatrices"), 0, "inverseBindMatrices must hold 1 MAT4", ALL),
        ((*primitive, "attributes", "JOINTS_0"), 0, "JOINTS_0 and WEIGHTS_0 must hold 4 values", ALL),
        # Cameras and lights.
        (("nodes", 4, "camera"), 1, "camera must be an index into cameras", (5, 1, 0)),
        (("cameras", 0, "type"), "fisheye", "type must be one of perspective, orthographic", (5, 1, 0)),
        (("cameras", 0, "perspective", "yfov"), 0, "yfov must be a finite number between", (5, 1, 0)),
        (("cameras", 0, "perspective", "yfov"), 3.15, "yfov", (5, 1, 0)),
        (("cameras", 0, "perspective"), {}, "yfov is missing", (5, 1, 0)),
        (
            ("nodes", 3, "extensions", "KHR_lights_punctual", "light"),
            1,
            "light must be an index into lights",
            (5, 0, 1),
        ),
        ((*light, "type"), "laser", "lights[0]: type must be one of", (5, 0, 1)),
        ((*light, "intensity"), -1, "lights[0]: intensity", (5, 0, 1)),
        ((*light, "intensity"), float("nan"), "lights[0]: intensity", ALL),
        ((*light, "color"), [1, -1, 1], "lights[0]: intensity times color", (5, 0, 1)),
        ((*light, "spot", "outerConeAngle"), 3, "outerConeAngle", ALL),
        ((*light, "spot"), "wide", "lights[0].spot must be a JSON object", ALL),
        # Primitives: without positions or indices they are left out, without another attribute they are shown.
        (("meshes", 0, "primitives"), {}, "primitives must be a list", NO_SHAPE),
        ((*primitive, "mode"), 7, "mode must be an integer between 0 and 6", NO_SHAPE),
        ((*primitive, "material"), 1, "material must be an index into materials", ALL),
        ((*primitive, "indices"), 50, "indices must be an index into accessors", NO_SHAPE),
        ((*primitive, "indices"), 0, "indices must be unsigned integers", NO_SHAPE),
        ((*primitive, "attributes", "POSITION"), 99, "POSITION must be an index into accessors", NO_SHAPE),
        ((*primitive, "attributes"), [1], "attributes must be a JSON object", NO_SHAPE),
        ((*primitive, "attributes", "NORMAL"), 2, "NORMAL must have 3 components", ALL),
        (("meshes", 1, "primitives", 0), None, "primitives[0] must be a JSON object, not None", (4, 1, 1)),
        # Accessors and buffers: so are the primitives and attributes that they have the data of.
        (("accessors", 0), [], "accessors[0] must be a JSON object", NO_SHAPE),
        (("accessors", 0, "count"), -3, "count must be an integer of at least 0, not -3", NO_SHAPE),
        (("accessors", 0, "count"), 2.5, "count must be an integer", NO_SHAPE),
        (("accessors", 0, "type"), "VEC5", "type must be one of", NO_SHAPE),
        (("accessors", 0, "componentType"), 5124, "componentType must be one of", NO_SHAPE),
        (("accessors", 0, "byteOffset"), -4, "byteOffset", NO_SHAPE),
        (("accessors", 0, "bufferView"), 99, "bufferView must be an index into bufferViews", NO_SHAPE),
        (("accessors", 0, "normalized"), 1, "normalized must be true or false", ALL),
        (("accessors", 0, "sparse", "indices", "componentType"), 5126, "componentType", NO_SHAPE),
        (("accessors", 1, "count"), 2, "has 2 elements for 3 positions", ALL),
        (("accessors", 1, "count"), 0, "has 0 elements for 3 positions", ALL),
        (("bufferViews", 2, "byteStride"), 4, "byteStride 4 is less than one element", ALL),
        (("bufferViews", 2, "buffer"), 1, "buffer must be an index into buffers", ALL),
        # Materials and textures.
        (("materials", 0), 3, "materials[0] must be a JSON object, not 3", ALL),
        (("materials", 0, "pbrMetallicRoughness"), ["red"], "pbrMetallicRoughness must be a JSON object", ALL),
        (("materials", 0, "emissiveFactor"), [-1, 0, 0], "emissiveFactor must be 3 finite numbers of at least 0", ALL),
        (("materials", 0, "alphaMode"), "FADE", "alphaMode must be one of OPAQUE, MASK, BLEND", ALL),
        (("materials", 0, "normalTexture", "index"), 4, "index must be an index into textures", ALL),
        (("materials", 0, "normalTexture"), {}, "index is missing", ALL),
        (("materials", 0, "normalTexture", "extensions", "KHR_texture_transform"), 1, "must be a JSON object", ALL),
        (("materials", 0, "doubleSided"), "yes", "doubleSided must be true or false", ALL),
        (("materials", 0, "pbrMetallicRoughness", "metallicFactor"), None, "metallicFactor is null", ALL),
        (("textures", 0, "source"), 1, "source must be an index into images", ALL),
        (("textures", 0, "sampler"), 1, "sampler must be an index into samplers", ALL),
        (("samplers", 0, "wrapS"), 5, "wrapS must be one of 10497, 33071, 33648", ALL),
        (("images", 0, "bufferView"), 99, "bufferView must be an index", ALL),
        # Lists of extensions.
        (("extensionsUsed",), [1, "KHR_materials_unlit"], "extensionsUsed must be a list of names", ALL),
        (("extensions",), [], "root.extensions must be a JSON object", (5, 0, 1)),
        (("asset", "version"), 2.0, "version must be the text '2.0'", ALL),
    ]


def damaged(tmp_path, path, value):
    """Write the full file with one value of its JSON replaced."""
    builder = full_builder()
    builder.glb_bytes()  # fills in the buffer's length, which the edit may change again
    target = builder.json
    for key in path[:-1]:
        target = target[key]
    target[path[-1]] = value
    return write(tmp_path, glb_bytes(json.dumps(builder.json).encode(), bytes(builder.data)))


@pytest.mark.parametrize(
    ("path", "value", "problem", "left"), edits(), ids=lambda v: ".".join(map(str, v)) if isinstance(v, tuple) else None
)
def test_damage_costs_its_part_and_is_noted(tmp_path, path, value, problem, left):
    scene = noted(damaged(tmp_path, path, value))
    assert any(problem in note for note in scene.notes), scene.notes
    assert shown(scene) == left


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("nodes", 1, "extras"), [1, {"a": None}]),
        (("unknown",), {"count": -1}),
        (("skins", 0, "skeleton"), "root"),
        (("cameras", 0, "perspective", "aspectRatio"), -1),
        (("accessors", 0, "max"), "high"),
        (("buffers", 0, "byteLength"), 436),
        (("extensions", "KHR_lights_punctual", "lights", 0, "spot", "outerConeAngle"), 1.5708),
    ],
)
def test_what_is_not_shown_may_hold_anything(tmp_path, path, value):
    scene = load_gltf(damaged(tmp_path, path, value), notes=Notes(strict=True))
    assert shown(scene) == ALL


def test_broken_parts_that_nothing_refers_to_do_not_matter(tmp_path):
    builder = full_builder()
    for key in ("meshes", "materials", "textures", "images", "samplers", "skins", "cameras"):
        builder.add(key, {"name": "unused", "primitives": [{"attributes": {"POSITION": 999}}], "joints": 3})
    builder.add("accessors", {"bufferView": 0, "count": 10**9, "type": "VEC3", "componentType": 5126})
    builder.add("bufferViews", {"buffer": 0, "byteLength": 10**9})
    builder.add("buffers", {"uri": "missing.bin", "byteLength": 10})
    assert shown(load_gltf(builder.glb(tmp_path), notes=Notes(strict=True))) == ALL


@pytest.mark.parametrize(
    ("path", "value", "problem"),
    [
        (("bufferViews", 2, "byteLength"), 10**9, "bufferViews[2]: reads past the end of buffer 0"),
        (("buffers", 0, "byteLength"), 10**9, "the file is truncated"),
        (("accessors", 0, "byteOffset"), 1000, "reads past the end of bufferView"),
        (("asset", "version"), "", "no asset.version"),
    ],
)
def test_bytes_that_cannot_be_trusted_are_refused(tmp_path, path, value, problem):
    assert problem in message(damaged(tmp_path, path, value))


def test_a_missing_buffer_costs_its_primitives(tmp_path):
    builder = triangle_scene()
    away = builder.add("buffers", {"uri": "away.bin", "byteLength": 36})
    view = builder.add("bufferViews", {"buffer": away, "byteLength": 36})
    positions = builder.add("accessors", {"bufferView": view, "count": 3, "type": "VEC3", "componentType": 5126})
    builder.json["meshes"][0]["primitives"].append({"attributes": {"POSITION": positions}})
    scene = noted(builder.glb(tmp_path))
    assert scene.triangle_count == 1 and "'away.bin' is missing or empty" in scene.notes[0]


def test_many_similar_notes_are_counted(tmp_path):
    builder = triangle_scene()
    builder.json["nodes"] += [{"name": k, "mesh": 0} for k in range(50)]
    builder.json["scenes"][0]["nodes"] += list(range(1, 51))
    names = [note for note in load_gltf(builder.glb(tmp_path)).notes if "name must be a string" in note]
    assert len(names) == 3 and names[-1].endswith("(and 47 more such notes)")


def test_triangles_with_an_index_beyond_the_vertices_are_left_out(tmp_path):
    builder = GltfBuilder()
    indices = np.array([0, 1, 3, 0, 1, 2, 255, 0, 1], np.uint8)
    builder.node(mesh=builder.mesh(builder.primitive(indices=indices)))
    scene = noted(builder.glb(tmp_path))
    assert "index 255 is beyond its 3 vertices; 2 of 3 triangles were left out" in scene.notes[0]
    np.testing.assert_array_equal(corners(scene.meshes[0]), [TRIANGLE])


def test_sparse_index_beyond_the_elements(tmp_path):
    builder = full_builder()
    view = builder.json["accessors"][0]["sparse"]["indices"]["bufferView"]
    builder.data[builder.json["bufferViews"][view]["byteOffset"]] = 3
    scene = noted(builder.glb(tmp_path))
    assert "index 3 is beyond the 3 elements" in scene.notes[0] and shown(scene) == NO_SHAPE


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e30])
def test_triangles_with_bad_vertices_are_left_out(tmp_path, value):
    builder = GltfBuilder()
    positions = np.concatenate([TRIANGLE + 5, TRIANGLE])
    positions[4, 1] = value
    mesh = builder.mesh(builder.primitive(positions, np.array([3, 4, 5, 0, 1, 2], np.uint8)), name="chair")
    builder.node(mesh=mesh)
    scene = noted(builder.glb(tmp_path))
    assert "'chair'" in scene.notes[0] and "vertex 4" in scene.notes[0] and "1 of 2 triangles" in scene.notes[0]
    np.testing.assert_array_equal(corners(scene.meshes[0]), [TRIANGLE + 5])
    builder.json["accessors"][1]["count"] = 3
    assert "no triangles to show" in message(builder.glb(tmp_path))


def test_bad_normals_become_flat_with_a_note(tmp_path):
    builder = GltfBuilder()
    normals = np.array([[0, 0, 1], [np.nan, 0, 0], [0, np.inf, 0]], np.float32)
    builder.node(mesh=builder.mesh(builder.primitive(NORMAL=normals)))
    scene = load_gltf(builder.glb(tmp_path))
    np.testing.assert_array_equal(scene.meshes[0].normals, [[0, 0, 1], [0, 0, 0], [0, 0, 0]])
    assert "2 values of NORMAL" in scene.notes[0]


# The node graph


def hierarchy(tmp_path, nodes, roots=(0,)):
    """Load a file whose node k is moved by (10^k, 0, 0) and has a mesh; return x of each instance, and the scene."""
    builder = triangle_scene()
    builder.json["nodes"] = [{"mesh": 0, "translation": [10**k, 0, 0], **node} for k, node in enumerate(nodes)]
    builder.json["scenes"][0]["nodes"] = list(roots)
    scene = noted(builder.glb(tmp_path))
    return sorted(instance.world_from_local[0, 3] for instance in scene.instances), scene


@pytest.mark.parametrize(
    ("nodes", "roots", "x", "problem"),
    [
        ([{"children": [1]}, {}], [0, 1], [1, 11], "nodes[1] is not a root; it is shown as a child of nodes[0]"),
        ([{"children": [1]}, {}], [1], [11], "nodes[1] is not a root"),
        ([{}], [0, 0], [1], "lists a node twice"),
        ([{"children": [2]}, {"children": [2]}, {}], [0, 1], [1, 10, 101], "child of both nodes[0] and nodes[1]"),
        ([{"children": [1, 1]}, {}], [0], [1, 11], "child of both nodes[0] and nodes[0]"),
        ([{"children": [0]}], [0], [1], "part of a cycle"),
        ([{"children": [1]}, {"children": [0]}], [0], [1, 11], "nodes[0]: it is part of a cycle of nodes"),
        ([{"children": [1]}, {"children": [0]}], [1], [10, 11], "nodes[1]: it is part of a cycle of nodes"),
        ([{}, {"children": [2]}, {"children": [1]}], [0], [1], "part of a cycle"),
    ],
)
def test_a_graph_that_is_no_tree_is_made_one(tmp_path, nodes, roots, x, problem):
    """A node is shown once, below its first parent; a cycle is opened above the node that the scene lists."""
    found, scene = hierarchy(tmp_path, nodes, roots)
    assert found == x and any(problem in note for note in scene.notes), (found, scene.notes)


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
    scene = noted(builder.glb(folder))
    assert "leaves the scene's folder" in scene.notes[0] and scene.materials[0].base_color_texture is None


@pytest.mark.parametrize("uri", ["missing.bin", "", ".", "a\0b", "x" * 5000, "data:;base64,@@@", "data:nothing"])
def test_unusable_buffer_uris(tmp_path, uri):
    path = triangle_scene().gltf(tmp_path)
    document = json.loads(path.read_text())
    document["buffers"][0]["uri"] = uri
    path.write_text(json.dumps(document))
    message(path)


def test_image_of_absurd_size_is_left_out_undecoded(tmp_path):
    png = bytearray(encode(np.zeros((1, 1, 3), np.uint8)))
    for side in (16385, 100000):
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
