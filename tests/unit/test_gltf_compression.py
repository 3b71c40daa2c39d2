"""Draco and meshopt geometry in glTF files: decoded with the optional packages, a clear error without them."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from unit.gltf_builder import TRIANGLE, GltfBuilder, corners, only_mesh, triangle_scene

from wgpu_gi.errors import GiError
from wgpu_gi.scene.gltf.load import load_gltf


def centers(triangles):
    """Return sorted triangle centres: the encoders may change the order of triangles and corners."""
    return np.sort(triangles.mean(axis=1), axis=0)


def compressed_view(builder, data, count, stride, mode, **keys):
    """Append a buffer view whose data exists only in meshopt's encoding; return its index."""
    stored = builder.view(data)
    extension = builder.json["bufferViews"][stored] | {"byteStride": stride, "count": count, "mode": mode, **keys}
    view = {"buffer": 1, "byteLength": count * stride, "extensions": {"EXT_meshopt_compression": extension}}
    return builder.add("bufferViews", view)


def meshopt_builder():
    """Return a builder with the fallback buffer, of absurd size and without data, of compressed views."""
    builder = GltfBuilder()
    builder.add("buffers", {"byteLength": 10**10, "extensions": {"EXT_meshopt_compression": {"fallback": True}}})
    builder.json["extensionsRequired"] = ["EXT_meshopt_compression"]
    return builder


def draco_builder(stream, ids, count):
    """Return a builder with one mesh whose POSITION and NORMAL are in a Draco stream."""
    builder = GltfBuilder()
    element = {"count": count, "type": "VEC3", "componentType": 5126}
    attributes = {name: builder.add("accessors", dict(element)) for name in ids}
    draco = {"bufferView": builder.view(stream), "attributes": ids}
    primitive = {"attributes": attributes, "extensions": {"KHR_draco_mesh_compression": draco}}
    builder.node(mesh=builder.mesh(primitive))
    builder.json["extensionsRequired"] = ["KHR_draco_mesh_compression"]
    return builder


def test_draco(tmp_path):
    draco = pytest.importorskip("DracoPy")
    points = np.random.default_rng(2).random((30, 3)).astype(np.float32)
    faces = np.arange(30, dtype=np.uint32).reshape(10, 3)
    stream = draco.encode(points, faces, quantization_bits=16, normals=points.astype(np.float64))
    ids = {a["attribute_type"]: a["unique_id"] for a in draco.decode(stream).attributes}
    mesh = only_mesh(draco_builder(stream, {"POSITION": ids[0], "NORMAL": ids[1]}, 30), tmp_path)
    np.testing.assert_allclose(centers(corners(mesh)), centers(points[faces]), atol=1e-3)
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-6)


@pytest.mark.parametrize(("size", "component"), [(2, 5123), (4, 5125)])
def test_meshopt(tmp_path, size, component):
    meshopt = pytest.importorskip("meshoptimizer")
    points = np.random.default_rng(3).random((300, 3)).astype(np.float32)
    indices = np.arange(300, dtype=np.uint32)
    builder = meshopt_builder()
    vertices = compressed_view(builder, meshopt.encode_vertex_buffer(points), 300, 12, "ATTRIBUTES")
    triangles = compressed_view(builder, meshopt.encode_index_buffer(indices, 300, 300), 300, size, "TRIANGLES")
    builder.add("accessors", {"bufferView": vertices, "count": 300, "type": "VEC3", "componentType": 5126})
    builder.add("accessors", {"bufferView": triangles, "count": 300, "type": "SCALAR", "componentType": component})
    builder.node(mesh=builder.mesh({"attributes": {"POSITION": 0}, "indices": 1}))
    expected = points[indices].reshape(-1, 3, 3)
    np.testing.assert_array_equal(centers(corners(only_mesh(builder, tmp_path))), centers(expected))


def test_meshopt_exponential_filter(tmp_path):
    meshopt = pytest.importorskip("meshoptimizer")
    # A value is mantissa * 2^exponent, the exponent in the top eight bits: 3 * 2^-1.
    encoded = np.where(TRIANGLE > 0, np.uint32(0xFF000003), np.uint32(0))
    builder = meshopt_builder()
    stream = meshopt.encode_vertex_buffer(encoded)
    view = compressed_view(builder, stream, 3, 12, "ATTRIBUTES", filter="EXPONENTIAL")
    builder.add("accessors", {"bufferView": view, "count": 3, "type": "VEC3", "componentType": 5126})
    builder.node(mesh=builder.mesh({"attributes": {"POSITION": 0}}))
    np.testing.assert_array_equal(corners(only_mesh(builder, tmp_path)), [1.5 * TRIANGLE])


def test_damaged_streams(tmp_path):
    pytest.importorskip("DracoPy")
    pytest.importorskip("meshoptimizer")
    header = b"DRACO\2\2\1\1\0\0\0\3\1"  # version 2.2, a mesh by edgebreaker, 3 vertices, 1 face
    for data, problem in (
        (b"DRACO nonsense", "not a Draco mesh"),
        (b"DRACO\2\1\1\1\0\0\0\3\1", "not of version 2.2"),
        (b"DRACO\2\2\1\1\0\0\0" + b"\xff" * 20, "header of its Draco data is damaged"),
        (header + b"nonsense", "cannot be decoded"),
    ):
        with pytest.raises(GiError, match=problem):
            load_gltf(draco_builder(data, {"POSITION": 0}, 3).glb(tmp_path))
    for count, problem in ((3, "cannot be decoded"), (10**10, "announces")):
        builder = meshopt_builder()
        view = compressed_view(builder, b"nonsense", count, 12, "ATTRIBUTES")
        builder.add("accessors", {"bufferView": view, "count": 3, "type": "VEC3", "componentType": 5126})
        builder.node(mesh=builder.mesh({"attributes": {"POSITION": 0}}))
        with pytest.raises(GiError, match=problem):
            load_gltf(builder.glb(tmp_path))


def test_without_the_decoders_the_extra_is_named(tmp_path, monkeypatch):
    for module in ("DracoPy", "meshoptimizer"):
        monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(GiError, match=r"pip install "):
        load_gltf(draco_builder(b"DRACO", {"POSITION": 0}, 3).glb(tmp_path))
    builder = meshopt_builder()
    view = compressed_view(builder, b"anything", 3, 12, "ATTRIBUTES")
    builder.add("accessors", {"bufferView": view, "count": 3, "type": "VEC3", "componentType": 5126})
    builder.node(mesh=builder.mesh({"attributes": {"POSITION": 0}}))
    with pytest.raises(GiError, match=r"pip install "):
        load_gltf(builder.glb(tmp_path))


def test_without_the_decoder_plain_data_is_used_where_the_file_has_it(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "DracoPy", None)
    builder = triangle_scene()
    extension = {"bufferView": 0, "attributes": {"POSITION": 0}}
    builder.json["meshes"][0]["primitives"][0]["extensions"] = {"KHR_draco_mesh_compression": extension}
    np.testing.assert_array_equal(corners(only_mesh(builder, tmp_path)), [TRIANGLE])
