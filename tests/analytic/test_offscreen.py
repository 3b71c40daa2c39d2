"""Off-screen light: with it, SSIL has the energy of the path tracer; a removed scene leaves none."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.techniques import SCENES, make_settings

from wgpu_gi.camera import Camera
from wgpu_gi.renderer import Renderer
from wgpu_gi.scene.built_in.scenes import closed_box
from wgpu_gi.scene.scene import Environment, Scene
from wgpu_gi.settings import assign

CACHE = "ssil.offscreen=cache"


def make(scene, *texts, frames=1, bounces=1, size=(48, 27), **fields):
    settings = make_settings("ssil", frames, bounces=bounces, diffuse=True, **fields)
    for text in ("ssil.start=half", "camera.jitter=false", *texts):
        assign(settings, text)
    return Renderer(scene, size=size, settings=settings)


def indirect(scene, *texts, **fields):
    renderer = make(scene, *texts, **fields)
    renderer.run(show=("indirect",), check=True)
    return renderer.read_back("indirect")


def test_closed_box_has_all_bounces():
    """L = L_e / (1 - rho); 2 + 2 rho of it are emission and direct light."""
    albedo = 0.8
    got = indirect(closed_box(2.0, albedo), CACHE, "ssil.bounces=8", bounces=None, frames=8, size=(32, 18))
    assert got.mean() == pytest.approx(2 / (1 - albedo) - 2 - 2 * albedo, rel=0.03)


def test_closed_box_of_ssdo_has_all_bounces_but_those_in_view():
    """SSDO's bounce is the only one off surfaces in view, 4 % of the box."""
    albedo = 0.5
    settings = make_settings("ssdo", 8, diffuse=True)
    assign(settings, "ssdo.offscreen=cache")
    renderer = Renderer(closed_box(2.0, albedo), size=(32, 18), settings=settings)
    renderer.run(show=("indirect",), check=True)
    whole = 2 / (1 - albedo) - 2 - 2 * albedo
    assert 0.93 * whole < renderer.read_back("indirect").mean() < 1.01 * whole


@pytest.mark.parametrize(("name", "bound"), [("cornell", 0.06), pytest.param("curtain", 0.15, marks=pytest.mark.slow)])
def test_room_has_the_energy_of_the_path_tracer(name, bound):
    """One bounce. Of Cornell's light the picture shows half; behind the curtain none, and little comes round it."""
    scene, size = SCENES[name](), (64, 36)
    got = indirect(scene, CACHE, frames=12, size=size)
    settings = make_settings("path", bounces=1, spp=128, diffuse=True)
    truth = Renderer(scene, size=size, settings=settings)
    truth.run(show=("indirect",))
    assert got.mean() == pytest.approx(truth.read_back("indirect").mean(), rel=bound)


def test_a_light_that_is_gone_leaves_no_trace():
    scene = SCENES["cornell-point"]()
    renderer = make(scene, CACHE, bounces=None, frames=3)
    renderer.run(show=("indirect",))
    scene.lights[0].position = np.array((2.0, 4.0, 2.0))
    renderer.run(show=("indirect",))
    assert (renderer.read_back("indirect") == indirect(scene, CACHE, bounces=None, frames=3)).all()


def test_a_still_picture_of_one_frame_needs_one_step():
    renderer = make(SCENES["cornell-point"](), CACHE)
    assert renderer.step(show=("indirect",))
    assert not renderer.step(show=("indirect",))


@pytest.mark.parametrize("lights", [(), None])
def test_dark_and_empty_scenes_are_black(lights):
    """A scene without lights, and one without triangles."""
    scene = SCENES["cornell-point"]()
    scene.lights = []
    if lights is None:
        scene = Scene([], [], Environment((1.0, 1.0, 1.0)), [Camera.look_at((0, 0, 3), (0, 0, 0))])
    assert not indirect(scene, CACHE, bounces=None).any()


def test_amortised_bounces_have_light_that_no_picture_shows():
    scene, common = SCENES["cornell-point"](), (CACHE, "ssil.visibility_bounces=all", "ssil.offscreen_rays=4")
    amortised = indirect(scene, *common, "ssil.amortised=true", bounces=None, frames=8)
    at_once = indirect(scene, *common, "ssil.bounces=8", "ssil.bounce_threshold=0", bounces=None, frames=8)
    # The cache has had the warm-up frames of amortised bounces, too: the noise differs, by 4 % at most of three seeds.
    assert amortised.mean() == pytest.approx(at_once.mean(), rel=0.06)


def test_plan_says_why_there_is_none():
    renderer = make(SCENES["cornell-point"]())
    renderer.step(show=("indirect",))
    line = next(line for line in renderer.plan().splitlines()[1:] if line.split()[0] == "ssil/offscreen")
    assert line.split()[1] == "culled" and "  ssil.offscreen is none; would add at most " in line
