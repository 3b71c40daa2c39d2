"""Cameras: the pose, valid and wrong JSON files, framing, and selection by name, index or file."""

import json
import math

import numpy as np
import pytest

from wgpu_gi.camera import Camera
from wgpu_gi.errors import GiError
from wgpu_gi.scene.auto_camera import framing_camera
from wgpu_gi.scene.built_in.shapes import box
from wgpu_gi.scene.files.camera_files import camera_of, choose_camera, load_camera
from wgpu_gi.scene.scene import Instance, Scene


def in_view(camera, point):
    """View-space coordinates of a world point."""
    return np.linalg.inv(camera.world_from_view) @ [*point, 1.0]


def test_look_at_puts_the_target_on_minus_z():
    camera = Camera.look_at((1, 2, 3), (4, -1, 7), yfov_deg=50)
    view = in_view(camera, (4, -1, 7))
    np.testing.assert_allclose(view[:2], 0, atol=1e-12)
    assert view[2] == pytest.approx(-math.sqrt(34))
    np.testing.assert_allclose(camera.world_from_view[:3, :3] @ camera.world_from_view[:3, :3].T, np.eye(3), atol=1e-12)
    assert np.linalg.det(camera.world_from_view) == pytest.approx(1.0)
    assert in_view(camera, (1, 3, 3))[1] > 0 and camera.yfov == pytest.approx(math.radians(50))


@pytest.mark.parametrize("target", [(0, -1, 0), (0, 1, 0)])
def test_look_along_up_is_a_rotation(target):
    rotation = Camera.look_at((0, 0, 0), target).world_from_view[:3, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)


def test_load_camera(tmp_path):
    path = tmp_path / "front.json"
    path.write_text(json.dumps({"position": [0, 1, 5], "target": [0, 1, 0], "up": [1, 0, 0], "yfov_deg": 35}))
    camera = load_camera(path)
    expected = Camera.look_at((0, 1, 5), (0, 1, 0), (1, 0, 0), 35)
    np.testing.assert_array_equal(camera.world_from_view, expected.world_from_view)
    assert camera.yfov == expected.yfov and camera.name == "front"
    path.write_text('\ufeff{"position": [0, 1, 5], "target": [0, 1, 0]}')
    assert load_camera(path).yfov == pytest.approx(math.radians(60))


GOOD = {"position": [0, 1, 5], "target": [0, 1, 0]}
BAD_CAMERAS = [
    ("", "empty"),
    ("{", "not JSON"),
    ("[" * 100000, "not JSON"),
    (b"\xff\xfe\x00", "not JSON"),
    ("[1, 2]", "must hold an object"),
    ("null", "must hold an object"),
    ({"position": [0, 1, 5]}, "'target' is missing"),
    ({"target": [0, 1, 5]}, "'position' is missing"),
    (GOOD | {"fov": 30}, "unknown field 'fov'"),
    (GOOD | {"position": [0, 1]}, "'position' must be three"),
    (GOOD | {"position": "0 1 5"}, "'position' must be three"),
    (GOOD | {"position": [0, True, 5]}, "'position' must be three"),
    (GOOD | {"position": [0, None, 5]}, "'position' must be three"),
    (GOOD | {"target": [0, math.nan, 5]}, "'target' must be three"),
    (GOOD | {"target": [0, math.inf, 5]}, "'target' must be three"),
    (GOOD | {"target": [0, 10**400, 5]}, "'target' must be three"),
    (GOOD | {"up": [0, 0, 0]}, "'up' must have a direction"),
    (GOOD | {"up": None}, "'up' must be three"),
    (GOOD | {"yfov_deg": 0}, "'yfov_deg'"),
    (GOOD | {"yfov_deg": 180}, "'yfov_deg'"),
    (GOOD | {"yfov_deg": "60"}, "'yfov_deg'"),
    (GOOD | {"yfov_deg": math.nan}, "'yfov_deg'"),
    (GOOD | {"target": [0, 1, 5]}, "same point"),
]


@pytest.mark.parametrize(("content", "sentence"), BAD_CAMERAS)
def test_bad_camera_files_name_the_field(tmp_path, content, sentence):
    path = tmp_path / "bad.json"
    text = json.dumps(content) if isinstance(content, dict) else content
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(GiError, match=sentence) as caught:
        load_camera(path)
    assert "bad.json" in str(caught.value) and "\n" not in str(caught.value)


def test_missing_camera_file(tmp_path):
    with pytest.raises(GiError, match="does not exist"):
        load_camera(tmp_path / "none.json")


def scene_of(low, high, at=(0.0, 0.0, 0.0)):
    world_from_local = np.eye(4)
    world_from_local[:3, 3] = at
    return Scene(instances=[Instance(box(low, high), world_from_local)])


@pytest.mark.parametrize("size", [(1, 1, 1), (100, 1, 1), (0.01, 2, 0.01), (1, 0, 1), (1e-6, 1e-6, 1e-6)])
@pytest.mark.parametrize("at", [(0, 0, 0), (1e7, -2e7, 3e6)])
def test_framing_camera_sees_every_corner(size, at):
    scene = scene_of((0, 0, 0), size, at)
    camera = framing_camera(scene)
    low, high = scene.bounds()
    slope = math.tan(camera.yfov / 2)
    extents = []
    for i in range(8):
        x, y, z = in_view(camera, [(low, high)[i >> a & 1][a] for a in range(3)])[:3]
        assert z < 0
        extents.append(max(abs(x), abs(y)) / (-z * slope))
    # All are inside, and the outermost are near the border.
    assert 0.8 < max(extents) < 1
    assert camera.position[1] > high[1]


def test_framing_camera_of_an_empty_scene_and_of_a_point():
    assert np.isfinite(framing_camera(Scene()).world_from_view).all()
    camera = framing_camera(scene_of((2, 2, 2), (2, 2, 2)))
    assert np.linalg.norm(camera.position - 2) == pytest.approx(1.0)


def test_choose_camera(tmp_path, monkeypatch):
    scene = Scene(cameras=[Camera(name="left"), Camera(name="right"), Camera(name="0"), Camera(name="left"), Camera()])
    left, right, named_zero, _, nameless = scene.cameras
    assert choose_camera(scene) is left and choose_camera(scene, "left") is left
    assert (
        choose_camera(scene, "right") is right
        and choose_camera(scene, 1) is right
        and choose_camera(scene, "1") is right
    )
    assert choose_camera(scene, "0") is named_zero and choose_camera(scene, 0) is left
    assert choose_camera(scene, 4) is nameless
    (tmp_path / "top.json").write_text(json.dumps(GOOD))
    assert choose_camera(scene, "top.json", tmp_path).name == "top"
    monkeypatch.chdir(tmp_path)
    assert choose_camera(scene, "top.json").name == "top"
    with pytest.raises(GiError, match="does not exist"):
        choose_camera(scene, "none.json", tmp_path)


@pytest.mark.parametrize("selector", ["up", 5, "-1", -1, "", "1.5"])
def test_unknown_camera_lists_the_known(selector):
    with pytest.raises(GiError, match="0 'left', 1 'right'"):
        choose_camera(Scene(cameras=[Camera(name="left"), Camera(name="right")]), selector)


def test_choose_camera_in_a_scene_without_cameras():
    scene = scene_of((0, 0, 0), (1, 1, 1))
    assert choose_camera(scene).name == choose_camera(scene, 0).name == "framing"


def test_automatic_views_by_name():
    """A camera of the scene with such a name comes first."""
    room = Scene([Instance(box((0, 0, 0), (6, 3, 4), inward=True))], cameras=[Camera(name="door")])
    assert choose_camera(room).name == "door" and choose_camera(room, "auto").name == "inside"
    assert choose_camera(room, "inside").name == "inside"
    ball = scene_of((0, 0, 0), (1, 1, 1))
    assert choose_camera(ball, "auto").name == "framing"
    own = Camera(name="auto")
    assert choose_camera(Scene(cameras=[Camera(name="door"), own]), "auto") is own


def test_a_dictionary_is_a_camera():
    camera = camera_of(Scene(), {"position": (0, 1, 5), "target": np.array([0, 1, 0]), "yfov_deg": 35})
    assert np.array_equal(camera.position, (0, 1, 5)) and camera.yfov == pytest.approx(math.radians(35))
    with pytest.raises(GiError, match="camera: unknown field 'fov'"):
        camera_of(Scene(), {"position": (0, 1, 5), "target": (0, 1, 0), "fov": 35})
