"""Cameras that move from frame to frame: turntables and keyframes."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from wgpu_gi.camera import Camera
from wgpu_gi.errors import GiError
from wgpu_gi.scene.built_in.shapes import box
from wgpu_gi.scene.files.camera_paths import load_camera_path, turntable
from wgpu_gi.scene.scene import Instance, Scene

KEY = {"frame": 0, "position": [0, 1, 5], "target": [0, 1, 0]}


def path_of(tmp_path, *keys):
    file = tmp_path / "path.json"
    file.write_text(json.dumps(list(keys)))
    return load_camera_path(file)


def test_turntable_circles_the_middle_of_the_scene():
    scene = Scene([Instance(box((1, 0, 1), (3, 2, 3)))])
    low, high = scene.bounds()
    centre = (low + high) / 2
    start = Camera.look_at(centre + np.array((0, 1, 4)), centre)
    at = turntable(start, scene, range(10, 18))
    assert np.allclose(at(10).world_from_view, start.world_from_view)
    assert np.allclose(at(18).world_from_view, start.world_from_view)
    assert np.allclose(
        at(12).position, centre + np.array((4, 1, 0))
    )  # a quarter of a turn, counter-clockwise from above
    for frame in range(10, 18):
        camera = at(frame)
        offset = centre - camera.position
        assert np.allclose(-camera.world_from_view[:3, 2], offset / np.linalg.norm(offset))


def test_camera_path_passes_its_keys_smoothly(tmp_path):
    positions = [(0, 1, 5), (2, 1, 4), (3, 2, 0)]
    frames = [0, 10, 30]
    keys = [{**KEY, "frame": f, "position": p, "yfov_deg": 40 + f} for f, p in zip(frames, positions, strict=True)]
    at = path_of(tmp_path, *keys)
    for frame, position in zip(frames, positions, strict=True):
        assert np.allclose(at(frame).position, position)
        assert math.isclose(at(frame).yfov, math.radians(40 + frame))
    assert np.allclose(at(-5).position, positions[0])
    assert np.allclose(at(99).position, positions[-1])
    steps = np.diff([at(frame).position for frame in range(31)], axis=0)
    assert np.linalg.norm(np.diff(steps, axis=0), axis=1).max() < 0.1  # metres per frame, from frame to frame


def test_straight_keys_make_a_straight_line(tmp_path):
    at = path_of(tmp_path, KEY, {**KEY, "frame": 4, "position": [4, 1, 5]})
    assert [at(frame).position[0] for frame in range(5)] == pytest.approx([0, 1, 2, 3, 4])


def test_one_key_stands_still(tmp_path):
    assert np.allclose(path_of(tmp_path, KEY)(7).position, (0, 1, 5))


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ([], "a list of keys"),
        ([[1]], "key 0: the field 'frame'"),
        ([{**KEY, "frame": 1.5}], "key 0: the field 'frame'"),
        ([{**KEY, "frame": True}], "key 0: the field 'frame'"),
        ([KEY, {"frame": 3, "position": [0, 1, 5]}], "key 1: the field 'target' is missing"),
        ([{**KEY, "fov": 3}], "unknown field 'fov'"),
        ([KEY, KEY], "frame 0 comes after frame 0"),
        ([{**KEY, "position": [0, 1, 0]}], "the same point"),
    ],
)
def test_wrong_camera_paths_raise(tmp_path, keys, message):
    with pytest.raises(GiError, match=message):
        path_of(tmp_path, *keys)


def test_camera_at_its_target_raises_with_the_frame(tmp_path):
    at = path_of(tmp_path, KEY, {"frame": 10, "position": [0, 1, -5], "target": [0, 1, 0]})
    with pytest.raises(GiError, match="frame 5"):
        at(5)
