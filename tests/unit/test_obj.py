"""OBJ and MTL as other programs write them: attributes that are missing or wrong, libraries, texture options."""

import numpy as np
import pytest
from PIL import Image
from unit.test_mesh_files import area, obj, write

from wgpu_gi.errors import GiError
from wgpu_gi.scene.files.memory import MemoryBudget
from wgpu_gi.scene.files.mesh_files import load_mesh_file
from wgpu_gi.scene.files.mtl import read_mtl
from wgpu_gi.scene.files.mtl_textures import Textures, split_options
from wgpu_gi.scene.files.notes import Notes

QUAD = ("v 0 0 0", "v 1 0 0", "v 1 1 0", "v 0 1 0")


def load_text(folder, *lines):
    return load_mesh_file(write(folder, "a.obj", obj(*lines)))


def picture(folder, name, value=200, size=(2, 2)):
    (folder / name).parent.mkdir(exist_ok=True)
    Image.fromarray(np.full((*size, 3), value, np.uint8)).save(folder / name)


@pytest.mark.parametrize(
    ("lines", "note"),
    [
        (("vt 0 0", "vt nan 0", "vt -nan(ind) 1", "vt 0 1", "f 1/1 2/2 3/3 4/4"), "'vt' rows that are not 2 finite"),
        (("vt 0", "vt 1", "f 1/1 2/2 3/2 4/1"), None),
        (("vt 0 0 0", "vt 1 1 0", "f 1/1 2/2 3/2 4/1"), None),
        (("vn 0 0 1", "f 1/1/1 2/2/1 3/3/1 4/4/1"), "corners whose 'vt' does not exist: 4"),
        (("vn 0 0 1", "f 1//1 2//2 3//1 4//1"), "corners whose 'vn' does not exist: 1"),
        (("vn 0 0 x", "f 1//1 2//1 3//1 4//1"), "'vn' rows that are not 3 finite numbers: 1"),
        (("f 1/ 2/ 3/ 4/",), None),
        (("f 1// 2// 3// 4//",), None),
        (("f -4// -3// -2// -1//",), None),
        (("f 1 2 3 4", "f 1 2 5", "f 1 2 x", "f 1 2 99999999999999999999"), "a vertex does not exist: 3"),
        (("f 1 2 3 4", "v nan 0 0", "f 1 2 5"), "a vertex is NaN or infinite: 1"),
        (("f 1 2 3 4", "l 1 2", "p 1"), "lines, points are not shown"),
    ],
)
def test_a_wrong_attribute_costs_itself(tmp_path, lines, note):
    scene = load_text(tmp_path, *QUAD, *lines)
    assert area(scene) == pytest.approx(1.0)
    assert np.isfinite(scene.meshes[0].texcoords0 if scene.meshes[0].texcoords0 is not None else 0).all()
    assert [note in sentence for sentence in scene.notes] == [True] if note else scene.notes == []


def test_strict_refuses_damage(tmp_path):
    path = write(tmp_path, "a.obj", obj(*QUAD, "f 1/1 2/1 3/1"))
    with pytest.raises(GiError, match=r"a\.obj: corners whose 'vt' does not exist: 3 \(--strict"):
        load_mesh_file(path, notes=Notes(strict=True))


def test_one_dimensional_texture_coordinates_have_no_v(tmp_path):
    mesh = load_text(tmp_path, *QUAD, "vt 0.25", "vt 1 0.5", "f 1/1 2/2 3/2").meshes[0]
    np.testing.assert_allclose(mesh.texcoords0, [[0.25, 1], [1, 0.5], [1, 0.5]])


def test_decimal_commas(tmp_path):
    scene = load_text(tmp_path, *(row.replace("1", "1,5") for row in QUAD), "f 1 2 3 4")
    assert area(scene) == pytest.approx(2.25) and "decimal commas" in scene.notes[0]


def test_text_of_older_windows_programs(tmp_path):
    write(tmp_path, "größe.mtl", "newmtl weiß\nKd 0.1 0.2 0.3\n".encode("cp1252"))
    scene = load_mesh_file(
        write(tmp_path, "a.obj", obj("mtllib größe.mtl", *QUAD, "usemtl weiß", "f 1 2 3 4").encode("cp1252"))
    )
    assert scene.meshes[0].materials[0].base_color == (0.1, 0.2, 0.3, 1.0) and not scene.notes


@pytest.mark.parametrize("encoding", ["utf-16", "utf-8-sig"])
def test_texts_with_a_byte_order_mark(tmp_path, encoding):
    path = write(tmp_path, "a.obj", obj(*QUAD, "f 1 2 3 4").encode(encoding))
    assert area(load_mesh_file(path)) == pytest.approx(1.0)


def test_rows_of_points_are_shown_as_points(tmp_path):
    assert "4 points" in load_text(tmp_path, *QUAD, "p 1 2 3 4").notes[0]


@pytest.mark.parametrize(
    ("row", "files"),
    [
        ("one.mtl two.mtl", ("one.mtl", "two.mtl")),
        ("my one.mtl my two.mtl", ("my one.mtl", "my two.mtl")),
        ('"my one.mtl" two.mtl', ("my one.mtl", "two.mtl")),
        ("ONE.mtl Two.MTL", ("one.mtl", "two.mtl")),
        ("sub\\one.mtl ./two.mtl", ("sub/one.mtl", "two.mtl")),
        ("one two", ("one", "two")),
    ],
)
def test_names_of_material_libraries(tmp_path, row, files):
    (tmp_path / "sub").mkdir()
    write(tmp_path, files[0], "newmtl red\nKd 0.9 0.1 0.1\n")
    write(tmp_path, files[1], "newmtl blue\nKd 0.1 0.1 0.9\n")
    scene = load_text(tmp_path, f"mtllib {row}", *QUAD, "usemtl red", "f 1 2 3", "usemtl blue", "f 1 3 4")
    assert [material.base_color[0] for material in scene.meshes[0].materials] == [0.9, 0.1] and not scene.notes


@pytest.mark.parametrize(
    ("name", "file"),
    [
        ("tex.png", "materials/tex.png"),
        ("../tex.png", "tex.png"),
        ("tex.png", "tex.png"),
        ("TEX.PNG", "materials/tex.png"),
        ("C:\\Users\\me\\tex.png", "materials/tex.png"),
        ("/textures/tex.png", "tex.png"),
        ("materials/tex.png", "materials/tex.png"),
        ('"my tex.png"', "materials/my tex.png"),
        ("my tex.png", "materials/my tex.png"),
    ],
)
def test_textures_lie_beside_the_library_or_the_scene(tmp_path, name, file):
    (tmp_path / "materials").mkdir()
    picture(tmp_path, file)
    write(tmp_path, "materials/a.mtl", f"newmtl m\nKd 1 1 1\nmap_Kd {name}\n")
    scene = load_text(tmp_path, "mtllib materials/a.mtl", *QUAD, "usemtl m", "f 1 2 3 4")
    assert scene.meshes[0].materials[0].base_color_texture.image.pixels[0, 0, 0] == 200 and not scene.notes


def test_textures_outside_the_scene_are_refused(tmp_path):
    (tmp_path / "scene").mkdir()
    picture(tmp_path, "tex.png")
    write(tmp_path, "scene/a.mtl", "newmtl m\nmap_Kd ../tex.png\n")
    scene = load_mesh_file(write(tmp_path, "scene/a.obj", obj("mtllib a.mtl", *QUAD, "usemtl m", "f 1 2 3 4")))
    assert scene.meshes[0].materials[0].base_color_texture is None and "outside" in scene.notes[0]


@pytest.mark.parametrize(
    ("row", "options", "name"),
    [
        ("tex.png", {}, "tex.png"),
        ("-s 2 3 1 tex.png", {"-s": ["2", "3", "1"]}, "tex.png"),
        ("-s 2 tex.png", {"-s": ["2"]}, "tex.png"),
        ("-s 2 4 wood 2.png", {"-s": ["2", "4"]}, "wood 2.png"),
        ("-o 0.5 -1e-1 my tex.png", {"-o": ["0.5", "-1e-1"]}, "my tex.png"),
        ("-blendu off -blendv on -clamp on t.png", {"-blendu": ["off"], "-blendv": ["on"], "-clamp": ["on"]}, "t.png"),
        ("-bm 0.3 -mm 0 1 -texres 512 t.png", {"-bm": ["0.3"], "-mm": ["0", "1"], "-texres": ["512"]}, "t.png"),
        ("-imfchan l -type sphere t.png", {"-imfchan": ["l"], "-type": ["sphere"]}, "t.png"),
        ("-BM 2 t.png", {"-bm": ["2"]}, "t.png"),
        ("-dash.png", {}, "-dash.png"),
        ("-s 1 2", {"-s": ["1"]}, "2"),
    ],
)
def test_options_of_texture_rows(row, options, name):
    assert split_options(row) == (options, name)


def test_scale_offset_and_clamp_place_the_texture(tmp_path):
    """OBJ's (u, v), v upwards, becomes s (u, v) + o; the package's v points down."""
    picture(tmp_path, "t.png")
    textures = Textures(tmp_path, Notes(), MemoryBudget())
    material = read_mtl("newmtl m\nmap_Kd -s 2 3 1 -o 0.25 0.5 0 -clamp on t.png\n", ["m"], textures)["m"]
    texture = material.base_color_texture
    u, v = 0.3, 0.8
    down = np.array(texture.scale) * (u, 1 - v) + texture.offset
    np.testing.assert_allclose((down[0], 1 - down[1]), (2 * u + 0.25, 3 * v + 0.5))
    assert (texture.wrap_u, texture.wrap_v) == ("clamp", "clamp") and textures.notes.sentences == []
    plain = textures.of_row("t.png")
    assert plain.offset == (0, 0) and plain.scale == (1, 1) and plain.image is texture.image


@pytest.mark.parametrize("alpha", [False, True])
def test_masks_cut_out(tmp_path, alpha):
    picture(tmp_path, "t.png", size=(4, 2))
    mask = np.full((2, 2, 4 if alpha else 3), 255, np.uint8)
    mask[0, :, 3 if alpha else slice(None)] = 0
    Image.fromarray(mask).save(tmp_path / "mask.png")
    textures = Textures(tmp_path, Notes(), MemoryBudget())
    material = read_mtl("newmtl m\nKd 1 1 1\nmap_Kd t.png\nmap_d mask.png\n", ["m"], textures)["m"]
    pixels = material.base_color_texture.image.pixels
    assert material.alpha_mode == "mask" and pixels.shape == (4, 2, 4) and (pixels[..., :3] == 200).all()
    np.testing.assert_array_equal(pixels[..., 3], [[0, 0], [0, 0], [255, 255], [255, 255]])
    assert textures.notes.sentences == []


def test_grey_masks_blend(tmp_path):
    Image.fromarray(np.full((2, 2), 100, np.uint8)).save(tmp_path / "mask.png")
    textures = Textures(tmp_path, Notes(), MemoryBudget())
    assert read_mtl("newmtl m\nmap_d mask.png\n", ["m"], textures)["m"].alpha_mode == "blend"


@pytest.mark.parametrize(
    ("rows", "mode", "alpha"),
    [("d 0.25", "blend", 0.25), ("Tr 0.25", "blend", 0.75), ("d 1\nTr 1", "opaque", 1.0), ("Tr 1", "opaque", 1.0)],
)
def test_opacity_blends(tmp_path, rows, mode, alpha):
    """Of both rows, `d` counts; an opacity of 0 alone is a mistake of the exporter, with a note."""
    textures = Textures(tmp_path, Notes(), MemoryBudget())
    material = read_mtl(f"newmtl m\nKd 1 1 1\n{rows}\n", ["m"], textures)["m"]
    assert (material.alpha_mode, material.base_color[3]) == (mode, alpha)
    assert len(textures.notes.sentences) == (rows == "Tr 1")


def test_layers_of_pbr_rows(tmp_path):
    textures = Textures(tmp_path, Notes(), MemoryBudget())
    rows = "Pr 0.5\nPc 0.8\nPcr 0.1\nPs 0.4\naniso 0.6\nanisor 0.25\nNi 1.33\n"
    material = read_mtl(f"newmtl m\nKd 1 1 1\n{rows}", ["m"], textures)["m"]
    assert (material.clearcoat, material.clearcoat_roughness, material.ior) == (0.8, 0.1, 1.33)
    assert (material.sheen_color, material.sheen_roughness) == ((0.4, 0.4, 0.4), 0.5)
    assert (material.anisotropy, material.anisotropy_rotation) == (0.6, np.pi / 2)
    assert read_mtl("newmtl m\nNi 2\n", ["m"], textures)["m"].ior == 1.5 and textures.notes.sentences == []


def test_metallic_and_roughness_rows(tmp_path):
    picture(tmp_path, "n.png")
    textures = Textures(tmp_path, Notes(), MemoryBudget())
    material = read_mtl("newmtl m\nKd 1 1 1\nPr 0.25\nPm 1\nnorm n.png\n", ["m"], textures)["m"]
    assert (material.roughness, material.metallic) == (0.25, 1.0) and material.normal_texture is not None
