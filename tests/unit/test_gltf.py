"""The glTF reader on valid files: each feature against values computed by hand, plain meshes against trimesh."""

from __future__ import annotations

import base64
import json
import math
import textwrap
import time

import numpy as np
import pytest
from unit.gltf_builder import TRIANGLE, GltfBuilder, corners, only_mesh, triangle_scene

from wgpu_gi.scene.files.notes import Notes
from wgpu_gi.scene.gltf.load import load_gltf
from wgpu_gi.scene.scene import DirectionalLight, PointLight, SpotLight

QUAD = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
QUAD_TRIANGLES = np.array([0, 1, 2, 0, 2, 3], np.uint16)


# Containers and buffers


def with_uri(path, uri):
    """Replace the uri of the buffer of a .gltf file."""
    document = json.loads(path.read_text())
    document["buffers"][0]["uri"] = uri
    path.write_text(json.dumps(document))
    return path


def encoded(data):
    """Return base64 text."""
    return base64.b64encode(data).decode()


def test_plain_triangle(tmp_path):
    scene = load_gltf(triangle_scene().glb(tmp_path))
    mesh = scene.meshes[0]
    assert scene.name == "scene" and scene.notes == [] and scene.lights == [] and scene.cameras == []
    assert mesh.positions.dtype == np.float32 and mesh.triangles.dtype == np.uint32
    np.testing.assert_array_equal(corners(mesh), [TRIANGLE])
    assert mesh.normals is mesh.tangents is mesh.texcoords0 is mesh.texcoords1 is mesh.colors is None
    assert mesh.material_of_triangle is None and len(mesh.materials) == 1
    assert mesh.materials[0].metallic == mesh.materials[0].roughness == 1.0
    assert mesh.materials[0].base_color == (1.0, 1.0, 1.0, 1.0)


@pytest.mark.parametrize("uri", [None, "data.bin", "buffers/my%20data.bin"])
def test_gltf_with_data_uri_and_external_buffer(tmp_path, uri):
    builder = triangle_scene()
    (tmp_path / "buffers").mkdir()
    path = builder.gltf(tmp_path, uri)
    if uri and "%20" in uri:
        (tmp_path / uri).rename(tmp_path / "buffers" / "my data.bin")
    np.testing.assert_array_equal(corners(load_gltf(path).meshes[0]), [TRIANGLE])


@pytest.mark.parametrize(
    "uri",
    [
        lambda data: "data:;base64," + encoded(data).rstrip("="),
        lambda data: "data:application/octet-stream;base64," + "\r\n".join(textwrap.wrap(encoded(data), 7)),
        lambda data: "data:application/octet-stream;charset=utf-8;base64," + encoded(data),
        lambda data: "DATA:;BASE64," + base64.urlsafe_b64encode(data).decode(),
        lambda data: "data:application/octet-stream," + "".join(f"%{byte:02x}" for byte in data),
    ],
    ids=["unpadded", "line breaks", "charset", "url-safe", "percent"],
)
def test_every_way_to_write_a_data_uri(tmp_path, uri):
    builder = triangle_scene()
    builder.data += b"\xfb\xff\xfe\xff"  # whose base64 has + and /
    path = with_uri(builder.gltf(tmp_path), uri(bytes(builder.data)))
    np.testing.assert_array_equal(corners(load_gltf(path, notes=Notes(strict=True)).meshes[0]), [TRIANGLE])


@pytest.mark.parametrize(
    ("file", "uri"),
    [
        ("a b#c?.bin", "a%20b%23c%3F.bin"),
        ("plain name.bin", "plain name.bin"),
        ("50% off.bin", "50% off.bin"),
        ("x%20y.bin", "x%20y.bin"),
        ("größe.bin", "gr%C3%B6%C3%9Fe.bin"),
        ("\u00e9.bin", "e\u0301.bin"),
        ("e\u0301.bin", "\u00e9.bin"),
    ],
)
def test_files_are_found_however_their_names_are_escaped(tmp_path, file, uri):
    builder = triangle_scene()
    path = with_uri(builder.gltf(tmp_path), uri)
    (tmp_path / file).write_bytes(builder.data)
    assert load_gltf(path, notes=Notes(strict=True)).triangle_count == 1


def test_byte_order_mark_and_backslashes_are_accepted(tmp_path):
    builder = triangle_scene()
    (tmp_path / "sub").mkdir()
    path = builder.gltf(tmp_path, "sub/data.bin")
    text = path.read_text().replace("sub/data.bin", "sub\\\\data.bin")
    path.write_bytes(b"\xef\xbb\xbf" + text.encode())
    assert load_gltf(path).triangle_count == 1


# Accessors


def test_interleaved_vertices_with_offsets(tmp_path):
    builder = GltfBuilder()
    vertices = np.zeros(3, np.dtype([("pad", "f4"), ("position", "<f4", 3), ("normal", "<f4", 3)]))
    vertices["position"], vertices["normal"] = TRIANGLE, (0, 0, 1)
    view = builder.view(b"\xff" * 8 + vertices.tobytes(), byteStride=28)
    position, normal = (
        builder.add(
            "accessors",
            {"bufferView": view, "byteOffset": offset, "count": 3, "type": "VEC3", "componentType": 5126},
        )
        for offset in (12, 24)
    )
    builder.node(mesh=builder.mesh(builder.primitive(position, NORMAL=normal)))
    mesh = only_mesh(builder, tmp_path)
    np.testing.assert_array_equal(corners(mesh), [TRIANGLE])
    np.testing.assert_array_equal(mesh.normals, [[0, 0, 1]] * 3)


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "uint32"])
def test_index_types(tmp_path, dtype):
    builder = GltfBuilder()
    builder.node(mesh=builder.mesh(builder.primitive(QUAD, QUAD_TRIANGLES.astype(dtype))))
    np.testing.assert_array_equal(corners(only_mesh(builder, tmp_path)), QUAD[QUAD_TRIANGLES].reshape(2, 3, 3))


@pytest.mark.parametrize(("dtype", "scale"), [("int8", 127), ("uint8", 255), ("int16", 32767), ("uint16", 65535)])
def test_normalized_and_plain_integer_positions(tmp_path, dtype, scale):
    builder = GltfBuilder()
    positions = (TRIANGLE * np.iinfo(dtype).max).astype(dtype)
    normalized = builder.accessor(positions, normalized=True)
    builder.node(mesh=builder.mesh({"attributes": {"POSITION": normalized}}))
    builder.node(mesh=builder.mesh({"attributes": {"POSITION": builder.accessor(positions)}}))
    builder.json["extensionsUsed"] = builder.json["extensionsRequired"] = ["KHR_mesh_quantization"]
    first, second = load_gltf(builder.glb(tmp_path)).meshes
    np.testing.assert_allclose(corners(first), [TRIANGLE], atol=1e-6)
    np.testing.assert_array_equal(corners(second), [TRIANGLE * scale])


def test_most_negative_integer_is_minus_one(tmp_path):
    builder = GltfBuilder()
    positions = builder.accessor(np.array([[-128, 0, 0], [127, 0, 0], [0, 127, 0]], np.int8), normalized=True)
    builder.node(mesh=builder.mesh({"attributes": {"POSITION": positions}}))
    np.testing.assert_array_equal(only_mesh(builder, tmp_path).positions[:, 0], [-1, 1, 0])


@pytest.mark.parametrize("with_base", [True, False])
def test_sparse_accessor(tmp_path, with_base):
    builder = GltfBuilder()
    base = QUAD if with_base else np.zeros_like(QUAD)
    accessor = builder.accessor(QUAD)
    if not with_base:
        del builder.json["accessors"][accessor]["bufferView"]
    replaced = np.array([[5, 6, 7], [8, 9, 1], [2, 2, 2]], np.float32)
    builder.json["accessors"][accessor]["sparse"] = {
        "count": 3,
        "indices": {"bufferView": builder.view(np.array([1, 2, 3], np.uint16).tobytes()), "componentType": 5123},
        "values": {"bufferView": builder.view(replaced.tobytes())},
    }
    primitive = {"attributes": {"POSITION": accessor}, "indices": builder.accessor(QUAD_TRIANGLES)}
    builder.node(mesh=builder.mesh(primitive))
    expected = np.concatenate([base[:1], replaced])
    np.testing.assert_array_equal(only_mesh(builder, tmp_path).positions, expected)


# Meshes


def test_strip_and_fan_wind_like_lists(tmp_path):
    builder = GltfBuilder()
    strip = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 2, 0]], np.float32)
    fan = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
    builder.node(mesh=builder.mesh(builder.primitive(strip, mode=5)))
    builder.node(mesh=builder.mesh(builder.primitive(fan, mode=6)))
    for mesh, count in zip(load_gltf(builder.glb(tmp_path)).meshes, (3, 2), strict=True):
        a, b, c = corners(mesh).transpose(1, 0, 2)
        assert len(a) == count
        assert (np.cross(b - a, c - a)[:, 2] == 1.0).all()


def test_lines_are_left_out_with_a_note(tmp_path):
    builder = GltfBuilder()
    builder.node(mesh=builder.mesh(*(builder.primitive(mode=mode) for mode in (1, 2, 3, 4))))
    scene = load_gltf(builder.glb(tmp_path))
    assert scene.triangle_count == 1
    assert scene.notes == ["Lines were left out; only triangles and points are shown."]


@pytest.mark.parametrize("normals", [False, True])
def test_points_are_shown_as_spheres_or_as_discs_along_their_normals(tmp_path, normals):
    """Each has the given diameter (its polygon the area of the round shape), its colour and its material."""
    builder = GltfBuilder()
    colors = np.float32([[1, 0, 0], [0, 1, 0], [0, 0, 1]])
    more = {"NORMAL": np.tile(np.float32([0, 0, 2]), (3, 1))} if normals else {}
    material = builder.material(name="chalk")
    points = builder.primitive(TRIANGLE * 10, mode=0, COLOR_0=colors, material=material, **more)
    builder.node(mesh=builder.mesh(builder.primitive(), points), translation=[0, 0, 5], name="cloud")
    scene = load_gltf(builder.glb(tmp_path), point_size=0.5)
    plain, cloud = scene.instances
    assert plain.mesh.triangles.shape == (1, 3) and cloud.name == "cloud"
    world = cloud.mesh.positions @ cloud.world_from_local[:3, :3].T + cloud.world_from_local[:3, 3]
    for place, color in zip(TRIANGLE * 10 + np.float32([0, 0, 5]), colors, strict=True):
        mine = np.linalg.norm(world - place, axis=1) < 1
        np.testing.assert_allclose(world[mine].mean(0), place, atol=1e-5)
        assert np.linalg.norm(world[mine] - place, axis=1).max() == pytest.approx(0.25, rel=0.1)
        np.testing.assert_allclose(cloud.mesh.colors[mine, :3], np.tile(color, (mine.sum(), 1)), atol=1e-6)
    assert (np.ptp(world[:, 2]) < 1e-6) == normals
    assert cloud.mesh.materials[0].name == "chalk"
    assert any("3 points without faces are shown" in note for note in scene.notes)


def test_points_do_not_emit(tmp_path):
    builder = GltfBuilder()
    glow = builder.material(emissiveFactor=[1, 1, 1])
    builder.node(mesh=builder.mesh(builder.primitive(material=glow), builder.primitive(mode=0, material=glow)))
    scene = load_gltf(builder.glb(tmp_path))
    assert [mesh.materials[0].emission for mesh in scene.meshes] == [(1, 1, 1), (0, 0, 0)]
    assert any("Points do not emit light" in note for note in scene.notes)


def test_points_that_are_not_finite_are_left_out(tmp_path):
    builder = GltfBuilder()
    places = np.concatenate([TRIANGLE, np.float32([[np.nan, 0, 0]])])
    empty = builder.primitive(np.full((2, 3), np.inf, np.float32), mode=0)
    builder.node(mesh=builder.mesh(builder.primitive(places, mode=0), empty))
    scene = load_gltf(builder.glb(tmp_path))
    assert np.isfinite(scene.bounds()).all() and len(scene.instances) == 1
    assert any("none of its points is finite; the primitive was left out" in note for note in scene.notes)


def test_primitives_are_merged_with_neutral_values(tmp_path):
    builder = GltfBuilder()
    red, blue = builder.material(name="red"), builder.material(name="blue")
    normals = np.tile(np.array([0, 0, 2], np.float32), (3, 1))
    colors = np.tile(np.array([0, 128, 255, 0], np.uint8), (3, 1))
    tangents = np.tile(np.array([2, 0, 0, -1], np.float32), (3, 1))
    rich = builder.primitive(TRIANGLE, NORMAL=normals, TANGENT=tangents, TEXCOORD_1=TRIANGLE[:, :2].copy())
    rich["attributes"]["COLOR_0"] = builder.accessor(colors, normalized=True)
    plain = builder.primitive(TRIANGLE + 1, material=blue)
    again = builder.primitive(TRIANGLE + 2, material=red)
    builder.node(mesh=builder.mesh(rich | {"material": red}, plain, again, name="both"))
    mesh = only_mesh(builder, tmp_path)
    assert [m.name for m in mesh.materials] == ["red", "blue"] and mesh.name == "both"
    np.testing.assert_array_equal(mesh.material_of_triangle, [0, 1, 0])
    np.testing.assert_array_equal(corners(mesh), [TRIANGLE, TRIANGLE + 1, TRIANGLE + 2])
    np.testing.assert_array_equal(mesh.normals, [[0, 0, 1]] * 3 + [[0, 0, 0]] * 6)
    np.testing.assert_array_equal(mesh.tangents, [[1, 0, 0, -1]] * 3 + [[0, 0, 0, 0]] * 6)
    np.testing.assert_allclose(mesh.colors, [[0, 128 / 255, 1, 0]] * 3 + [[1, 1, 1, 1]] * 6)
    np.testing.assert_array_equal(mesh.texcoords1[:3], TRIANGLE[:, :2])
    assert mesh.texcoords0 is None and not mesh.texcoords1[3:].any()


def test_primitives_share_their_vertices(tmp_path):
    builder = GltfBuilder()
    grid = np.random.default_rng(1).random((1000, 3)).astype(np.float32)
    shared = builder.accessor(grid)
    primitives = [
        {
            "attributes": {"POSITION": shared},
            "indices": builder.accessor(np.arange(start, start + 300, dtype=np.uint16)),
        }
        for start in (0, 300)
    ]
    builder.node(mesh=builder.mesh(*primitives))
    far = np.array([999, 997, 700], np.uint16)
    builder.node(mesh=builder.mesh({"attributes": {"POSITION": shared}, "indices": builder.accessor(far)}))
    first, second = load_gltf(builder.glb(tmp_path)).meshes
    np.testing.assert_array_equal(corners(first), grid[:600].reshape(-1, 3, 3))
    assert len(first.positions) == 600 and len(second.positions) == 3
    np.testing.assert_array_equal(corners(second), [grid[far]])


def test_tangents_without_normals_are_ignored(tmp_path):
    builder = GltfBuilder()
    builder.node(mesh=builder.mesh(builder.primitive(TANGENT=np.ones((3, 4), np.float32))))
    assert only_mesh(builder, tmp_path).tangents is None


def test_three_component_and_unflagged_integer_colors(tmp_path):
    builder = GltfBuilder()
    builder.node(mesh=builder.mesh(builder.primitive(COLOR_0=np.full((3, 3), 2.0, np.float32))))
    builder.node(mesh=builder.mesh(builder.primitive(COLOR_0=np.full((3, 4), 51, np.uint8))))
    first, second = load_gltf(builder.glb(tmp_path)).meshes
    np.testing.assert_array_equal(first.colors, np.ones((3, 4)))
    np.testing.assert_allclose(second.colors, np.full((3, 4), 0.2), atol=1e-7)


def test_degenerate_triangles_are_dropped_and_counted(tmp_path):
    builder = triangle_scene()
    positions = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1e-3, 0], [1e-18, 0, 0], [0, 1e-18, 0]], np.float32)
    triangles = np.array([0, 1, 2, 0, 0, 1, 0, 1, 3, 0, 4, 5], np.uint16)
    builder.node(mesh=builder.mesh(builder.primitive(positions, triangles), name="slivers"))
    builder.node(mesh=builder.mesh(builder.primitive(positions[:3]), name="line"))
    scene = load_gltf(builder.glb(tmp_path))
    assert [len(m.triangles) for m in scene.meshes] == [1, 2]  # small is not degenerate
    assert any("3 degenerate triangles" in note and "'slivers'" in note for note in scene.notes)
    assert any("'line' was left out" in note for note in scene.notes)


def test_unused_invalid_vertices_are_ignored(tmp_path):
    builder = GltfBuilder()
    positions = np.concatenate([[[np.nan] * 3], TRIANGLE, [[np.inf] * 3]]).astype(np.float32)
    builder.node(mesh=builder.mesh(builder.primitive(positions, np.array([1, 2, 3], np.uint8))))
    np.testing.assert_array_equal(corners(only_mesh(builder, tmp_path)), [TRIANGLE])


# Nodes


def test_hierarchy_trs_matrix_and_instancing(tmp_path):
    builder = GltfBuilder()
    mesh = builder.mesh(name="shape")
    half = math.sqrt(0.5)
    child = builder.node(root=False, mesh=mesh, name="child", translation=[1, 0, 0], scale=[1, 2, 3])
    builder.node(mesh=mesh, translation=[1e7, 0, 0.25], rotation=[0, 0, half, half], children=[child])
    builder.node(mesh=mesh, matrix=[-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1])
    scene = load_gltf(builder.glb(tmp_path))
    assert [i.name for i in scene.instances] == ["shape", "child", "shape"]
    assert len({id(i.mesh) for i in scene.instances}) == 1
    parent, below, mirrored = (i.world_from_local for i in scene.instances)
    assert parent.dtype == np.float64 and parent[0, 3] == 1e7 and parent[2, 3] == 0.25
    np.testing.assert_allclose(parent[:3, :3], [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-12)
    np.testing.assert_allclose(below[:3, 3], [1e7, 1, 0.25])
    np.testing.assert_allclose(below[:3, :3], [[0, -2, 0], [1, 0, 0], [0, 0, 3]], atol=1e-12)
    np.testing.assert_array_equal(mirrored[:3, 3], [5, 6, 7])
    assert np.linalg.det(mirrored) == -1.0


def test_only_the_default_scene_is_shown(tmp_path):
    builder = triangle_scene()
    other = builder.node(root=False, mesh=builder.mesh(), name="other")
    builder.json["scenes"].append({"nodes": [other], "name": "second"})
    builder.json["scene"] = 1
    scene = load_gltf(builder.glb(tmp_path))
    assert [i.name for i in scene.instances] == ["other"] and scene.name == "second"
    assert any("2 scenes" in note for note in scene.notes)


def test_file_without_scenes_shows_all_roots(tmp_path):
    builder = triangle_scene()
    del builder.json["scenes"]
    assert len(load_gltf(builder.glb(tmp_path)).instances) == 1


def test_scale_of_zero_along_one_axis_is_kept(tmp_path):
    builder = triangle_scene()
    builder.node(mesh=0, name="plane", scale=[2, 2, 0])
    builder.node(mesh=0, name="gone", scale=[1, 0, 0])
    scene = load_gltf(builder.glb(tmp_path))
    assert [i.name for i in scene.instances] == ["meshes[0]", "plane"]
    plane = scene.instances[1].world_from_local
    np.testing.assert_allclose(plane[:3, :2], [[2, 0], [0, 2], [0, 0]], atol=1e-12)
    assert np.linalg.det(plane) != 0.0
    assert any("'gone'" in note for note in scene.notes)


# Lights and cameras


def test_lights_follow_their_nodes(tmp_path):
    builder = triangle_scene()
    half = math.sqrt(0.5)
    down = {"rotation": [-half, 0, 0, half], "translation": [1, 2, 3], "scale": [2, 2, 2]}
    builder.light(type="point", intensity=5, color=[1, 0.5, 0.25], range=10, node={"translation": [4, 5, 6]})
    builder.light(type="spot", spot={"innerConeAngle": 0.1, "outerConeAngle": 0.2}, name="lamp", node=down)
    builder.light(type="directional", intensity=3, node=down | {"name": "sun"})
    builder.light(type="spot", spot={})
    point, spot, sun, default = load_gltf(builder.glb(tmp_path)).lights
    assert isinstance(point, PointLight) and isinstance(spot, SpotLight) and isinstance(sun, DirectionalLight)
    assert (point.position, point.intensity, point.color, point.range) == ((4, 5, 6), 5.0, (1.0, 0.5, 0.25), 10.0)
    assert (spot.name, spot.intensity, spot.range, spot.position) == ("lamp", 1.0, None, (1, 2, 3))
    assert (spot.inner_cone_angle, spot.outer_cone_angle) == (0.1, 0.2)
    np.testing.assert_allclose(spot.direction, (0, -1, 0), atol=1e-12)
    np.testing.assert_allclose(sun.direction, (0, -1, 0), atol=1e-12)
    assert sun.name == "sun" and sun.intensity == 3.0
    assert (default.inner_cone_angle, default.outer_cone_angle) == (0.0, math.pi / 4)
    np.testing.assert_array_equal(default.direction, (0, 0, -1))


def test_cameras_are_rigid(tmp_path):
    builder = triangle_scene()
    perspective = builder.add("cameras", {"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}})
    orthographic = {"xmag": 2, "ymag": 1.5, "zfar": 9, "znear": 0}
    parallel = builder.add("cameras", {"type": "orthographic", "orthographic": orthographic, "name": "top"})
    half = math.sqrt(0.5)
    builder.node(camera=perspective, name="eye", translation=[1, 2, 3], scale=[2, 3, -4], rotation=[0, half, 0, half])
    builder.node(camera=parallel)
    eye, top = load_gltf(builder.glb(tmp_path)).cameras
    assert (eye.name, eye.yfov, eye.orthographic_height) == ("eye", 0.7, None)
    np.testing.assert_allclose(eye.position, (1, 2, 3))
    rotation = eye.world_from_view[:3, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(rotation), 1.0)
    np.testing.assert_allclose(rotation[:, 1], (0, 1, 0), atol=1e-12)
    np.testing.assert_allclose(rotation[:, 2], (-1, 0, 0), atol=1e-12)
    assert (top.name, top.orthographic_height) == ("top", 3.0)


# Extensions


def test_unknown_optional_extensions_are_noted(tmp_path):
    builder = triangle_scene()
    builder.json["extensionsUsed"] = ["KHR_materials_iridescence", "KHR_lights_punctual"]
    notes = load_gltf(builder.glb(tmp_path)).notes
    assert len(notes) == 1 and "KHR_materials_iridescence" in notes[0] and "punctual" not in notes[0]


def test_instances_of_a_node_are_placed_by_their_attributes(tmp_path):
    """EXT_mesh_gpu_instancing: world = node * translation * rotation * scale."""
    builder = GltfBuilder()
    quarter = np.float32([[0, 0, 0, 1], [0, 0, math.sqrt(0.5), math.sqrt(0.5)]])
    attributes = {
        "TRANSLATION": builder.accessor(np.float32([[1, 0, 0], [0, 2, 0]])),
        "ROTATION": builder.accessor((quarter * 32767).astype(np.int16), normalized=True),
        "SCALE": builder.accessor(np.float32([[1, 1, 1], [3, 1, 1]])),
        "_ID": builder.accessor(np.float32([0, 1])),
    }
    extensions = {"EXT_mesh_gpu_instancing": {"attributes": attributes}}
    builder.node(mesh=builder.mesh(), extensions=extensions, translation=[0, 0, 5], name="tree")
    scene = load_gltf(builder.glb(tmp_path), notes=Notes(strict=True))
    first, second = (instance.world_from_local for instance in scene.instances)
    np.testing.assert_allclose(first[:3, 3], (1, 0, 5), atol=1e-6)
    np.testing.assert_allclose(second[:3], [[0, -1, 0, 0], [3, 0, 0, 2], [0, 0, 1, 5]], atol=1e-4)
    assert len(scene.meshes) == 1 and [instance.name for instance in scene.instances] == ["tree", "tree"]


@pytest.mark.parametrize(
    ("places", "shown", "problem"),
    [
        (np.float32([[0, 0, 0], [np.nan, 0, 0], [1e30, 0, 0]]), 1, "2 instances are not finite or out of range"),
        (np.float32([[0, 0], [1, 1]]), 1, "TRANSLATION must have 3 components"),
        (None, 1, "no TRANSLATION, ROTATION or SCALE; its mesh is shown once"),
    ],
)
def test_damaged_instances_are_left_out(tmp_path, places, shown, problem):
    builder = GltfBuilder()
    attributes = {} if places is None else {"TRANSLATION": builder.accessor(places)}
    builder.node(mesh=builder.mesh(), extensions={"EXT_mesh_gpu_instancing": {"attributes": attributes}})
    scene = load_gltf(builder.glb(tmp_path))
    assert len(scene.instances) == shown and problem in scene.notes[0]


def test_invisible_nodes_are_not_shown(tmp_path):
    """KHR_node_visibility hides a node and all below it."""
    builder = triangle_scene()
    child = builder.node(root=False, mesh=0)
    builder.node(mesh=0, children=[child], extensions={"KHR_node_visibility": {"visible": False}})
    builder.node(mesh=0, extensions={"KHR_node_visibility": {}}, name="seen")
    assert [instance.name for instance in load_gltf(builder.glb(tmp_path)).instances] == ["meshes[0]", "seen"]


# Comparison with another reader, and speed


def test_agrees_with_trimesh_on_plain_files(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    theirs = trimesh.Scene()
    theirs.add_geometry(trimesh.creation.icosphere(2), node_name="ball")
    moved = trimesh.transformations.translation_matrix([3, 1, 2]) @ trimesh.transformations.scale_matrix(2)
    theirs.add_geometry(trimesh.creation.box((1, 2, 3)), node_name="box", transform=moved)
    path = tmp_path / "plain.glb"
    path.write_bytes(theirs.export(file_type="glb"))
    ours = load_gltf(path)
    assert ours.triangle_count == sum(len(g.faces) for g in theirs.geometry.values())
    np.testing.assert_allclose(ours.bounds(), theirs.bounds, rtol=1e-6)
    for instance in ours.instances:
        transform, geometry = theirs.graph[instance.name]
        expected = trimesh.transform_points(theirs.geometry[geometry].vertices, transform)
        matrix = instance.world_from_local
        world = instance.mesh.positions @ matrix[:3, :3].T + matrix[:3, 3]
        np.testing.assert_allclose(world, expected, atol=1e-6)
        np.testing.assert_array_equal(instance.mesh.triangles, theirs.geometry[geometry].faces)


def test_a_million_triangles_load_in_seconds(tmp_path):
    side = 708
    y, x = np.mgrid[0:side, 0:side].astype(np.float32)
    positions = np.stack([x, y, np.sin(x) * np.cos(y)], axis=-1).reshape(-1, 3)
    corner = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).reshape(-1, 1)
    triangles = (corner + np.array([0, 1, side, 1, side + 1, side])).astype(np.uint32).reshape(-1)
    builder = GltfBuilder()
    builder.node(mesh=builder.mesh(builder.primitive(positions, triangles, NORMAL=positions)))
    path = builder.glb(tmp_path)
    start = time.perf_counter()
    scene = load_gltf(path)
    assert time.perf_counter() - start < 2.0
    assert scene.triangle_count == 2 * (side - 1) ** 2
