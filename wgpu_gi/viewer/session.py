"""The session of a viewer: scene, settings and exposure, rendered while the view moves and while it rests.

While the camera moves, dynamic resolution keeps frames in time. At rest, the resolution rises to full within a few
steps, and the picture converges. A session does not depend on windows; window and notebook share it.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext

import numpy as np
from numpy.typing import NDArray

from ..budget.certificate import Certificate
from ..buffers import buffers_of, views_of
from ..camera import Camera
from ..errors import GiError
from ..options import Settings, picture_count
from ..renderer import Renderer
from ..scene.files.light_texts import light_texts
from ..settings import apply_quality, assign
from ..webgpu_limits import MAX_TEXTURE_SIDE
from .dynamic_resolution import DynamicResolution, pixels_at
from .exposure_meter import ExposureMeter
from .navigation import pivot_of
from .playback import Playback
from .refinement import Refinement

REST_SECONDS = 0.25  # from the last move to rest: longer than a hand pauses within a drag
# Frames of temporal accumulation while the camera moves, and while lamps or things do, whose light must follow: two
# thirds and a third of a second at 25 per second. tests/truth/README.md, "Moving pictures".
SHARED_FRAMES, RELIT_FRAMES = 16, 8
TIMING_SECONDS = 0.25  # between measurements of the passes while moving: measuring costs time, and nobody reads faster
REFINEMENT = 4  # levels by which each step at rest raises the resolution: from the coarsest to full in three steps
WATCH_SECONDS = 0.4  # between checks of the shader files
DISPLAY = "display"


class Interrupted(Exception):
    """A step was abandoned because the view changed."""


class Session:
    """A scene in a view. `camera`, `pivot`, settings, `shown`, `size`, `playback` may change between steps."""

    def __init__(
        self,
        renderer: Renderer,
        quality: str = "medium",
        source: Sequence[str] = ("cornell",),
        *,
        fps: float | None = None,
        refinement: Refinement | None = None,
    ) -> None:
        """`source`: arguments of `wgpu-gi render` that select the scene; `fps`: the aim while the view moves."""
        self.renderer = renderer
        self.quality = quality
        self.source = list(source)
        self.playback = Playback(renderer, self.relit)
        self.start_camera = renderer.camera
        self.start_lights = light_texts(renderer.scene)
        self.pivot = pivot_of(renderer.camera, renderer.scene)
        self.size = renderer.size  # size of the picture at rest
        self.shown = DISPLAY
        self.also: tuple[str, ...] = ()  # further buffers that steps at rest compute
        self.made_also = False  # the last step computed them
        # Receives how many pipelines of a frame are compiled, and how many there are; if it changes anything at rest,
        # the frame is abandoned.
        self.on_compile: Callable[[int, int], None] | None = None
        self._measure = self._force = False
        self.error = ""
        self.resolution = DynamicResolution(fps)
        self.refinement = refinement or Refinement()  # how far the view at rest is refined
        self._timed = -math.inf  # time of the last measurement of the passes
        self._level = 0  # level of resolution of the next step at rest
        self._moved = self._relit = -math.inf  # times of the last move, and of the last change of a light or a pose
        self.at_rest = False  # the picture is complete; nothing to do until something changes
        self.interrupted = False  # something changed since the last step began
        self.certificate: Certificate | None = None  # of the picture as it stands
        self.shown_range: tuple[float, float] | None = None  # least and largest value shown
        self._meter = ExposureMeter(renderer)
        self._watched = time.monotonic()  # time of the last check of the shader files

    @property
    def settings(self) -> Settings:
        """The settings that the next step renders with."""
        return self.renderer.settings

    @property
    def exposure(self) -> float:
        """The exposure of the displayed view in EV: the setting, or automatic."""
        return self.renderer.exposure

    @property
    def buffers(self) -> tuple[str, ...]:
        """The names of the buffers that can be shown."""
        return (DISPLAY, *buffers_of(self.settings.gi), *views_of(self.settings.gi))

    @property
    def camera(self) -> Camera:
        """The camera of the view, where the animation has moved it. Setting it counts as a move."""
        return self.renderer.posed_camera

    @camera.setter
    def camera(self, camera: Camera) -> None:
        self.renderer.camera = camera
        self._moved = time.monotonic()
        self._meter.moved()
        self.changed()

    @property
    def measure(self) -> bool:
        """Whether steps measure their passes. Setting it runs every pass once."""
        return self._measure

    @measure.setter
    def measure(self, measure: bool) -> None:
        if measure and not self._measure:
            self._force = True
            self.changed()
        self._measure = measure

    @property
    def urgent(self) -> bool:
        """True if a step must not wait for the panel: the view moves, or something changed."""
        return self.moving or self.interrupted

    @property
    def moving(self) -> bool:
        """True while an animation plays, and until REST_SECONDS after the last move."""
        return self.playback.playing or time.monotonic() - self._moved < REST_SECONDS

    # ------------------------------------------------------------------------------------------------ Changes

    def change(self, name: str, value: object) -> None:
        """Set a setting by its name. A bad value changes nothing; `error` says why."""
        text = "none" if value is None else repr(value) if isinstance(value, float) else str(value)
        try:
            assign(self.settings, f"{name}={text}")
        except GiError as error:
            self.error = str(error)
            return
        self.error = ""
        self.changed()

    def expose(self, automatic: bool) -> None:
        """Make the exposure automatic, or fix it at its current value."""
        self._meter.restart()
        self.change("exposure", None if automatic else self.exposure)

    def set_quality(self, quality: str) -> None:
        """Set every setting that has presets."""
        self.quality = quality
        apply_quality(self.settings, quality)
        self.changed()

    def show(self, name: str) -> None:
        """Show a buffer, or "display"."""
        self.shown = name
        self.changed()

    def resize(self, width: int, height: int) -> None:
        """Set the size of the picture at rest, in pixels."""
        self.size = min(max(width, 1), MAX_TEXTURE_SIDE), min(max(height, 1), MAX_TEXTURE_SIDE)
        self.changed()

    def changed(self) -> None:
        """Record a change of anything but the camera."""
        self.interrupted, self.at_rest, self.certificate = True, False, None
        if self.shown not in self.buffers:
            self.shown = DISPLAY

    def relit(self) -> None:
        """Record a change of lights or of a pose. It counts as a move, so it also uses dynamic resolution."""
        self._relit = self._moved = time.monotonic()
        self._meter.moved()
        self.changed()

    def watch_shaders(self) -> bool:
        """Return True if a shader file changed since the last call; the next step reloads it."""
        if time.monotonic() - self._watched < WATCH_SECONDS:
            return False
        self._watched = time.monotonic()
        if not self.renderer.reload():
            return False
        self.changed()
        return True

    # ------------------------------------------------------------------------------------------------ Rendering

    def step(self, tick: Callable[[float], None] | None = None) -> bool:
        """Render a frame, or refine the last one if nothing changed; return False if there was nothing to do.

        During a long frame at rest, `tick` receives the fraction done; if it changes anything, the frame is abandoned.
        After a failure, `error` says why and the last picture remains.
        """
        self.playback.tick()
        if self.at_rest:
            return False
        # Choose the resolution.
        self.interrupted = False
        moving = self.moving
        size = self._size_at(self.resolution.level if moving else self._level)
        resized, self.renderer.size = size != self.renderer.size, size

        def progress(fraction: float) -> None:
            if tick is not None and not moving:
                tick(fraction)
                if self.interrupted:
                    raise Interrupted

        # Render.
        start = time.perf_counter()
        try:
            self.made_also = not moving
            with self._smoothed(moving), nullcontext() if moving else self.refinement.opened(self.settings):
                ran = self._render(progress, moving)
                seconds = time.perf_counter() - start
                opened = not self._meter.started
                exposed = self._meter.measure(ran, moving)
                if exposed and opened:
                    self._render(progress, moving)  # no frame of a new scene has a wrong exposure
        except Interrupted:
            return False
        except GiError as error:
            self.error, self.at_rest = str(error), True
            return False
        if ran:
            self.error, self.certificate = "", None

        # Choose what the next step does.
        if moving:
            if ran and not resized:
                self.resolution.note(seconds)
            self._level = self.resolution.level
            return ran or not self.moving
        if self._level:
            self._level = max(self._level - REFINEMENT, 0)
            return True
        done = not ran or (self.refinement.is_open and self.refinement.is_met(self.renderer))
        self.at_rest = done and not exposed and not self.interrupted
        if ran:
            self.resolution.note_rest(seconds)
        return ran or exposed

    def render_full_size(self) -> None:
        """Pause, end a move, and render until the picture has its full size and is no preview."""
        self.playback.playing, self._moved = False, -math.inf
        while (self.renderer.size != self.size or self.renderer.shows_preview) and not self.error:
            self.step()

    def status(self) -> str:
        """Return technique, size and progress of the picture in a few words."""
        width, height = self.renderer.size
        settings, frames = self.settings, picture_count(self.settings, self.renderer.scene)
        if self.refinement.is_open and not self.moving:
            return f"{settings.gi}, {width}x{height}, {self.refinement.words(self.renderer)}"
        share = self.renderer.graph.settle_progress()
        done = f", {share:.0%} of {settings.spp} spp" if settings.gi == "path" else ""
        done = f", mean of {frames} frames" if frames > 1 and self.at_rest else done
        return f"{settings.gi}, {width}x{height}{done}"

    def values(self) -> NDArray[np.float32]:
        """Return the buffer shown, as linear numbers, from the last step."""
        return self.renderer.read_back("radiance" if self.shown == DISPLAY else self.shown)

    def point_at(self, x: float, y: float) -> NDArray[np.float64] | None:
        """Return the world position seen at a share of the picture's width and height, None without a surface."""
        self.renderer.step(show=(*self._show(self.moving), "position", "depth"))
        depth, position = self.renderer.read_back("depth"), self.renderer.read_back("position")
        row, column = int(y * depth.shape[0]), int(x * depth.shape[1])
        if not (0 <= row < depth.shape[0] and 0 <= column < depth.shape[1]) or depth[row, column] <= 0:
            return None
        return position[row, column].astype(np.float64)

    def _render(self, progress: Callable[[float], None], moving: bool) -> bool:
        def compiled(done: int, count: int) -> None:
            if self.on_compile is not None:
                self.on_compile(done, count)
                if self.interrupted and not moving:
                    raise Interrupted

        force, self._force = self._force, False
        renderer = self.renderer
        renderer.on_compile = compiled
        options = {"timings": self._measures(moving), "force": force, "preview": moving}
        try:
            ran = renderer.step(progress, show=self._show(moving), **options)
        finally:
            renderer.on_compile = None
        renderer.graph.device.wait()
        return ran

    @contextmanager
    def _smoothed(self, moving: bool) -> Iterator[None]:
        """Anti-alias moving frames; accumulate over SHARED_FRAMES, or over RELIT_FRAMES while light changes."""
        temporal = self.settings.temporal
        own, self.renderer.moving = temporal.frames, moving
        if moving:
            relit = time.monotonic() - self._relit <= REST_SECONDS
            temporal.frames = max(own, RELIT_FRAMES if relit else SHARED_FRAMES)
        try:
            yield
        finally:
            temporal.frames, self.renderer.moving = own, False

    def _measures(self, moving: bool) -> bool:
        now = time.monotonic()
        measures = self._measure and not (moving and now - self._timed < TIMING_SECONDS)
        self._timed = now if measures else self._timed
        return measures

    def _show(self, moving: bool) -> tuple[str, ...]:
        wanted = self.shown if self.shown in self.buffers else DISPLAY
        more = () if moving else (*self.also, *self.refinement.needs)
        return tuple(dict.fromkeys((DISPLAY, wanted, *more)))

    def _size_at(self, level: int) -> tuple[int, int]:
        scale = math.sqrt(pixels_at(level))
        return max(round(self.size[0] * scale), 1), max(round(self.size[1] * scale), 1)
