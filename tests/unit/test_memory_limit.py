"""Small files that announce much: what a file may unpack to is bounded, by its headers, in one sentence."""

from __future__ import annotations

import struct
import time
import tracemalloc
import zlib

import numpy as np
import pytest
from PIL import Image
from unit.gltf_builder import GltfBuilder
from unit.test_gltf_compression import compressed_view, draco_builder, meshopt_builder

from wgpu_gi.errors import GiError
from wgpu_gi.scene.files.environment_files import load_environment
from wgpu_gi.scene.files.memory import MemoryBudget
from wgpu_gi.scene.load import load

MIB = 1 << 20
LIMIT = 24 * MIB


def refused(load_it, limit=LIMIT):
    """Return the message of a load that is refused within a second, and before it allocates what it refuses."""
    start = time.process_time()
    tracemalloc.start()
    try:
        with pytest.raises(GiError) as caught:
            load_it()
        assert tracemalloc.get_traced_memory()[1] < 3 * limit
    finally:
        tracemalloc.stop()
    assert time.process_time() - start < 3.0
    message = str(caught.value)
    assert "unpacks to" in message and "--max-memory" in message and "\n" not in message
    return message


def png(side):
    """Return a black one-bit PNG of a square, 1 KB for each 8 million pixels."""

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", side, side, 1, 0, 0, 0, 0)
    rows = zlib.compress(bytes((1 + side // 8) * side), 9)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")


def textured(count, side=1024, same=False, used=True):
    """Return a builder with `count` materials, each with an image of its own or all with `same`."""
    builder = GltfBuilder()
    data = png(side)
    views = [builder.view(data) for _ in range(1 if same else count)] * (count if same else 1)
    primitives = []
    for view in views:
        builder.add("textures", {"source": builder.add("images", {"bufferView": view, "mimeType": "image/png"})})
        material = builder.material(
            pbrMetallicRoughness={"baseColorTexture": {"index": len(builder.json["images"]) - 1}}
        )
        primitives.append(builder.primitive(**({"material": material} if used else {})))
    builder.node(mesh=builder.mesh(*primitives))
    return builder


def test_the_sum_of_the_images_counts(tmp_path):
    path = textured(7).glb(tmp_path)
    assert path.stat().st_size < 20_000
    message = refused(lambda: load(path, max_memory=LIMIT))
    assert "scene.glb: images[6]: it unpacks to 4.0 MiB, and the file to more than the 24.0 MiB allowed" in message
    assert len(load(path, max_memory=32 * MIB).materials) == 7


def test_equal_and_unused_images_count_once_or_not(tmp_path):
    scene = load(textured(20, same=True).glb(tmp_path), max_memory=LIMIT)
    assert len({id(m.base_color_texture.image) for m in scene.materials}) == 1
    assert not any(
        m.base_color_texture for m in load(textured(20, used=False).glb(tmp_path), max_memory=LIMIT).materials
    )


def test_accessors_without_data(tmp_path):
    builder = GltfBuilder()
    for _ in range(300):
        builder.add("accessors", {"count": 500_000, "type": "VEC3", "componentType": 5126})
    builder.node(mesh=builder.mesh(*({"attributes": {"POSITION": k}} for k in range(300))))
    message = refused(lambda: load(builder.glb(tmp_path), max_memory=LIMIT))
    assert "scene.glb: " in message and "it unpacks to 5.7 MiB" in message


def test_sparse_copies_of_one_accessor(tmp_path):
    builder = GltfBuilder()
    view = builder.view(bytes(4 * MIB))
    index, value = builder.view(b"\0\0\0\0"), builder.view(bytes(12))
    sparse = {"count": 1, "indices": {"bufferView": index, "componentType": 5121}, "values": {"bufferView": value}}
    element = {"bufferView": view, "count": 300_000, "type": "VEC3", "componentType": 5126, "sparse": sparse}
    primitives = [{"attributes": {"POSITION": builder.add("accessors", dict(element))}} for _ in range(50)]
    builder.node(mesh=builder.mesh(*primitives))
    assert "scene.glb: " in refused(lambda: load(builder.glb(tmp_path), max_memory=LIMIT))


def test_many_meshes_of_one_accessor(tmp_path):
    """Each mesh copies the vertices that it uses."""
    builder = GltfBuilder()
    positions = np.random.default_rng(0).random((30_000, 3)).astype(np.float32)
    primitive = builder.primitive(positions)
    for _ in range(200):
        builder.node(mesh=builder.mesh(primitive))
    assert "meshes[" in refused(lambda: load(builder.glb(tmp_path), max_memory=LIMIT))


def grid(side):
    """Return vertices and triangles of a flat square."""
    x, y = np.meshgrid(np.arange(side), np.arange(side))
    points = np.stack([x, y, 0 * x], -1).reshape(-1, 3).astype(np.float32)
    first = (x + side * y)[:-1, :-1].ravel().astype(np.uint32)
    near, far = np.stack([first, first + 1, first + side], 1), np.stack([first + 1, first + side + 1, first + side], 1)
    return points, np.concatenate([near, far])


@pytest.mark.parametrize("level", [0, 7])
def test_draco(tmp_path, level):
    """One kilobyte holds 11 MiB of vertices and triangles."""
    draco = pytest.importorskip("DracoPy")
    stream = draco.encode(*grid(400), compression_level=level, quantization_bits=1)
    path = draco_builder(stream, {"POSITION": 0}, 160_000).glb(tmp_path)
    assert "KHR_draco_mesh_compression: it unpacks to 11.0 MiB" in refused(
        lambda: load(path, max_memory=8 * MIB), 8 * MIB
    )
    stream = draco.encode(*grid(100), compression_level=level, quantization_bits=10)
    ids = {a["attribute_type"]: a["unique_id"] for a in draco.decode(stream).attributes}
    assert load(draco_builder(stream, {"POSITION": ids[0]}, 10_000).glb(tmp_path), max_memory=LIMIT).triangle_count


def test_meshopt(tmp_path):
    meshopt = pytest.importorskip("meshoptimizer")
    builder = meshopt_builder()
    stream = meshopt.encode_vertex_buffer(np.zeros((3_000_000, 3), np.float32))
    view = compressed_view(builder, stream, 3_000_000, 12, "ATTRIBUTES")
    builder.add("accessors", {"bufferView": view, "count": 3, "type": "VEC3", "componentType": 5126})
    builder.node(mesh=builder.mesh({"attributes": {"POSITION": 0}}))
    path = builder.glb(tmp_path)
    assert path.stat().st_size < 600_000
    assert "EXT_meshopt_compression: it unpacks to 34.3 MiB" in refused(lambda: load(path, max_memory=LIMIT))


def test_textures_of_obj(tmp_path):
    rows = "v 0 0 0\nv 1 0 0\nv 0 1 0\nmtllib m.mtl\n"
    library = ""
    for k in range(7):
        (tmp_path / f"{k}.png").write_bytes(png(1024))
        rows += f"usemtl m{k}\nf 1 2 3\n"
        library += f"newmtl m{k}\nmap_Kd {k}.png\nnewmtl unused{k}\nmap_Kd ./{k}.png\nnewmtl same{k}\nmap_Kd {k}.png\n"
    (tmp_path / "m.mtl").write_text(library)
    (tmp_path / "s.obj").write_text(rows)
    assert "6.png: it unpacks to 4.0 MiB" in refused(lambda: load(tmp_path / "s.obj", max_memory=LIMIT))
    (tmp_path / "s.obj").write_text(rows.replace("usemtl m6", "usemtl m5"))
    assert len(load(tmp_path / "s.obj", max_memory=LIMIT).materials) == 6


def test_postscript_is_no_texture(tmp_path):
    """Its decoder would run a program."""
    Image.fromarray(np.zeros((4, 4, 3), np.uint8)).save(tmp_path / "t.eps")
    (tmp_path / "m.mtl").write_text("newmtl m\nmap_Kd t.eps\n")
    (tmp_path / "s.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nmtllib m.mtl\nusemtl m\nf 1 2 3\n")
    scene = load(tmp_path / "s.obj")
    assert scene.materials[0].base_color_texture is None and any("known format" in note for note in scene.notes)


def test_environments(tmp_path):
    path = tmp_path / "sky.hdr"
    row = bytes([1, 2, 3, 128, 1, 1, 1, 255, 1, 1, 1, 7])
    path.write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1024 +X 2048\n" + row * 1024)
    assert f"environment map {path}: it unpacks to 32.0 MiB" in refused(
        lambda: load_environment(path, max_memory=LIMIT)
    )
    assert load_environment(path, max_memory=2 * LIMIT).image.shape == (1024, 2048, 3)


def test_exr_of_many_channels(tmp_path):
    exr = pytest.importorskip("OpenEXR")
    path = tmp_path / "sky.exr"
    planes = {name: np.zeros((512, 1024), np.float16) for name in ("R", "G", "B", *(f"c{k}" for k in range(40)))}
    with exr.File({"compression": exr.ZIP_COMPRESSION, "type": exr.scanlineimage}, planes) as file:
        file.write(str(path))
    assert path.stat().st_size < 200_000
    assert "it unpacks to" in refused(lambda: load_environment(path, max_memory=LIMIT))


def test_the_budget_adds_up():
    budget = MemoryBudget(100)
    budget.take(60, "a")
    budget.take(40, "b")
    with pytest.raises(GiError, match=r"^c: it unpacks to"):
        budget.take(1, "c")
