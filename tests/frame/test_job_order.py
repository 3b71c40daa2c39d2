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
    return Job(SceneSource(scene), 0, settings, (32, 18), range(6), fps=7)


def pictures_in(order, job):
    """Return the pictures of frames, rendered one by one in an order by one renderer."""
    scene = job.source.load()
    with job.renderer(scene) as renderer:
        sequence = JobRenderer(job, renderer, Timeline(job, scene))
        has_history = sequence.has_history()
        blocks = list(blocks_of(job.frames, has_history))
        found = {}
        for number in order:
            block = blocks[number] if len(blocks) > 1 else job.frames
            missing = {number} if len(blocks) == 1 else set(block)
            rendered = sequence.render(block, has_history, lambda f, m=missing: f not in m, lambda *_: None)
            found.update((frame, pictures["radiance"].copy()) for frame, pictures in rendered)
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
    assert len({picture.tobytes() for picture in forwards.values()}) == 6
    for frame, picture in forwards.items():
        assert np.array_equal(picture, shuffled[frame]), frame


def test_job_is_the_same_in_another_process():
    """It is plain data: also a scene from Python, with its camera that moves and its animation."""
    job = job_of(animated_scene(), "none")
    sent = pickle.loads(pickle.dumps(job))
    one, other = (Timeline(j, j.source.load()).cameras() for j in (job, sent))
    assert one == other and sent.settings == job.settings
    for frame, picture in pictures_in([2], job).items():
        assert np.array_equal(picture, pictures_in([2], sent)[frame])
