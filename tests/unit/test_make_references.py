"""References by Mitsuba 3, without Mitsuba: the scene in world space, images, layers, hash, errors."""

import math

import numpy as np
import pytest
from make_references import find_llvm, main
from mitsuba_scene import camera_rays, environment_pixels, mask_pixels, pixel_centres, spot_pixels
from reference_file import layers_of, noise_of, packed, scene_hash
from world_surfaces import sheets, surfaces

import wgpu_gi as gi
from wgpu_gi.errors import GiError
from wgpu_gi.resources import resource_dir
from wgpu_gi.scene.built_in.scenes import builtin_scene, matte
from wgpu_gi.scene.built_in.shapes import box, quad
from wgpu_gi.scene.scene import Environment, Image, Instance, Material, Scene, SpotLight, Texture

rng = np.random.default_rng(1)
PICTURE = Texture(Image(np.full((2, 2, 4), 255, np.uint8)))


def normals_of(surface):
    a, b, c = surface.corners.transpose(1, 0, 2)
    return np.cross(b - a, c - a)


# --------------------------------------------------------------------------------------------------- geometry


@pytest.mark.parametrize("factor", [1.0, -2.0])
def test_instances_are_placed_in_float64_and_keep_their_orientation(factor):
    place = np.diag([factor, 1.0, 3.0, 1.0])
    place[:3, 3] = 1e7, 0.1, -1e7
    (surface,) = surfaces(Scene([Instance(box((-1, -1, -1), (1, 1, 1)), place)]))
    centre = np.array([1e7, 0.1, -1e7])
    assert surface.corners.reshape(-1, 3).max(0) == pytest.approx(centre + np.array([abs(factor), 1, 3]), abs=1e-8)
    assert ((surface.corners.mean(1) - centre) * normals_of(surface)).sum(-1).min() > 0


def test_triangles_are_joined_by_material_and_smoothness():
    mesh = box((0, 0, 0), (1, 1, 1), matte(0.5))
    mesh.normals = mesh.positions - np.float32(0.5)
    mesh.normals[0] = 0  # vertex 0 is in five triangles: those are flat
    mesh.positions = np.concatenate([mesh.positions, mesh.positions[:1]])
    mesh.normals = np.concatenate([mesh.normals, np.ones((1, 3), np.float32)])
    mesh.triangles = np.concatenate([mesh.triangles, [[1, 8, 8]]]).astype(np.uint32)  # without area
    found = surfaces(Scene([Instance(mesh), Instance(mesh, np.diag([1, 2, 1, 1.0]))]))
    counts = {s.normals is None: len(s.corners) for s in found}
    flat = int((mesh.triangles[:-1] == 0).any(1).sum())
    assert counts == {True: 2 * flat, False: 2 * (12 - flat)}


def test_normals_transform_by_the_inverse_transpose():
    mesh = quad((0, 0, 0), (1, 0, -1), (0, 1, 0), matte(0.5))
    mesh.normals = np.array([[1, 0, 1]] * 4, np.float32)
    (surface,) = surfaces(Scene([Instance(mesh, np.diag([4.0, 1, 1, 1]))]))
    assert np.cross(surface.normals[0, 0], normals_of(surface)[0]) == pytest.approx(np.zeros(3))


def test_a_double_sided_emitter_becomes_two_sheets():
    mesh = quad((0, 0, 0), (1, 0, 0), (0, 1, 0), matte(0.5, emission=1.0))
    mesh.normals = np.array([[0, 1, 1]] * 4, np.float32)
    (surface,) = surfaces(Scene([Instance(mesh)]))
    front, back = sheets(surface, 0.01)
    assert front.normals is None and (front.corners[..., 2] == 0.01).all() and (back.corners[..., 2] == -0.01).all()
    assert (normals_of(front)[:, 2] > 0).all() and (normals_of(back)[:, 2] < 0).all()
    mesh.materials[0].double_sided = False
    assert len(sheets(surface, 0.01)) == 1


def test_mask_without_a_texture_is_all_or_nothing():
    mesh = quad((0, 0, 0), (1, 0, 0), (0, 1, 0), Material(base_color=(1, 1, 1, 0.4), alpha_mode="mask"))
    assert surfaces(Scene([Instance(mesh)])) == []
    mesh.materials[0].alpha_cutoff = 0.4
    assert len(surfaces(Scene([Instance(mesh)]))) == 1


@pytest.mark.parametrize(
    ("material", "words"),
    [
        (Material("lamp", unlit=True), "'lamp'.*unlit"),
        (Material(base_color_texture=Texture(PICTURE.image, "repeat", "clamp")), "wraps"),
        (Material(base_color_texture=PICTURE, emission_texture=Texture(PICTURE.image, scale=(2, 2))), "coordinates"),
        (Material(base_color_texture=PICTURE), "vertex colours"),
        (Material(alpha_mode="mask"), "mask by vertex colours"),
        (Material(alpha_mode="mask", emission=(1, 1, 1)), "emits"),
    ],
)
def test_unsupported_features_raise(material, words):
    mesh = quad((0, 0, 0), (1, 0, 0), (0, 1, 0), material)
    if "vertex" in words:
        mesh.colors = np.full((4, 4), 0.5, np.float32)
    with pytest.raises(GiError, match=words):
        surfaces(Scene([Instance(mesh)]))


def test_camera_rays_pass_through_pixel_centres():
    camera, centres = gi.Camera.look_at((1, 2, 3), (1, 2, -5), yfov_deg=90), pixel_centres((4, 2))
    origins, directions = camera_rays(camera, (4, 2), centres)
    assert (origins == (1, 2, 3)).all()
    assert directions[0] / -directions[0, 2] == pytest.approx([-1.5, 0.5, -1])
    camera.orthographic_height = 2.0
    origins, directions = camera_rays(camera, (4, 2), centres)
    assert origins[7] == pytest.approx([2.5, 1.5, 3]) and (directions == (0, 0, -1)).all()


# --------------------------------------------------------------------------------------------------- pictures


def test_mask_compares_the_bilinear_alpha():
    pixels = np.zeros((1, 2, 4), np.uint8)
    pixels[..., 3] = [[0, 200]]
    picture = Texture(Image(pixels), "clamp", "clamp")
    fine = mask_pixels(picture, 1.0, 0.5)
    # Alpha rises from 0 at a quarter to 200/255 at three quarters.
    edge = (fine[0] == 0).sum() / fine.shape[1]
    assert edge == pytest.approx(0.25 + 0.5 * 0.5 * 255 / 200, abs=1 / fine.shape[1])
    assert (mask_pixels(Texture(Image(pixels), filter="nearest"), 1.0, 0.5) == [[0, 1]]).all()


def test_spot_has_a_squared_fall_off():
    light = SpotLight((0, 0, 0), (0, 0, -1), math.radians(10), math.radians(30))
    row = spot_pixels(light, 257)[128]
    slope = np.abs(np.linspace(-1, 1, 515)[1::2]) * math.tan(math.radians(30))
    cosine = np.cos(np.arctan(slope))
    inner, outer = math.cos(math.radians(10)), math.cos(math.radians(30))
    assert row == pytest.approx(np.clip((cosine - outer) / (inner - outer), 0, 1) ** 2, abs=1e-6)


def test_environment_rows_match_mitsubas_mapping():
    image = rng.random((3, 4, 3)).astype(np.float32)
    rows = environment_pixels(Environment((2.0, 1.0, 1.0), image))
    assert rows.shape == (7, 4, 3)
    assert rows[1::2] == pytest.approx(image * np.array([2, 1, 1]))
    assert rows[2] == pytest.approx((rows[1] + rows[3]) / 2) and (rows[0] == rows[1]).all()


# ----------------------------------------------------------------------------------------------------- layers


def pictures_of(noise=0.0):
    values = {"emit": 1.0, "direct": 3.0, "one": 3.5, "all": 3.75}
    return {k: (v + noise * rng.normal(size=(16, 4, 5, 3))).astype(np.float32) for k, v in values.items()}


def test_layers_are_the_differences_and_errors_come_from_the_spread():
    layers = layers_of(pictures_of())
    found = {name: float(layers[name].mean()) for name in ("emit", "direct", "one", "multi")}
    assert found == pytest.approx({"emit": 1.0, "direct": 2.0, "one": 0.5, "multi": 0.25})
    noisy = layers_of(pictures_of(0.1))
    expected = {"direct": 2**0.5, "one": 2**0.5, "multi": 2**0.5, "indirect": 2**0.5, "full": 1.0}
    for name, factor in expected.items():
        assert noisy[f"se_{name}"].mean() == pytest.approx(factor * 0.1 / 4, rel=0.1)
    noisy["depth"] = np.ones((4, 5), np.float32)
    assert noise_of(noisy)["full"] == pytest.approx(0.025**2 / (3.75**2 * 1.01), rel=0.2)
    noisy["depth"][:] = 0
    assert noise_of(noisy) == {}


def test_packing_keeps_values_to_float16_and_errors_to_four_bits():
    value = rng.uniform(0.01, 100, (50, 40, 3)).astype(np.float32)
    half = packed({"direct": value, "se_direct": value})
    assert {layer.dtype for layer in half.values()} == {np.dtype(np.float16)}
    assert half["direct"].astype(np.float32) == pytest.approx(value, rel=2**-11)
    assert half["se_direct"].astype(np.float32) == pytest.approx(value, rel=2**-4)
    assert (half["se_direct"].view(np.uint16) & 0x7F == 0).all()


@pytest.mark.parametrize(("scale", "words"), [(1e5, "above 65504"), (1e-6, "too dim")])
def test_values_beyond_float16_raise(scale, words):
    with pytest.raises(GiError, match=f"'one' .*{words}"):
        packed({"one": (rng.uniform(1, 2, (4, 4, 3)) * scale).astype(np.float32)})


# ----------------------------------------------------------------------------------------- hash, command line


def test_scene_hash():
    path = str(resource_dir("scenes") / "cornell" / "cornell_spot.glb")
    assert scene_hash(path, gi.load(path)) == scene_hash(path, Scene())  # the file's bytes alone
    scene = builtin_scene("courtyard")
    first = scene_hash("courtyard", scene)
    assert first == scene_hash("courtyard", builtin_scene("courtyard")) != scene_hash("furnace", gi.load("furnace"))
    scene.lights[0].intensity *= 2
    assert scene_hash("courtyard", scene) != first


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--size", "12"], "WIDTHxHEIGHT"),
        (["--size", "0x9"], "at least 1"),
        (["--runs", "1"], "--runs must be 2"),
        (["--spp", "3"], "--spp at least"),
        (["--seed", "-1"], "--seed"),
        (["-o", "out.png"], "npz"),
        (["-o", "nowhere/out.npz"], "no folder"),
    ],
)
def test_command_line_errors_are_one_sentence(arguments, words, capsys):
    assert main(["furnace", "-o", "out.npz", *arguments]) == 2
    error = capsys.readouterr().err
    assert error.startswith("make_references: error: ") and words in error and error.count("\n") == 1


def test_missing_mitsuba_is_named(monkeypatch, capsys, tmp_path):
    monkeypatch.setitem(__import__("sys").modules, "mitsuba", None)
    assert main(["furnace", "-o", str(tmp_path / "out.npz")]) == 2
    assert "pip install mitsuba" in capsys.readouterr().err


def test_the_oldest_usable_llvm_is_chosen(tmp_path):
    for name in ("libLLVM-15.so", "libLLVM.so.20.1", "libLLVM-19.so", "libLLVM.so", "libLLVMSupport.a"):
        (tmp_path / name).touch()
    assert find_llvm([f"{tmp_path}/libLLVM*"]) == f"{tmp_path}/libLLVM-19.so"
    with pytest.raises(GiError, match="DRJIT_LIBLLVM_PATH"):
        find_llvm([f"{tmp_path}/libLLVM-15*"])
