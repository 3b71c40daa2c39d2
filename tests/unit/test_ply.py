"""PLY as MeshLab, Blender and scanners write it, text and binary of both orders; STL and OFF of many kinds."""

import struct

import numpy as np
import pytest
from PIL import Image
from unit.test_mesh_files import SQUARE, STL, area, binary_stl, world_triangles, write

from wgpu_gi.errors import GiError
from wgpu_gi.pictures.color import linear_from_srgb
from wgpu_gi.scene.files.mesh_files import load_mesh_file

POINTS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
TYPES = {"uchar": "B", "ushort": "H", "int": "i", "uint": "I", "float": "f", "double": "d", "char": "b"}
XYZ = [("x", "float"), ("y", "float"), ("z", "float")]
CORNERS = [("vertex_indices", "list uchar int")]


def ply(elements, form, comments=(), end="\n"):
    """Return a file of elements (name, properties, rows), where lists are lists; `form` is "ascii", "<" or ">"."""
    kind = {"ascii": "ascii", "<": "binary_little_endian", ">": "binary_big_endian"}[form]
    lines = ["ply", f"format {kind} 1.0", *comments]
    body = b""
    for name, properties, rows in elements:
        lines += [f"element {name} {len(rows)}", *(f"property {kind} {name}" for name, kind in properties)]
        for row in rows:
            words = []
            for (_, kind), value in zip(properties, row, strict=True):
                types = kind.split()[1:] if kind.startswith("list") else [kind]
                values = [len(value), *value] if len(types) == 2 else [value]
                codes = TYPES[types[0]] if len(types) == 1 else TYPES[types[0]] + TYPES[types[1]] * len(value)
                words += [f"{value:g}" for value in values]
                body += struct.pack(f"{form}{codes}", *values) if form != "ascii" else b""
            body += (" ".join(words) + end).encode() if form == "ascii" else b""
    return (end.join([*lines, "end_header"]) + end).encode() + body


def vertices(rows=POINTS, *extra):
    return ("vertex", [*XYZ, *((name, kind) for name, kind, _ in extra)],
            [[*p, *(values[k] for _, _, values in extra)] for k, p in enumerate(rows)])  # fmt: skip


FORMS = pytest.mark.parametrize("form", ["ascii", "<", ">"])


@FORMS
@pytest.mark.parametrize(
    "elements",
    [
        [vertices(), ("face", CORNERS, [[[0, 1, 2, 3]]])],
        [vertices(), ("face", CORNERS, [[[0, 1, 2]], [[0, 2, 3]]])],
        [vertices(), ("face", CORNERS, [[[0, 1, 2]], [[0, 2, 3, 3]]])],
        [vertices(), ("face", CORNERS, [[[0, 1, 2, 3]]]), ("edge", [("vertex1", "int"), ("vertex2", "int")], [[0, 1]])],
        [("edge_info", [("q", "int")], [[1], [2]]), vertices(), ("face", CORNERS, [[[0, 1, 2, 3]]])],
        [vertices(), ("face", [("flags", "int"), *CORNERS], [[7, [0, 1, 2, 3]]])],
        [vertices(), ("face", [("vertex_index", "list ushort uint")], [[[0, 1, 2, 3]]])],
        [vertices(), ("tristrips", [("vertex_indices", "list int int")], [[[0, 1, 3, 2]]])],
        [vertices(), ("tristrips", [("vertex_indices", "list int int")], [[[0, 1, 2, -1, 0, 2, 3]], [[]]])],
        [vertices(), ("face", [*CORNERS, ("texcoord", "list uchar float")], [[[0, 1, 2, 3], [0.0] * 8]])],
    ],
)  # fmt: skip
def test_every_layout_gives_the_unit_square(tmp_path, form, elements):
    for end in ("\n", "\r\n"):
        scene = load_mesh_file(write(tmp_path, "a.ply", ply(elements, form, end=end)))
        assert area(scene) == pytest.approx(1.0)
        a, b, c = world_triangles(scene).transpose(1, 0, 2)
        assert (np.cross(b - a, c - a)[:, 2] > 0).all()


@FORMS
def test_texture_coordinates_of_corners_and_numbers_of_textures(tmp_path, form):
    """As MeshLab writes them: faces of several sizes, a texture each."""
    for name, value in (("a.png", 10), ("b c.png", 200)):
        Image.fromarray(np.full((2, 2, 3), value, np.uint8)).save(tmp_path / name)
    properties = [*CORNERS, ("texcoord", "list uchar float"), ("texnumber", "int")]
    rows = [[[0, 1, 2], [0, 0, 1, 0, 1, 1], 1], [[0, 1, 2, 3], [0, 0, 0.5, 0, 0.5, 0.25, 0, 0.25], 0]]
    comments = ["comment TextureFile a.png", "comment TextureFile b c.png"]
    scene = load_mesh_file(write(tmp_path, "a.ply", ply([vertices(), ("face", properties, rows)], form, comments)))
    mesh = scene.meshes[0]
    assert [material.base_color_texture.image.pixels[0, 0, 0] for material in mesh.materials] == [10, 200]
    np.testing.assert_array_equal(mesh.material_of_triangle, [1, 0, 0])
    np.testing.assert_allclose(mesh.texcoords0[mesh.triangles[0]], [[0, 1], [1, 1], [1, 0]])
    np.testing.assert_allclose(mesh.texcoords0[mesh.triangles[2]], [[0, 1], [0.5, 0.75], [0, 0.75]])
    assert scene.notes == []


@FORMS
def test_face_colours_of_polygons(tmp_path, form):
    properties = [*CORNERS, ("red", "uchar"), ("green", "uchar"), ("blue", "uchar")]
    rows = [[[0, 1, 2], 255, 0, 0], [[0, 1, 2, 3], 0, 0, 128]]
    mesh = load_mesh_file(write(tmp_path, "a.ply", ply([vertices(), ("face", properties, rows)], form))).meshes[0]
    blue = linear_from_srgb(np.array(128 / 255))
    expected = [[1, 0, 0, 1], [0, 0, blue, 1], [0, 0, blue, 1]]
    np.testing.assert_allclose(mesh.colors[mesh.triangles[:, 0]], expected, rtol=1e-6)


@pytest.mark.parametrize("names", [("s", "t"), ("u", "v"), ("texture_u", "texture_v")])
def test_texture_coordinates_of_vertices(tmp_path, names):
    extra = [(name, "float", POINTS[:, k]) for k, name in enumerate(names)]
    data = ply([vertices(POINTS, *extra), ("face", CORNERS, [[[0, 1, 2, 3]]])], "<")
    np.testing.assert_allclose(
        load_mesh_file(write(tmp_path, "a.ply", data)).meshes[0].texcoords0, POINTS[:, :2] * (1, -1) + (0, 1)
    )


def test_wrong_parts_cost_themselves(tmp_path):
    faces = ("face", CORNERS, [[[0, 1, 2, 3]], [[0, 1, 9]]])
    scene = load_mesh_file(write(tmp_path, "a.ply", ply([vertices(), faces], "ascii") + b"1 2 3\n"))
    assert area(scene) == pytest.approx(1.0)
    assert ["more data" in scene.notes[0], "does not exist: 1" in scene.notes[1]] == [True, True]
    properties = [*CORNERS, ("texcoord", "list uchar float")]
    data = ply([vertices(), ("face", properties, [[[0, 1, 2, 3], [0, 0]]])], "<")
    scene = load_mesh_file(write(tmp_path, "a.ply", data))
    assert scene.meshes[0].texcoords0 is None and "every corner" in scene.notes[0]


def test_words_behind_a_row_are_no_part_of_the_next(tmp_path):
    """Some exporters announce four numbers and write a list; other readers take the line for the row."""
    text = ply([vertices(), ("face", [*CORNERS, ("red", "uchar")], [[[0, 1, 2], 9], [[0, 2, 3], 9]])], "ascii")
    scene = load_mesh_file(write(tmp_path, "a.ply", text.replace(b" 9\n", b" 9 1 1 1 1 1 1 1 1 1\n")))
    assert area(scene) == pytest.approx(1.0) and "more data" in scene.notes[0]


def test_headers_with_other_lines(tmp_path):
    data = ply([vertices(), ("face", CORNERS, [[[0, 1, 2, 3]]])], "<", ["Created by a program", "obj_info x", ""])
    assert area(load_mesh_file(write(tmp_path, "a.ply", data))) == pytest.approx(1.0)


@FORMS
def test_counts_allocate_nothing(tmp_path, form):
    data = ply([vertices(), ("face", CORNERS, [[[0, 1, 2]], [[0, 1, 2, 3]]])], form)
    for old, new in ((b"face 2", b"face 3"), (b"face 2", b"face 999999999999999"), (b"vertex 4", b"vertex 99999999")):
        with pytest.raises(GiError, match=r"a\.ply is"):
            load_mesh_file(write(tmp_path, "a.ply", data.replace(old, new)))


# ------------------------------------------------------------------------------------------------ STL


def test_bytes_behind_binary_stl_are_noted(tmp_path):
    data = b"solid part" + binary_stl(np.arange(27) % 5)[10:]
    assert load_mesh_file(write(tmp_path, "a.stl", data)).notes == []
    scene = load_mesh_file(write(tmp_path, "a.stl", data + b"\0\0"))
    assert scene.triangle_count and "2 bytes follow" in scene.notes[0]


def test_text_stl_of_other_programs(tmp_path):
    for text in (STL.upper(), STL.replace("\n", "\r\n"), STL.replace("endsolid", "end solid"), "\n " + STL):
        scene = load_mesh_file(write(tmp_path, "a.stl", text))
        assert scene.triangle_count == 1 and not scene.notes
    scene = load_mesh_file(write(tmp_path, "a.stl", STL.replace("endsolid s\n", "")))
    assert scene.triangle_count == 1 and "no 'endsolid'" in scene.notes[0]
    assert "2 solids" in load_mesh_file(write(tmp_path, "a.stl", STL + STL)).notes[0]


@pytest.mark.parametrize("magics", [False, True])
def test_colours_of_binary_stl(tmp_path, magics):
    """Five bits per channel: blue first and bit 15 set (VisCAM), or red first and bit 15 clear (Magics)."""
    facets = np.frombuffer(binary_stl(np.arange(18) * 7 % 11)[84:], np.uint8).reshape(2, 50).copy()
    word = 31 | 16 << 5 if magics else 1 << 15 | 31 << 10 | 16 << 5
    facets[:, 48:] = np.frombuffer(struct.pack("<H", word), np.uint8)
    header = (b"COLOR=\xff\xff\xff\xff" if magics else b"").ljust(80) + struct.pack("<I", 2)
    colors = load_mesh_file(write(tmp_path, "a.stl", header + facets.tobytes())).meshes[0].colors
    np.testing.assert_allclose(colors, [[1, linear_from_srgb(np.array(16 / 31)), 0, 1]] * 6, rtol=1e-6)


# ------------------------------------------------------------------------------------------------ OFF


@pytest.mark.parametrize(
    ("magic", "extra"),
    [
        ("OFF", ""), ("COFF", " 255 0 0 255"), ("COFF", " 1 0 0"), ("NOFF", " 0 0 1"), ("CNOFF", " 0 0 1 1 0 0 1"),
        ("STOFF", " 0.5 0.25"), ("STCNOFF", " 0 0 1 255 0 0 255 0.5 0.25"), ("4OFF", " 1"), ("OFF", " 9 9 9 9"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("counts", ["\n4 1 0\n", " 4 1 0\n", "4 1 0\n", " # a comment\n\n 4 1 0 # another\n"])
def test_kinds_of_off(tmp_path, magic, extra, counts):
    rows = "".join(f"{row}{extra}\n" for row in SQUARE.split("\n")[:4])
    scene = load_mesh_file(write(tmp_path, "a.off", f"{magic}{counts}{rows}4 0 1 2 3\n"))
    mesh = scene.meshes[0]
    assert area(scene) == pytest.approx(1.0) and not scene.notes
    assert (mesh.colors is not None) == ("C" in magic) and (mesh.normals is not None) == ("N" in magic)
    if mesh.colors is not None:
        np.testing.assert_allclose(mesh.colors, [[1, 0, 0, 1]] * 4)
    if magic.startswith("ST"):
        np.testing.assert_allclose(mesh.texcoords0, [[0.5, 0.75]] * 4)


def test_off_faces_have_colours(tmp_path):
    mesh = load_mesh_file(write(tmp_path, "a.off", f"OFF\n4 2 0\n{SQUARE}3 0 1 2 255 0 0\n3 0 2 3 0 0 255\n")).meshes[0]
    np.testing.assert_allclose(mesh.colors[mesh.triangles[:, 0]], [[1, 0, 0, 1], [0, 0, 1, 1]])


@pytest.mark.parametrize("magic", ["OFF BINARY", "nOFF", "OFFICE"])
def test_off_of_other_kinds_is_refused(tmp_path, magic):
    with pytest.raises(GiError, match=r"a\.off is"):
        load_mesh_file(write(tmp_path, "a.off", f"{magic}\n4 1 0\n{SQUARE}4 0 1 2 3\n"))
