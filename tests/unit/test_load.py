"""The one way in: names, files, defaults, errors, and lights from the command line."""

import os

import numpy as np
import pytest

from wgpu_gi.errors import GiError
from wgpu_gi.scene.builtin import BUILTIN_SCENES
from wgpu_gi.scene.load import load, parse_light
from wgpu_gi.scene.scene import DirectionalLight, Environment, PointLight

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


@pytest.fixture
def triangle(tmp_path):
    path = tmp_path / "triangle.obj"
    path.write_text(TRIANGLE)
    return path


@pytest.mark.parametrize("name", BUILTIN_SCENES)
def test_builtin_scenes_need_no_defaults(name):
    assert load(name).notes == []


def test_a_bare_mesh_gets_a_sky_and_a_camera(triangle):
    scene = load(triangle)
    assert scene.environment.color == (1, 1, 1) and [camera.name for camera in scene.cameras] == ["framing"]
    assert len(scene.notes) == 2 and "white sky" in scene.notes[0] and "camera" in scene.notes[1]


def test_given_light_replaces_the_default(triangle):
    assert load(triangle, lights=[parse_light("sun 0,-1,0 1,1,1")]).environment is None
    sky = Environment((0.0, 0.0, 0.0))
    assert load(str(triangle), environment=sky).environment is sky
    assert load("furnace", environment=sky).environment is sky
    assert len(load("cornell-point", lights=[parse_light("point 1,1,1 1")]).lights) == 2


def test_an_emitting_material_is_light_enough(tmp_path):
    (tmp_path / "m.mtl").write_text("newmtl lamp\nKe 1 1 1\n")
    (tmp_path / "lamp.obj").write_text("mtllib m.mtl\nusemtl lamp\n" + TRIANGLE)
    assert load(tmp_path / "lamp.obj").environment is None


def test_extension_in_capitals(tmp_path, triangle):
    (tmp_path / "T.OBJ").write_text(TRIANGLE)
    assert load(tmp_path / "T.OBJ").triangle_count == 1


def test_a_file_called_like_a_builtin_scene_needs_its_extension(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cornell").write_text(TRIANGLE)
    (tmp_path / "cornell.obj").write_text(TRIANGLE)
    assert load("cornell").name == "cornell" and load("cornell").triangle_count == 38
    assert load("cornell.obj").triangle_count == 1


def test_what_is_no_scene(tmp_path):
    (tmp_path / "empty.xyz").touch()
    (tmp_path / "empty.glb").touch()
    (tmp_path / "text.txt").write_text("hello")
    (tmp_path / "plain").write_text("hello")
    (tmp_path / "folder.glb").mkdir()
    for source, sentence in [
        ("cornel", "did you mean 'cornell'"),
        ("nothing", r"cornell-point.*\.glb \.gltf \.obj"),
        ("", "folder|no built-in"),
        (tmp_path, "folder"),
        (tmp_path / "none.xyz", "does not exist"),
        (tmp_path / "none.obj", "does not exist"),
        (tmp_path / "none.glb", "does not exist"),
        (tmp_path / "empty.xyz", "empty"),
        (tmp_path / "empty.glb", "empty"),
        (tmp_path / "text.txt", r"\.txt is no scene format.*\.glb \.gltf \.obj"),
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
def test_a_device_is_not_read_for_ever(tmp_path):
    (tmp_path / "endless.ply").symlink_to("/dev/zero")
    with pytest.raises(GiError, match="not an ordinary file"):
        load(tmp_path / "endless.ply")


def test_parse_light():
    sun = parse_light("sun 0.2,-1,0 100,95,85")
    assert isinstance(sun, DirectionalLight) and list(sun.direction) == [0.2, -1.0, 0.0]
    np.testing.assert_allclose(np.multiply(sun.color, sun.intensity), [100, 95, 85])
    point = parse_light("  point 1,2,3   4e1 ")
    assert isinstance(point, PointLight) and list(point.position) == [1.0, 2.0, 3.0]
    np.testing.assert_allclose(np.multiply(point.color, point.intensity), [40, 40, 40])


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
        ("sun 0,-1,0 1,1", "three for its colour"),
        ("sun a,-1,0 1,1,1", "not a list of numbers"),
        ("sun 0,-1,0 1,,1", "not a list of numbers"),
        ("sun 0,0,0 1,1,1", "points nowhere"),
        ("sun 0,nan,0 1,1,1", "finite"),
        ("sun 0,-1,0 1,inf,1", "finite"),
        ("sun 0,-1,0 1,-1,1", "negative"),
    ],
)
def test_bad_lights(text, sentence):
    with pytest.raises(GiError, match=sentence):
        parse_light(text)
