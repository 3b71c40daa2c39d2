"""OBJ, PLY, STL and OFF: geometry, colours, materials, and damaged files of many kinds."""

import logging
import zlib

import numpy as np
import pytest
from PIL import Image

from wgpu_gi.errors import GiError
from wgpu_gi.pictures.color import linear_from_srgb
from wgpu_gi.scene.files.memory import MemoryBudget
from wgpu_gi.scene.files.mesh_files import load_mesh_file
from wgpu_gi.scene.files.notes import Notes
from wgpu_gi.scene.files.obj import Textures, read_mtl

SQUARE = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n"
STL = """solid s
facet normal 0 0 1
outer loop
vertex 0 0 0
vertex 1 0 0
vertex 1 1 0
endloop
endfacet
endsolid s
"""


def write(folder, name, content):
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def obj(*lines):
    return "\n".join(lines) + "\n"


def ply(rows=SQUARE, faces="4 0 1 2 3\n", properties="", form="ascii", scalar="float"):
    xyz = "".join(f"property {scalar} {axis}\n" for axis in "xyz")
    return (
        f"ply\nformat {form} 1.0\nelement vertex {rows.count(chr(10))}\n{xyz}{properties}"
        f"element face {faces.count(chr(10))}\nproperty list uchar int vertex_indices\nend_header\n{rows}{faces}"
    )


def binary_ply():
    header = ply(form="binary_little_endian", faces="3 0 1 2\n3 0 2 3\n").partition("end_header\n")[0] + "end_header\n"
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], "<f4").tobytes()
    return header.encode() + corners + b"".join(b"\x03" + np.array(f, "<i4").tobytes() for f in ([0, 1, 2], [0, 2, 3]))


def binary_stl(corners):
    triangles = np.array(corners, "<f4").reshape(-1, 9)
    return (
        bytes(80)
        + np.uint32(len(triangles)).tobytes()
        + b"".join(bytes(12) + t.tobytes() + bytes(2) for t in triangles)
    )


def world_triangles(scene):
    """Return the world positions of all triangles, (m, 3, 3)."""
    parts = []
    for instance in scene.instances:
        corners = instance.mesh.positions[instance.mesh.triangles].astype(np.float64)
        parts.append(corners @ instance.world_from_local[:3, :3].T + instance.world_from_local[:3, 3])
    return np.concatenate(parts)


def area(scene):
    a, b, c = world_triangles(scene).transpose(1, 0, 2)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("square.obj", obj(*("v " + row for row in SQUARE.split("\n")[:4]), "f 1 2 3 4")),
        ("square.ply", ply()),
        ("mixed.ply", ply(faces="3 0 1 2\n3 0 2 3\n")),
        ("binary.ply", binary_ply()),
        ("square.off", f"OFF\n4 1 0\n# a comment\n{SQUARE}4 0 1 2 3\n"),
        ("square.OFF", f"OFF 4 2 0\n{SQUARE}3 0 1 2 255 0 0\n3 0 2 3\n"),
        ("square.stl", STL + STL.replace("vertex 1 0 0", "vertex 1 1 0").replace("1 1 0\nendloop", "0 1 0\nendloop")),
        ("binary.stl", binary_stl([[0, 0, 0, 1, 0, 0, 1, 1, 0], [0, 0, 0, 1, 1, 0, 0, 1, 0]])),
    ],
)
def test_every_format_gives_the_unit_square(tmp_path, name, content):
    scene = load_mesh_file(write(tmp_path, name, content))
    assert scene.triangle_count == 2
    np.testing.assert_allclose(scene.bounds(), [[0, 0, 0], [1, 1, 0]])
    assert area(scene) == pytest.approx(1.0)
    a, b, c = world_triangles(scene).transpose(1, 0, 2)
    np.testing.assert_allclose(np.cross(b - a, c - a), [[0, 0, 1]] * 2, atol=1e-6)
    mesh = scene.meshes[0]
    assert mesh.normals is None and mesh.positions.dtype == np.float32 and mesh.triangles.dtype == np.uint32
    assert mesh.materials[0].base_color == (0.8, 0.8, 0.8, 1.0)


def test_distant_meshes_keep_their_shape(tmp_path):
    lines = [f"v {1e8 + x} {-3e7 + y} 5e7" for x, y in ((0, 0), (0.001, 0), (0.001, 0.002))]
    scene = load_mesh_file(write(tmp_path, "far.obj", obj(*lines, "f 1 2 3")))
    # At this distance doubles have a resolution of 1.5e-8 m.
    assert area(scene) == pytest.approx(1e-6, rel=1e-4)
    np.testing.assert_allclose(scene.bounds()[0], [1e8, -3e7, 5e7], rtol=1e-12)
    assert np.abs(scene.meshes[0].positions).max() < 0.01


def test_normals_only_where_the_file_has_them(tmp_path):
    text = obj("v 0 0 0", "v 1 0 0", "v 1 1 0", "v 0 1 0", "vn 0 0 5", "vn 0 0 0", "f 1//1 2//1 3//2", "f 1 3 4")
    normals = load_mesh_file(write(tmp_path, "n.obj", text)).meshes[0].normals
    np.testing.assert_array_equal(normals, [[0, 0, 1], [0, 0, 1], [0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0]])
    properties = "".join(f"property float n{axis}\n" for axis in "xyz")
    rows = "0 0 0 0 0 2\n1 0 0 0 3 4\n1 1 0 nan 0 0\n0 1 0 0 0 -1\n"
    normals = load_mesh_file(write(tmp_path, "n.ply", ply(rows, properties=properties))).meshes[0].normals
    np.testing.assert_allclose(normals, [[0, 0, 1], [0, 0.6, 0.8], [0, 0, 0], [0, 0, -1]], atol=1e-7)


def test_obj_negative_indices_count_back_from_their_line(tmp_path):
    first, second = ["v 0 0 0", "v 1 0 0", "v 1 1 0"], ["v 0 0 4", "v 1 0 4", "v 1 1 4"]
    scene = load_mesh_file(write(tmp_path, "n.obj", obj(*first, "f -3 -2 -1", *second, "f -3 -2 -1")))
    np.testing.assert_allclose(sorted(world_triangles(scene)[:, :, 2].mean(1)), [0, 4])
    assert area(scene) == pytest.approx(1.0)


def test_obj_syntax_variants(tmp_path):
    vertices = "\ufeffv 0 0 0 # comment\r\nv\t1 0 0  # end\r\n v 1 1 0 1.0\r\nv 0 1 0\r\n"
    text = vertices + "g a\r\ns off\r\nl 1 2\r\nf 1 2 \\\r\n 3 4\r\nfoo bar\r\nf"
    assert area(load_mesh_file(write(tmp_path, "wild.obj", text))) == pytest.approx(1.0)


def test_obj_materials(tmp_path):
    Image.fromarray(np.full((2, 3, 3), 128, np.uint8)).save(tmp_path / "wood grain.png")
    mtl = obj(
        "newmtl lamp", "Kd 0.78 0.78 0.78", "Ke 17 12 4", "newmtl wood", "Kd 0 0 0", "map_Kd -s 1 1 1 wood grain.png"
    )
    write(tmp_path, "m.mtl", mtl)
    quad = ["v 0 0 0", "v 1 0 0", "v 1 1 0", "v 0 1 0", "vt 0 0", "vt 1 0", "vt 1 0.75", "vt 0 1"]
    faces = ["f 1 2 3", "usemtl lamp", "f 1 2 3 4", "usemtl wood", "f 1/1 2/2 3/3"]
    scene = load_mesh_file(write(tmp_path, "m.obj", obj("mtllib m.mtl", *quad, *faces)))
    mesh = scene.meshes[0]
    lamp, wood, clay = mesh.materials
    np.testing.assert_array_equal(mesh.material_of_triangle, [2, 0, 0, 1])
    assert lamp.emission == (17, 12, 4) and lamp.base_color == (0.78, 0.78, 0.78, 1) and lamp.name == "lamp"
    assert clay.base_color == (0.8, 0.8, 0.8, 1)
    assert wood.base_color == (1, 1, 1, 1) and wood.base_color_texture.image.pixels.shape == (2, 3, 4)
    # v points down, as in glTF.
    np.testing.assert_allclose(mesh.texcoords0[mesh.triangles[3]], [[0, 1], [1, 1], [1, 0.25]])
    assert scene.notes == []


@pytest.mark.parametrize(
    ("row", "sentence"),
    [
        ("map_Kd none.png", "does not exist"),
        ("map_Kd ../../../../etc/hostname", "outside the scene's folder"),
        ("map_Kd /etc/hostname", "outside the scene's folder"),
        ("map_Kd \0", "outside the scene's folder"),
        ("map_Kd broken.png", "not an image"),
        ("map_Kd huge.png", "pixels are too many"),
        ("map_Kd .", "is a folder"),
        ("d 0", "an opacity of 0 is ignored"),
        ("Tr 1", "an opacity of 0 is ignored"),
        ("Pc 2", "not from 0 to 1"),
        ("map_d mask.png", "does not exist"),
        ("Pr 7", "not from 0 to 1"),
        ("map_Kd -o nan 0 broken.png", "not an image"),
        ("map_Bump bump.png", "rows that are not used: map_bump"),
        ("Ks 0.5 0.5 0.5", "rows that are not used: ks"),
        ("Kd nan 0 0", "not a colour"),
        ("Kd spectral file.rfl", "not a colour"),
        ("Kd 1.5 0 0", "above 1"),
        ("Ke -1 0 0", "not a colour"),
        ("Ke 1e400 0 0", "not a colour"),
    ],
)
def test_unusable_mtl_rows_become_notes(tmp_path, row, sentence):
    write(tmp_path, "broken.png", b"\x89PNG\r\n\x1a\n" + bytes(50))
    # A PNG of 20000 x 20000 pixels in a few bytes.
    ihdr = b"IHDR" + (20000).to_bytes(4, "big") * 2 + bytes([8, 2, 0, 0, 0])
    ihdr_chunk = bytes([0, 0, 0, 13]) + ihdr + zlib.crc32(ihdr).to_bytes(4, "big")
    write(tmp_path, "huge.png", b"\x89PNG\r\n\x1a\n" + ihdr_chunk + bytes(4) + b"IDAT" + bytes(4))
    notes = Notes()
    material = read_mtl(f"newmtl m\n{row}\n", ["m"], Textures(tmp_path, notes, MemoryBudget()))["m"]
    assert len(notes.sentences) == 1 and sentence in notes.sentences[0]
    assert max(material.base_color) <= 1 and min(material.emission) >= 0 and np.isfinite(material.emission).all()


@pytest.mark.parametrize(
    ("row", "sentence"), [("mtllib gone.mtl", "gone.mtl"), ("mtllib ../x.mtl", "outside"), ("", "'red'")]
)
def test_missing_material_library_is_noted(tmp_path, row, sentence):
    text = obj(row, "v 0 0 0", "v 1 0 0", "v 1 1 0", "usemtl red", "f 1 2 3")
    scene = load_mesh_file(write(tmp_path, "m.obj", text))
    assert len(scene.notes) == 1 and sentence in scene.notes[0]
    assert scene.meshes[0].materials[0].base_color == (0.8, 0.8, 0.8, 1.0)


def test_vertex_and_face_colours(tmp_path):
    uchar = "".join(f"property uchar {c}\n" for c in ("red", "green", "blue"))
    rows = "".join(f"{row} 255 0 128\n" for row in SQUARE.split("\n")[:4])
    mesh = load_mesh_file(write(tmp_path, "c.ply", ply(rows, properties=uchar))).meshes[0]
    np.testing.assert_allclose(mesh.colors[0], [1, 0, linear_from_srgb(np.array(128 / 255)), 1], rtol=1e-6)
    assert mesh.materials[0].base_color == (1, 1, 1, 1)

    floats = uchar.replace("uchar", "float")
    rows = "".join(f"{row} 0.25 0.5 0.75\n" for row in SQUARE.split("\n")[:4])
    mesh = load_mesh_file(write(tmp_path, "f.ply", ply(rows, properties=floats))).meshes[0]
    np.testing.assert_allclose(mesh.colors, [[0.25, 0.5, 0.75, 1]] * 4)

    text = ply(faces="3 0 1 2 255 0 0\n3 0 2 3 0 255 0\n").replace("vertex_indices\n", f"vertex_indices\n{uchar}")
    mesh = load_mesh_file(write(tmp_path, "t.ply", text)).meshes[0]
    np.testing.assert_array_equal(mesh.colors[mesh.triangles[:, 0]], [[1, 0, 0, 1], [0, 1, 0, 1]])

    text = obj("v 0 0 0 1 0 0.5", "v 1 0 0 1 0 0.5", "v 1 1 0 1 0 0.5", "f 1 2 3")
    mesh = load_mesh_file(write(tmp_path, "c.obj", text)).meshes[0]
    np.testing.assert_allclose(mesh.colors[0], [1, 0, linear_from_srgb(np.array(0.5)), 1], rtol=1e-6)


def test_degenerate_triangles_are_left_out_with_a_note(tmp_path):
    rows = ["v 0 0 0", "v 1 0 0", "v 1 1 0", "v 2 0 0", "v 7 7 7"]
    scene = load_mesh_file(write(tmp_path, "d.obj", obj(*rows, "f 1 2 3", "f 1 1 2", "f 1 2 4", "f 1 2")))
    assert scene.triangle_count == 1 and "2 degenerate triangles" in scene.notes[0]


def test_unused_vertices_are_ignored(tmp_path):
    scene = load_mesh_file(write(tmp_path, "u.ply", ply(SQUARE + "nan nan nan\n1e9 0 0\n")))
    np.testing.assert_allclose(scene.bounds(), [[0, 0, 0], [1, 1, 0]])


# Rows of six and of eight numbers, as many numbers in all as announced.
RAGGED_PLY = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
property float nx
property float ny
property float nz
element face 1
property list uchar int vertex_indices
end_header
0 0 0 0 0 1
1 0 0 0 0 1 9 9
1 1 0 0 0 1
3 0 1 2
3 0 1 2
"""

THREE = ("v 0 0 0", "v 1 0 0", "v 0 1 0")
BAD_FILES = {
    "empty.obj": b"",
    "empty.ply": b"",
    "text.obj": "this is no mesh\n",
    "zeros.obj": bytes(300),
    "lines.obj": obj(*THREE, "l 1 2"),
    "points_nan.obj": obj("v nan 0 0", "v 0 x 0"),
    "two_corners.obj": obj(*THREE, "f 1 2"),
    "high_index.obj": obj(*THREE, "f 1 2 4"),
    "zero_index.obj": obj(*THREE, "f 0 1 2"),
    "low_index.obj": obj(*THREE, "f -4 1 2"),
    "huge_index.obj": obj(*THREE, "f 1 2 99999999999999999999999"),
    "word_index.obj": obj(*THREE, "f 1 2 x"),
    "word.obj": obj("v 0 0 x", *THREE, "f 1 2 3"),
    "short.obj": obj("v 0 0", *THREE, "f 1 3 4"),
    "nan.obj": obj("v nan 0 0", *THREE, "f 1 2 3"),
    "inf.obj": obj("v 0 1e999 0", *THREE, "f 1 2 3"),
    "boundless.obj": obj("v 1e200 0 0", *THREE, "f 1 2 3"),
    "flat.obj": obj(*THREE, "f 1 1 1"),
    "magic.ply": "plx\n",
    "unended.ply": "ply\nformat ascii 1.0\nelement vertex 99999999999\n",
    "no_elements.ply": "ply\nformat ascii 1.0\nproperty float x\nend_header\n",
    "edges.ply": ply(faces="").replace("end_header\n", "element edge 1\nproperty int a\nend_header\n") + "1\n",
    "truncated.ply": ply()[:-12],
    "announced.ply": ply().replace("vertex 4", "vertex 4000000000"),
    "short_binary.ply": binary_ply()[:-5],
    "long_binary.ply": binary_ply().replace(b"vertex 4", b"vertex 4000000000"),
    "high_index.ply": ply(faces="3 0 1 4\n"),
    "negative_index.ply": ply(faces="3 0 1 -1\n"),
    "nan.ply": ply(SQUARE.replace("1 1 0", "1 nan 0")),
    "word.ply": ply(SQUARE.replace("1 1 0", "1 x 0")),
    "unknown_type.ply": ply(scalar="quaternion"),
    "ragged.ply": RAGGED_PLY,
    "noise.ply": b"ply\n" + bytes(range(256)),
    "truncated_ascii.stl": STL[:80],
    "word.stl": STL.replace("vertex 1 1 0", "vertex 1 x 0"),
    "nan.stl": STL.replace("vertex 1 1 0", "vertex 1 nan 0"),
    "two_vertices.stl": STL.replace("vertex 1 1 0\n", ""),
    "truncated.stl": binary_stl(range(9))[:-9],
    "announced.stl": bytes(80) + b"\xff\xff\xff\xff" + bytes(50),
    "no_triangles.stl": binary_stl([]),
    "short.stl": b"x",
    "nan_binary.stl": binary_stl([np.nan] * 9),
    "magic.off": f"FOO\n4 1 0\n{SQUARE}3 0 1 2\n",
    "counts.off": "OFF\n",
    "words.off": "OFF\nfour one\n",
    "truncated.off": f"OFF\n4 1 0\n{SQUARE}",
    "announced.off": "OFF\n99999999999 99999999999 0\n0 0 0\n",
    "negative.off": f"OFF\n-4 1 0\n{SQUARE}3 0 1 2\n",
    "high_index.off": f"OFF\n4 1 0\n{SQUARE}3 0 1 4\n",
    "noise.off": bytes(range(256)),
}


@pytest.mark.parametrize("name", BAD_FILES)
def test_bad_files_give_one_sentence(tmp_path, name, capfd, caplog):
    path = write(tmp_path, name, BAD_FILES[name])
    with caplog.at_level(logging.DEBUG), pytest.raises(GiError) as caught:
        load_mesh_file(path)
    message = str(caught.value)
    assert name in message and "\n" not in message and "Traceback" not in message
    assert capfd.readouterr() == ("", "") and not caplog.records


def test_bad_paths(tmp_path):
    with pytest.raises(GiError, match="does not exist"):
        load_mesh_file(tmp_path / "none.ply")
    with pytest.raises(GiError, match="not a mesh format"):
        load_mesh_file(tmp_path / "x.xyz")
    (tmp_path / "folder.obj").mkdir()
    with pytest.raises(GiError, match="folder"):
        load_mesh_file(tmp_path / "folder.obj")
    with pytest.raises(GiError, match=r"cannot be read|does not exist"):
        load_mesh_file("nul\0.obj")


@pytest.mark.parametrize("content", [binary_ply(), binary_stl(np.arange(27) % 5), ply().encode(), STL.encode()])
def test_truncation_gives_an_error_or_a_mesh(tmp_path, content):
    extension = ".ply" if content.startswith(b"ply") else ".stl"
    for length in range(1, len(content), 13):
        try:
            scene = load_mesh_file(write(tmp_path, f"cut{extension}", content[:length]))
        except GiError:
            continue
        assert np.isfinite(scene.bounds()).all()


def test_a_damaged_normal_of_text_stl_is_ignored_silently(tmp_path, capfd):
    """Normals of STL files are not used."""
    text = "solid a\nfacet normal 0 x 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
    path = tmp_path / "a.stl"
    path.write_text(text + "endsolid a\n")
    assert load_mesh_file(path).triangle_count == 1
    captured = capfd.readouterr()
    assert captured.out == captured.err == ""
