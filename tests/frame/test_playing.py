"""A Renderer at a time of an animation: equal to the posed scene; edits, cameras and lights follow."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers.animated import DIM, SLIDE, animated_scene

import wgpu_gi as gi
from wgpu_gi.options import CameraSettings, Settings

SIZE = (32, 18)
SETTINGS = {"size": SIZE, "settings": Settings(gi="none", camera=CameraSettings(frames=2))}


@pytest.fixture
def scene():
    return animated_scene()


def still(scene, time, animation=None, camera=0):
    """Render the posed scene by a renderer of its own."""
    return gi.render(scene.at(time, animation), camera=camera, **SETTINGS)


def picture(renderer):
    renderer.run()
    return renderer.read_back()


def test_a_renderer_shows_the_scene_at_its_time(scene):
    with gi.Renderer(scene, **SETTINGS) as renderer:
        rest = picture(renderer)
        for time in (0.0, 0.7, 0.2):
            renderer.time = time
            # A moved instance keeps its place in the tables, so positions may differ in their last bit.
            assert np.allclose(picture(renderer), still(scene, time), rtol=1e-6, atol=1e-6), time
        renderer.animation, renderer.time = "dim", DIM
        assert np.array_equal(picture(renderer), still(scene, DIM, 1))
        renderer.time = None
        assert np.array_equal(picture(renderer), rest)
    assert np.array_equal(gi.render(scene, time=0.7, **SETTINGS), still(scene, 0.7))
    assert np.array_equal(gi.render(scene, animation="dim", **SETTINGS), still(scene, 0.0, "dim"))


def test_the_same_time_restarts_nothing(scene):
    with gi.Renderer(scene, **SETTINGS) as renderer:
        renderer.time = 0.5
        renderer.run()
        renderer.time, renderer.animation = 0.5, "slide"
        while renderer.step():
            assert renderer._gpu.index > 0


def test_edits_are_seen_while_an_animation_plays(scene):
    wall = next(instance for instance in scene.instances if instance.name == "wall")
    floor = next(instance for instance in scene.instances if instance is not wall)
    beside = np.eye(4)
    beside[0, 3] = 1.0
    with gi.Renderer(scene, **SETTINGS) as renderer:
        renderer.time = 0.5
        before = picture(renderer)
        for edit in (
            lambda: floor.world_from_local.__setitem__((1, 3), -0.2),
            lambda: wall.mesh.materials.__setitem__(0, gi.Material(base_color=(0.9, 0.1, 0.1, 1.0))),
            lambda: setattr(wall.mesh.materials[0], "base_color", (0.1, 0.9, 0.1, 1.0)),
            lambda: scene.lights.append(gi.PointLight((-1, 1, 2), 10.0)),
            lambda: setattr(scene.lights[0], "intensity", 5.0),
            lambda: scene.instances.append(gi.Instance(wall.mesh, beside)),
            lambda: setattr(scene, "environment", gi.Environment((0.2, 0.3, 0.4))),
        ):
            edit()
            now = picture(renderer)
            assert not np.array_equal(now, before)
            assert np.array_equal(now, still(scene, 0.5))
            before = now
        renderer.time = 0.9
        assert np.array_equal(picture(renderer), still(scene, 0.9))


@pytest.mark.parametrize("camera", ["rider", 1])
def test_a_camera_of_the_scene_follows_the_animation(scene, camera):
    with gi.Renderer(scene, camera=camera, **SETTINGS) as renderer:
        start = renderer.camera.position.copy()
        renderer.time = SLIDE
        assert np.array_equal(picture(renderer), still(scene, SLIDE, camera=1))
        assert np.allclose(renderer.posed_camera.position - start, (0.5, 0, 0))
        assert np.array_equal(renderer.camera.position, start)
        assert renderer.posed_scene.lights[0] is scene.lights[0]


def test_motion_leads_back_to_the_previous_time(scene):
    """The wall moves to the right by 0.1 s of its way, as seen from 4 m."""
    with gi.Renderer(scene, size=SIZE, settings=Settings(gi="none", camera=CameraSettings(jitter=False))) as renderer:
        for time in (0.4, 0.5):
            renderer.time = time
            renderer.step(show=("motion", "instance"))
        motion, instance = renderer.read_back("motion"), renderer.read_back("instance")
    number = 1 + [i.name for i in scene.instances].index("wall")
    on_wall = instance == number
    assert on_wall.sum() > 5
    pixels = 0.08 / 4 / math.tan(0.45) * SIZE[1] / 2
    assert np.allclose(motion[on_wall][:, :2], (pixels, 0), atol=0.02)
    assert np.allclose(motion[~on_wall & (instance > 0)][:, :2], 0, atol=1e-3)


def test_nothing_has_moved_in_the_first_frame_after_forgetting(scene):
    with gi.Renderer(scene, **SETTINGS) as renderer:
        for time in (0.2, 0.6):
            renderer.forget()
            renderer.time = time
            renderer.step(show=("motion",))
            assert np.abs(renderer.read_back("motion")[..., :2]).max() < 1e-3


def test_a_time_outside_shows_the_nearest_pose_and_says_so(scene):
    with pytest.warns(gi.GiWarning, match="'slide' lasts from 0 to 1 s, so 7 s shows its last pose"):
        late = gi.render(scene, time=7, **SETTINGS)
    assert np.array_equal(late, still(scene, SLIDE))


@pytest.mark.parametrize("gi_name", ["many-light", "path"])
@pytest.mark.slow
def test_every_technique_follows(scene, gi_name):
    settings = Settings(gi=gi_name, spp=2, camera=CameraSettings(frames=2))
    with gi.Renderer(scene, size=SIZE, settings=settings) as renderer:
        renderer.time = 0.1
        renderer.run()
        renderer.time = 0.9
        renderer.run()
        moved = renderer.read_back()
    assert np.allclose(moved, gi.render(scene.at(0.9), size=SIZE, settings=settings), rtol=1e-4, atol=1e-5)
