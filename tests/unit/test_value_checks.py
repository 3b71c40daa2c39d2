"""Wrong and extreme values in every field of scenes and cameras: one sentence names the field, or there is no fault."""

from __future__ import annotations

import re
import time

import numpy as np
import pytest
from helpers.values import changes, everything

from wgpu_gi.camera import Camera
from wgpu_gi.errors import GiError
from wgpu_gi.options import Settings, check_size
from wgpu_gi.scene.built_in.shapes import box
from wgpu_gi.scene.check import check_camera, check_scene
from wgpu_gi.scene.scene import Instance, Scene
from wgpu_gi.settings import validate

CHANGES = list(changes())


def test_the_unchanged_scene_is_correct():
    scene, camera = everything()
    check_scene(scene)
    check_camera(camera)


@pytest.mark.parametrize("path", dict.fromkeys(change.path for change in CHANGES))
def test_wrong_values_are_named(path):
    """Extreme values may be refused as well, in the same words."""
    for change in CHANGES:
        if change.path != path:
            continue
        scene, camera = change.apply()
        try:
            check_camera(camera)
            check_scene(scene)
            assert not change.wrong, f"{change} is accepted"
        except GiError as error:
            message = str(error)
            assert "\n" not in message and len(message) < 300, message
            # An index into a list, or a relation, is named at the field that it concerns.
            names = {path, *(other for other in RELATED.get(path.rpartition(".")[2], ()))}
            assert any(name in message for name in names), f"{change}: {message}"


RELATED = {
    "color": (".intensity", "color"),
    "image": (".color", ".image"),
    "outer_cone_angle": ("inner_cone_angle",),
    "positions": ("scene.instances[0].mesh", "world_from_local"),
    "material_of_triangle": ("scene.instances[0].mesh",),
    "cameras": ("scene.cameras",),
    "joints": ("joint_matrices",),
    "weights": ("skin.weights",),
    "times": ("track.values",),
    "interpolation": ("track.values",),
    "values": ("track.times",),
    "skin": ("joint_matrices",),
    "morph_targets": ("morph_weights",),
}


def test_there_are_many():
    assert len(CHANGES) > 700 and sum(change.wrong for change in CHANGES) > 450


@pytest.mark.parametrize("value", [None, 5, "cornell", [], Scene, object()])
def test_scenes_and_cameras_of_other_types(value):
    with pytest.raises(GiError, match="the scene must be a Scene"):
        check_scene(value)
    with pytest.raises(GiError, match="camera must be a Camera"):
        check_camera(value)


@pytest.mark.parametrize(
    "size",
    [None, 5, "16x9", (16,), (16, 9, 3), (16.5, 9), ("a", 9), (0, 9), (-1, 9), (10**400, 9), (None, 9), (True, 9)],
)
def test_sizes(size):
    with pytest.raises(GiError, match=r"^size "):
        check_size(size)


@pytest.mark.parametrize(
    "change",
    [
        {"position": (0, 0, 1e300)},
        {"position": (0, 0, np.nan)},
        {"position": None},
        {"position": "abc"},
        {"position": (0, 0, 0)},
        {"target": [[0, 0, 0]]},
        {"target": (1, 2)},
        {"up": (0, np.inf, 0)},
        {"up": object()},
        {"yfov_deg": 1e-300},
        {"yfov_deg": 1e-40},
        {"yfov_deg": 180},
        {"yfov_deg": "60"},
        {"yfov_deg": None},
        {"yfov_deg": np.nan},
    ],
)
def test_look_at(change):
    with pytest.raises(GiError, match=next(iter(change))):
        Camera.look_at(**({"position": (0, 0, 5), "target": (0, 0, 0)} | change))


@pytest.mark.parametrize("up", [(0, 0, 0), (0, 0, 1), (0, 1e-200, 0), (0, 1e300, 1e300), (1e-300, 0, 1)])
def test_look_at_with_any_up(up):
    check_camera(Camera.look_at((0, 0, 5), (0, 0, 0), up))


def test_sections_of_settings():
    settings = Settings()
    settings.camera = None
    with pytest.raises(GiError, match="camera must be CameraSettings"):
        validate(settings)


def test_a_mesh_is_checked_once():
    """Arrays are immutable once in use, so later checks cost little."""
    mesh = box((0, 0, 0), (1, 1, 1))
    mesh.positions = np.random.default_rng(0).random((1_000_000, 3)).astype(np.float32)
    scene = Scene([Instance(mesh) for _ in range(100)])
    first = time.process_time()
    check_scene(scene)
    second = time.process_time()
    check_scene(scene)
    assert time.process_time() - second < (second - first) / 2


def test_names_appear_in_messages():
    scene, _ = everything()
    scene.lights[1].intensity = -1
    sentence = "scene.lights[1].intensity must be a number from 0 to 1e+20, not -1 (spotlight 'spot')"
    with pytest.raises(GiError, match=f"^{re.escape(sentence)}$"):
        check_scene(scene)
