"""Frames that move: samples are new in each if frames are averaged; what the camera does not change is kept."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.techniques import SCENES, make_settings

from wgpu_gi.renderer import Renderer

TECHNIQUES = ["many-light", "ssdo", "ssil"]


def renderer_of(gi: str, history: int) -> Renderer:
    settings = make_settings(gi, frames=1)
    settings.temporal.frames, settings.bounces, settings.diffuse = history, 1, True
    return Renderer(SCENES["cornell-point"](), size=(48, 27), settings=settings)


def move(renderer: Renderer, steps: int) -> list[np.ndarray]:
    """Return the indirect light of frames in which the camera moves sideways by a centimetre each."""
    pictures = []
    for _ in range(steps):
        moved = renderer.camera.world_from_view.copy()
        moved[0, 3] += 0.01
        renderer.camera = replace(renderer.camera, world_from_view=moved)
        renderer.step(show=("indirect",))
        pictures.append(renderer.read_back("indirect"))
    return pictures


def forced(renderer: Renderer, steps: int) -> list[np.ndarray]:
    """Return the indirect light of frames that run every pass, as if everything had moved."""
    pictures = []
    for _ in range(steps):
        renderer.step(show=("indirect",), force=True)
        pictures.append(renderer.read_back("indirect").astype(np.float64))
    return pictures


@pytest.mark.parametrize("gi", TECHNIQUES)
def test_averaged_frames_draw_new_samples(gi):
    """Without an average, noise stands still: it flickers less."""
    alone = forced(renderer_of(gi, 1), 2)
    assert np.array_equal(*alone)
    shared = forced(renderer_of(gi, 16), 40)
    truth = np.mean(shared[16:], 0)
    first, last = (np.square(picture - truth).mean() for picture in (shared[0], shared[16]))
    assert last < 0.4 * first


@pytest.mark.parametrize("gi", TECHNIQUES)
def test_the_same_moves_give_the_same_pictures(gi):
    renderer = renderer_of(gi, 4)
    start = renderer.camera
    first = move(renderer, 5)
    renderer.forget()
    renderer.camera = start
    assert all(map(np.array_equal, first, move(renderer, 5)))


def test_virtual_lights_are_kept_while_only_the_camera_moves():
    renderer = renderer_of("many-light", 8)
    renderer.settings.bounces = 2
    move(renderer, 2)
    assert {"gather", "temporal/accumulate"} <= renderer.graph.last_run.keys()
    assert not {"rsm", "vpl/light_paths"} & renderer.graph.last_run.keys()
