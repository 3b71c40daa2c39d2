"""Renders the frames of a job, block by block.

A picture depends only on its job, bit for bit, not on what the process rendered before: in the same order or another,
in one process or many. In an animation in which the whole scene travels by more than four times its radius, up to
rounding: the origin of GPU coordinates follows it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from ..pictures.image import exposure_for
from ..renderer import Renderer
from ..rendering import read_pictures
from ..reports import Report
from .blocks import run_of
from .files import Pictures
from .job import Job, Timeline


class JobRenderer:
    """Renders any blocks of a job, in any order, by one renderer."""

    def __init__(self, job: Job, renderer: Renderer, timeline: Timeline) -> None:
        self.job, self.renderer, self.timeline = job, renderer, timeline
        renderer.moving = job.settings.camera.frames == 1  # pictures of more frames average jittered ones
        if timeline.plays:
            self.turn_to(job.frames[0])
            renderer.expect_motion()

    def turn_to(self, frame: int) -> None:
        """Set camera and time of a frame."""
        self.renderer.camera, self.renderer.time = self.timeline.camera_at(frame), self.timeline.time_at(frame)

    def exposure(self, output: str, report: Report) -> float | None:
        """Return the exposure of all frames, None if the file has none. Automatic exposure renders the first frame."""
        name, given = self.job.shown[0], self.job.settings.exposure
        if exposure_for(output, given, name, [[0.0]]) is None or given is not None:
            return exposure_for(output, given, name, [[0.0]])
        self.turn_to(self.job.frames[0])
        self.renderer.run(report, show=self.job.show)
        pictures = read_pictures(self.renderer, (name,), self.job.settings, self.job.denoise)
        return exposure_for(output, given, name, pictures[name])

    def has_history(self) -> bool:
        """Tell whether a frame depends on those before it in its block; declares and renders a frame to know it."""
        self.turn_to(self.job.frames[0])
        self.renderer.step(show=self.job.show)
        return self.renderer.has_history or "motion" in self.job.show  # `motion` also depends on the previous frame

    def frames_to_render(self, block: range, has_history: bool, exists: Callable[[int], bool]) -> int:
        """Return the number of frames to render for a block, warm-up included."""
        if all(map(exists, block)):
            return 0
        return len(run_of(self.job.frames, block, has_history, exists))

    def render(
        self, block: range, has_history: bool, exists: Callable[[int], bool], report: Report
    ) -> Iterator[tuple[int, Pictures]]:
        """Yield number and pictures of the frames of a block that do not exist; `report` takes the fraction done."""
        if all(map(exists, block)):
            return
        if has_history:
            self.renderer.forget()
        run = run_of(self.job.frames, block, has_history, exists)
        for done, frame in enumerate(run):
            self.turn_to(frame)
            pictures = self._pictures(part_of(report, done, len(run)))
            if frame in block and not exists(frame):
                yield frame, pictures

    def _pictures(self, report: Report) -> Pictures:
        """Render a frame and return its buffers."""
        job, renderer, show = self.job, self.renderer, self.job.show
        options: dict[str, Any] = {"show": show, "check": job.check, "timings": job.timings}
        pictures: Pictures = {}
        if "motion" in show and not renderer.moving:
            # Only the first step has motion: nothing changes in the later steps.
            renderer.step(**options)
            pictures["motion"] = renderer.read_back("motion")
        renderer.run(report, **options)
        return {**read_pictures(renderer, show, job.settings, job.denoise), **pictures}


def part_of(report: Report, done: float, total: float, what: str | None = None) -> Report:
    """Return a report for a part, after `done` of `total`, that converts its fraction to that of the whole."""

    def part(fraction: float, now: str | None = None) -> None:
        report((done + fraction) / total, now or what)

    return part
