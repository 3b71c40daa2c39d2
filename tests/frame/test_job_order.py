"""Frames of a job do not depend on which frames the process rendered before them."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from helpers.animated import animated_scene

import wgpu_gi as gi
from wgpu_gi.scene.built_in.scenes import builtin_scene
from wgpu_gi.sequence.blocks import blocks_of
from wgpu_gi.sequence.job import Job, Timeline
from wgpu_gi.sequence.render import JobRenderer
from wgpu_gi.sequence.source import SceneSource

SLOW = pytest.mark.slow


def job_of(scene, technique, frames=2):
    settings = gi.Settings(gi=technique, spp=2)
    settings.camera.frames, settings.vpl.count, settings.vpl.paths, settings.ism.resolution = frames, 128, 1024, 32
    return Job(SceneSource(scene), 0, settings, (32, 18), range(6), layers=("position",), fps=7)


def assert_same(one, other):
    """Compare all buffers; positions show the rounding of the origin that GPU coordinates are relative to."""
    assert list(one) == list(other)
    for name in one:
        assert np.array_equal(one[name], other[name]), name


def pictures_in(order, job):
    """Return the pictures of frames, rendered one by one in an order by one renderer."""
    scene = job.source.load()
    with job.renderer(scene) as renderer:
        sequence = JobRenderer(job, renderer, Timeline(job, scene))
        has_history = sequence.has_history()
        blocks = list(blocks_of(job.frames, has_history))
        found = {}
        for number in order:
            (block,) = (block for block in blocks if number in block)
            missing = {number}
            rendered = sequence.render(block, has_history, lambda f, m=missing: f not in m, lambda *_: None)
            found.update((frame, pictures) for frame, pictures in rendered)
    return found


@pytest.mark.parametrize(
    ("scene", "technique", "frames"),
    [
        ("slide", "none", 2),
        ("walk", "none", 2),
        ("walk", "many-light", 1),
        *[pytest.param("walk", name, 2, marks=SLOW) for name in ("many-light", "ssil", "ssdo", "path")],
    ],
)
def test_frames_of_an_animation_do_not_depend_on_those_before(scene, technique, frames):
    made = job_of(animated_scene() if scene == "slide" else builtin_scene(scene), technique, frames)
    forwards, shuffled = (pictures_in(order, made) for order in ([0, 1, 2, 3, 4, 5], [4, 1, 5, 0, 3, 2]))
    assert len({pictures["radiance"].tobytes() for pictures in forwards.values()}) == 6
    for frame, pictures in forwards.items():
        assert_same(pictures, shuffled[frame])


@pytest.mark.parametrize("moving", [False, pytest.param(True, marks=SLOW)])
def test_frames_do_not_depend_on_where_the_animation_was_first_shown(moving, monkeypatch):
    """A process that renders the last block alone, and does not find out about the history, has the same pictures."""
    monkeypatch.setattr("wgpu_gi.sequence.blocks.BLOCK", 3)
    monkeypatch.setattr("wgpu_gi.sequence.blocks.WARM_UP", 1)
    job = job_of(builtin_scene("walk"), "many-light" if moving else "none", 1 if moving else 2)
    whole, block, scene = pictures_in(range(6), job), range(3, 6), job.source.load()
    with job.renderer(scene) as renderer:
        sequence = JobRenderer(job, renderer, Timeline(job, scene))
        alone = list(sequence.render(block, moving, lambda frame: False, lambda *_: None))
    for frame, pictures in alone:
        assert_same(pictures, whole[frame])


def test_job_is_the_same_in_another_process():
    """It is plain data: also a scene from Python, with its camera that moves and its animation."""
    job = job_of(animated_scene(), "none")
    sent = pickle.loads(pickle.dumps(job))
    one, other = (Timeline(j, j.source.load()).cameras() for j in (job, sent))
    assert one == other and sent.settings == job.settings
    assert_same(pictures_in([2], job)[2], pictures_in([2], sent)[2])
