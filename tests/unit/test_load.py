"""Loading by names and files, defaults, errors, and lights from text."""

import os

import numpy as np
import pytest
from unit.gltf_builder import GltfBuilder

from wgpu_gi.errors import GiError
from wgpu_gi.scene.built_in.scenes import BUILTIN_SCENES
from wgpu_gi.scene.default_sky import GROUND, default_sky
from wgpu_gi.scene.files.light_texts import light_texts, parse_light, relight
from wgpu_gi.scene.gltf.write import save_glb
from wgpu_gi.scene.load import load
from wgpu_gi.scene.scene import DirectionalLight, Environment, PointLight, Scene, SpotLight

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


@pytest.fixture
def triangle(tmp_path):
    path = tmp_path / "triangle.obj"
    path.write_text(TRIANGLE)
    return path


@pytest.mark.parametrize("name", BUILTIN_SCENES)
def test_builtin_scenes_need_no_defaults(name):
    assert load(name).notes == []


def test_a_mesh_file_gets_a_sky_and_a_camera(triangle):
    scene = load(triangle)
    assert scene.environment.color == (1, 1, 1) and [camera.name for camera in scene.cameras] == ["framing"]
    assert len(scene.notes) == 2 and "overcast sky" in scene.notes[0] and "camera" in scene.notes[1]


def test_the_default_sky_gives_level_ground_the_irradiance_pi_and_shows_white_walls():
    """The sum of L cos over the texels above the horizon; the CIE overcast sky is three times as bright at the zenith.

    A white wall has half the radiance of the ground and 0.396 of the sky's irradiance: more than the ground behind it.
    """
    image = default_sky().image[..., 0].astype(np.float64)
    rows, columns = image.shape
    angle = np.pi * (np.arange(rows) + 0.5) / rows
    weight = np.sin(angle) * (np.pi / rows) * (2 * np.pi / columns)
    level = (image * (weight * np.maximum(np.cos(angle), 0))[:, None]).sum()
    assert level == pytest.approx(np.pi, rel=1e-3)
    assert image[0, 0] / image[rows // 2 - 1, 0] == pytest.approx(3, rel=0.06)  # half a row from each end
    turn = 2 * np.pi * (np.arange(columns) + 0.5) / columns
    wall = (image * (weight * np.sin(angle))[:, None] * np.maximum(np.cos(turn), 0)).sum() / np.pi
    assert wall == pytest.approx(0.396 + GROUND / 2, rel=0.01) and wall > 2 * GROUND


def test_given_light_replaces_the_default(triangle):
    assert load(triangle, lights=[parse_light("sun 0,-1,0 1,1,1")]).environment is None
    sky = Environment((0.0, 0.0, 0.0))
    assert load(str(triangle), environment=sky).environment is sky
    assert load("furnace", environment=sky).environment is sky
    assert len(load("cornell-point", lights=[parse_light("point 1,1,1 1")]).lights) == 2


def test_an_emitter_prevents_the_default_sky(tmp_path):
    (tmp_path / "m.mtl").write_text("newmtl lamp\nKe 1 1 1\n")
    (tmp_path / "lamp.obj").write_text("mtllib m.mtl\nusemtl lamp\n" + TRIANGLE)
    assert load(tmp_path / "lamp.obj").environment is None


@pytest.mark.parametrize(
    ("emission", "textured", "sky"),
    [
        ((0.0, 0.5, 0.0), False, True),
        ((1.0, 1.0, 1.0), True, True),
        ((1.0, 1.0, 1.0), False, False),
        ((2, 0, 0), True, False),
    ],
)
def test_a_gltf_file_whose_surfaces_only_glow_gets_the_default_sky(tmp_path, emission, textured, sky):
    """A helmet with a display is shown by daylight; a lamp that emits more than 1, or 1 all over, is a light."""
    builder = GltfBuilder()
    keys = {"emissiveFactor": [min(value, 1.0) for value in emission]}
    if textured:
        keys["emissiveTexture"] = {"index": builder.texture(np.full((2, 2, 3), 9, np.uint8))}
    keys["extensions"] = {"KHR_materials_emissive_strength": {"emissiveStrength": max(1.0, *emission)}}
    builder.node(mesh=builder.mesh(builder.primitive(material=builder.material(**keys))))
    path = builder.glb(tmp_path)
    scene = load(path)
    assert (scene.environment is not None) == sky and any("glow" in note for note in scene.notes) == sky
    assert load(path, lights=[parse_light("point 0,0,1 1")]).environment is None
    saved = tmp_path / "saved.glb"
    scene.environment = None
    given = save_glb(saved, scene)
    assert given == ("0,0,0" if sky else None)


def test_extension_in_capitals(tmp_path, triangle):
    (tmp_path / "T.OBJ").write_text(TRIANGLE)
    assert load(tmp_path / "T.OBJ").triangle_count == 1


def test_a_file_named_like_a_builtin_scene_needs_its_extension(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cornell").write_text(TRIANGLE)
    (tmp_path / "cornell.obj").write_text(TRIANGLE)
    assert load("cornell").name == "cornell" and load("cornell").triangle_count == 38
    assert load("cornell.obj").triangle_count == 1


def test_wrong_sources_raise(tmp_path):
    (tmp_path / "empty.xyz").touch()
    (tmp_path / "empty.glb").touch()
    (tmp_path / "text.txt").write_text("hello")
    (tmp_path / "plain").write_text("hello")
    (tmp_path / "folder.glb").mkdir()
    for source, sentence in [
        ("cornel", "did you mean cornell"),
        ("nothing", r"cornell-point.*\.glb \.gltf \.obj"),
        ("", "folder|no built-in"),
        (tmp_path, "folder"),
        (tmp_path / "none.xyz", "does not exist"),
        (tmp_path / "none.obj", "does not exist"),
        (tmp_path / "none.glb", "does not exist"),
        (tmp_path / "empty.xyz", "empty"),
        (tmp_path / "empty.glb", "empty"),
        (tmp_path / "text.txt", r"\.txt is not a supported scene format.*\.glb \.gltf \.obj"),
        (tmp_path / "plain", "without extension"),
        (tmp_path / "folder.glb", "folder"),
        ("x" * 5000, "no built-in|cannot be read"),
        ("nul\0", "no built-in|cannot be read|does not exist"),
        ("nul\0.ply", "cannot be read|does not exist"),
    ]:
        with pytest.raises(GiError, match=sentence) as caught:
            load(source)
        assert "\n" not in str(caught.value)


@pytest.mark.skipif(not os.path.exists("/dev/zero"), reason="needs a device file")
def test_a_device_file_raises(tmp_path):
    (tmp_path / "endless.ply").symlink_to("/dev/zero")
    with pytest.raises(GiError, match="not a regular file"):
        load(tmp_path / "endless.ply")


def test_parse_light():
    sun = parse_light("sun 0.2,-1,0 100,95,85")
    assert isinstance(sun, DirectionalLight) and list(sun.direction) == [0.2, -1.0, 0.0]
    np.testing.assert_allclose(np.multiply(sun.color, sun.intensity), [100, 95, 85])
    point = parse_light("  point 1,2,3   4e1 ")
    assert isinstance(point, PointLight) and list(point.position) == [1.0, 2.0, 3.0]
    np.testing.assert_allclose(np.multiply(point.color, point.intensity), [40, 40, 40])


def test_parse_spots():
    spot = parse_light("spot 1,2,3 0,-2,0 10,20,30 30,15")
    assert isinstance(spot, SpotLight) and (list(spot.position), list(spot.direction)) == ([1, 2, 3], [0, -2, 0])
    assert (spot.intensity, spot.color) == (1.0, (10, 20, 30))
    assert np.degrees([spot.outer_cone_angle, spot.inner_cone_angle]) == pytest.approx([30, 15])
    spot = parse_light("spot 0,1,0 0,-1,0 5")
    assert (spot.color, spot.outer_cone_angle, spot.inner_cone_angle) == ((5, 5, 5), pytest.approx(np.pi / 4), 0)
    assert parse_light("spot 0,1,0 0,-1,0 5 20").outer_cone_angle == pytest.approx(np.radians(20))


def relit() -> Scene:
    lights = [
        PointLight((0, 1, 0), 2.0, (1.0, 0.5, 0.0), name="lamp"),
        DirectionalLight((0, -1, 0), name="the sun = 1"),
    ]
    return Scene(lights=lights, environment=Environment((1.0, 1.0, 1.0)))


def test_relight():
    scene = relit()
    relight(scene, "lamp=3,2,1")
    assert np.multiply(scene.lights[0].color, scene.lights[0].intensity) == pytest.approx([3, 2, 1])
    relight(scene, "0=5")
    assert np.multiply(scene.lights[0].color, scene.lights[0].intensity) == pytest.approx([5, 5, 5])
    relight(scene, "the sun = 1=1,2,3 1,-1,0")
    assert (scene.lights[1].color, list(scene.lights[1].direction)) == ((1.0, 2.0, 3.0), [1.0, -1.0, 0.0])
    relight(scene, "env=0.1,0.2,0.3 90")
    assert scene.environment.color == (0.1, 0.2, 0.3)
    assert scene.environment.rotation == pytest.approx(np.pi / 2)


def test_light_texts_restore_the_lights():
    scene, other = relit(), relit()
    scene.lights[0].intensity, scene.lights[0].color = 0.123456789, (0.3, 0.2, 0.1)
    scene.lights[1].direction, scene.environment.rotation = (0.6, -0.8, 0.0), -1.0
    for text in light_texts(scene):
        relight(other, text)
    assert light_texts(other) == light_texts(scene)
    assert light_texts(scene)[0] == "0=0.0370370367,0.0246913578,0.0123456789"


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "not understood"),
        ("lamp", "not understood"),
        ("=1", "not understood"),
        ("lamp=", "not understood"),
        ("lamp=1 2 3", "not understood"),
        ("lamp=1,1", "one number or three for its colour"),
        ("lamp=1,-1,1", "negative"),
        ("lamp=1,x,1", "not a list of numbers"),
        ("lamp=1,nan,1", "finite"),
        ("lamp=1 0,-1,0", "only suns have a direction"),
        ("1=1 0,-1", "three numbers for its direction"),
        ("1=1 0,0,0", "points nowhere"),
        ("2=1", "this scene has 0 'lamp', 1 'the sun = 1', env"),
        ("env=1 0,1,0", "one number, in degrees"),
    ],
)
def test_bad_changes_of_lights(text, sentence):
    with pytest.raises(GiError, match=sentence):
        relight(relit(), text)


def test_no_environment_to_change():
    with pytest.raises(GiError, match="there is no light 'env'; this scene has none"):
        relight(Scene(), "env=1")


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "not understood"),
        ("sun", "not understood"),
        ("sun 0,-1,0", "not understood"),
        ("moon 0,-1,0 1,1,1", "not understood"),
        ("sun 0, -1, 0 1,1,1", "not understood"),
        ("sun 0,-1 1,1,1", "three numbers for its direction"),
        ("point 0,-1 1,1,1", "three numbers for its position"),
        ("sun 0,-1,0 1,1", "one number or three for its colour"),
        ("sun a,-1,0 1,1,1", "not a list of numbers"),
        ("sun 0,-1,0 1,,1", "not a list of numbers"),
        ("sun 0,0,0 1,1,1", "points nowhere"),
        ("sun 0,nan,0 1,1,1", "finite"),
        ("sun 0,-1,0 1,inf,1", "finite"),
        ("sun 0,-1,0 1,-1,1", "negative"),
        ("spot 0,1,0 0,-1,0", "not understood"),
        ("spot 0,1,0 0,0,0 1", "points nowhere"),
        ("spot 0,1,0 0,-1,0 1 0", "OUTER,INNER with 0 <= INNER <= OUTER <= 90"),
        ("spot 0,1,0 0,-1,0 1 20,30", "OUTER,INNER"),
        ("spot 0,1,0 0,-1,0 1 91", "OUTER,INNER"),
        ("spot 0,1,0 0,-1,0 1 20,10,5", "OUTER,INNER"),
    ],
)
def test_bad_lights(text, sentence):
    with pytest.raises(GiError, match=sentence):
        parse_light(text)


def test_strict_loading_refuses_damage_but_not_approximation(tmp_path):
    path = tmp_path / "a.obj"
    path.write_text("mtllib missing.mtl\n" + TRIANGLE)
    assert "missing.mtl" in load(path).notes[0]
    with pytest.raises(GiError, match=r"missing\.mtl.*--strict"):
        load(path, strict=True)
    path.write_text(TRIANGLE + "f 1 2 2\n")
    assert "degenerate" in load(path, strict=True).notes[0]
