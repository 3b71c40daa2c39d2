"""The viewer's playback, without a window: play, pause, seek; still pictures at rest; the command that renders one."""

from __future__ import annotations

import shlex

import numpy as np
import pytest
from helpers.animated import DIM, SLIDE, animated_scene

import wgpu_gi as gi
from wgpu_gi.__main__ import main
from wgpu_gi.options import CameraSettings, Settings
from wgpu_gi.pictures.image import load_image
from wgpu_gi.scene.built_in.scenes import BUILTIN_SCENES
from wgpu_gi.viewer import navigation, playback
from wgpu_gi.viewer.comparison import Comparison
from wgpu_gi.viewer.saving import command_of, save
from wgpu_gi.viewer.session import Session

SIZE = (64, 36)


@pytest.fixture
def clock(monkeypatch):
    """A clock of the playback that the test advances."""
    now = [64.0]
    monkeypatch.setattr(playback.time, "monotonic", lambda: now[0])
    return now


@pytest.fixture
def session(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(BUILTIN_SCENES, "slide", animated_scene)
    settings = Settings(gi="none", camera=CameraSettings(frames=2))
    return Session(gi.Renderer(animated_scene(), size=SIZE, settings=settings), source=("slide",))


def settle(session, clock):
    """Render until there is nothing to do."""
    for _ in range(100):
        clock[0] += 0.125
        if not session.step() and not session.moving:
            return
    raise AssertionError("the view does not come to rest")


def test_playing_moves_and_pausing_converges(session, clock):
    settle(session, clock)
    assert session.renderer.time is None  # as the scene stands
    session.playback.toggle()
    times = []
    for _ in range(12):
        clock[0] += 0.125
        assert session.step() and session.moving
        times.append(session.playback.time)
    assert np.allclose(times, [0.125 * (i + 1) % SLIDE for i in range(12)])
    session.playback.toggle()
    settle(session, clock)
    assert session.renderer.time == times[-1]
    expected = gi.render(session.renderer.scene, size=SIZE, settings=session.settings, time=times[-1])
    assert np.array_equal(session.values(), expected)


def test_speed_loop_and_choice(session, clock):
    settle(session, clock)
    played = session.playback
    assert played.names == ("slide", "dim") and played.name == "slide"
    played.choose("dim")
    assert (played.name, played.time, played.duration) == ("dim", 0.0, DIM)
    played.speed, played.loop = 2.0, False
    played.toggle()
    clock[0] += 0.25
    session.step()
    assert played.time == pytest.approx(0.5)
    clock[0] += 100.0  # a long frame does not skip the animation
    session.step()
    assert played.time == pytest.approx(1.5)
    clock[0] += 0.4
    session.step()
    assert played.time == DIM and not played.playing
    played.toggle()  # from the start again
    assert played.time == 0.0 and played.playing


def test_a_scene_without_animations_does_not_play(clock):
    session = Session(gi.Renderer("cornell-point", size=SIZE))
    session.playback.toggle()
    assert not session.playback.playing and session.playback.names == ()


def test_the_copied_command_and_saved_files_hold_the_time(session, clock, tmp_path):
    from PIL import Image

    settle(session, clock)
    assert "--at" not in command_of(session)
    session.playback.choose("slide")
    session.playback.seek(0.625)
    session.camera = navigation.orbit(session.camera, session.pivot, 0.2, 0.0)
    settle(session, clock)
    command = command_of(session, "view.npy")
    assert "--at 0.625 --animation=slide" in command
    assert main(shlex.split(command)[1:]) == 0
    assert (np.abs(load_image("view.npy") - session.values()) > 1e-3).mean() < 0.01  # the command rounds the camera
    session.playback.toggle()
    with Image.open(save(session, tmp_path)[0]) as picture:
        assert f"--at {session.renderer.time!r}" in picture.text["command"]
    assert not session.playback.playing


def test_a_followed_camera_turns_from_where_it_is(session, clock):
    rider = session.renderer.scene.cameras[1]
    session.camera = rider
    session.playback.seek(SLIDE)
    assert np.allclose(session.camera.position, (0.5, 1, 4))
    session.camera = navigation.look(session.camera, 0.1, 0.0)
    session.playback.seek(0.0)
    assert np.allclose(session.camera.position, (0.5, 1, 4))  # no longer the animation's


def test_the_truth_beside_it_has_the_same_pose(session, clock):
    comparison = Comparison(session)
    comparison.mode = "split"
    session.playback.seek(0.9)
    settle(session, clock)
    assert comparison.step(lambda fraction: None)
    poses = [
        np.array([instance.world_from_local for instance in renderer.posed_scene.instances])
        for renderer in (comparison._renderer, session.renderer)
    ]
    assert np.array_equal(*poses)
