"""Techniques on a posed frame of the moving scene `walk`, against its path-traced light.

`poses/` holds the light of the scene at 2.8 s, its figure baked on the CPU: direct, one bounce, and one bounce from
visible surfaces only. 96x54, 2048 samples per pixel, diffuse, pixel centres; its noise is a relMSE of 0.0006 (one
bounce) and 0.003 (from visible surfaces).
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from helpers.marks import slow_but

from wgpu_gi.measure.metrics import bias, relmse
from wgpu_gi.renderer import Renderer, Settings
from wgpu_gi.scene.built_in.walk import walk
from wgpu_gi.scene.player import Player

SIZE, TIME, RATE = (96, 54), 2.8, 30.0
FIGURE = "figure"


@cache
def truth():
    with np.load(Path(__file__).parent / "poses" / "walk_96x54.npz") as file:
        return {name: file[name].astype(np.float32) for name in file.files}


def settings_of(gi, frames=16, spp=64):
    settings = Settings(gi=gi, diffuse=True, bounces=1, spp=spp)
    settings.camera.jitter, settings.camera.frames = False, frames
    return settings


@cache
def still(gi, visible_only=False):
    """Return direct light, one bounce, and the pixels that show the figure."""
    scene = walk().at(TIME)
    settings = settings_of(gi)
    settings.path.visible_only = visible_only
    with Renderer(scene, size=SIZE, camera=scene.cameras[0], settings=settings) as renderer:
        renderer.run(show=("direct", "indirect", "instance"), check=True)
        number = [i.name for i in scene.instances].index(FIGURE) + 1
        layers = {name: renderer.read_back(name) for name in ("direct", "indirect")}
        return layers, renderer.read_back("instance") == number


@cache
def played(gi, frames):
    """Return one bounce of the last of some moving frames, which share a history of as many."""
    player, settings = Player(walk()), settings_of(gi, 1)
    settings.temporal.frames = frames
    with Renderer(player.scene, size=SIZE, camera=player.scene.cameras[0], settings=settings) as renderer:
        for number in range(frames):
            player.pose(TIME - (frames - 1 - number) / RATE)
            renderer.step(show=("indirect",), preview=True)
        return renderer.read_back("indirect")


def test_direct_light_and_shadows_follow_the_pose():
    """Rays and shadow maps see the same figure as the path tracer: measured 1e-6."""
    layers, _ = still("many-light")
    assert relmse(layers["direct"], truth()["direct"]) <= 1e-5
    assert abs(bias(layers["direct"], truth()["direct"])) <= 0.002


@pytest.mark.slow
@pytest.mark.parametrize("layer", ["one", "visible"])
def test_the_path_tracer_sees_the_same_pose_as_if_it_were_static(layer):
    """A wrong pose changes the means by far more; 64 samples leave a relMSE of 0.023 and 0.126."""
    layers, figure = still("path", layer == "visible")
    got, expected = layers["indirect"], truth()[layer]
    assert relmse(got, expected) <= {"one": 0.03, "visible": 0.16}[layer]
    assert abs(bias(got, expected)) <= 0.005 and abs(bias(got, expected, figure)) <= 0.04


# Bounds of relMSE and bias of 16 frames at rest, little above the measured values. SSDO traces rays in directions that
# leave the picture, so its truth is one bounce from everywhere; SSIL's is that from visible surfaces.
STILL_BOUNDS = {"many-light": ("one", 0.024, 0.01), "ssdo": ("one", 0.2, 0.05), "ssil": ("visible", 0.035, 0.01)}
# Bounds of relMSE and bias of a moving frame with a history of 8. Single bright samples decide.
MOVING_BOUNDS = {"many-light": ("one", 0.2, 0.03), "ssdo": ("one", 0.27, 0.11), "ssil": ("visible", 0.065, 0.04)}


@pytest.mark.parametrize("gi", slow_but(("many-light",), STILL_BOUNDS))
def test_techniques_agree_with_the_truth_of_a_pose(gi):
    layer, largest, drift = STILL_BOUNDS[gi]
    layers, _ = still(gi)
    assert relmse(layers["indirect"], truth()[layer]) <= largest
    assert abs(bias(layers["indirect"], truth()[layer])) <= drift


def test_many_light_lights_the_figure():
    """The figure alone, most of which the lamp does not reach: measured 0.016 and -2 %."""
    layers, figure = still("many-light")
    assert np.count_nonzero(figure) > 200
    assert relmse(layers["indirect"], truth()["one"], mask=figure) <= 0.022
    assert abs(bias(layers["indirect"], truth()["one"], figure)) <= 0.03


@pytest.mark.slow
@pytest.mark.parametrize("gi", MOVING_BOUNDS)
def test_techniques_follow_the_truth_while_everything_moves(gi):
    layer, largest, drift = MOVING_BOUNDS[gi]
    assert relmse(played(gi, 8), truth()[layer]) <= largest
    assert abs(bias(played(gi, 8), truth()[layer])) <= drift
