"""What is viewed, and how it is rendered while it moves and while it rests; knows nothing of windows.

While the camera moves, the picture has as many pixels as the adapter renders in time; at rest it gets more from step to
step until it has all of them, and refines. Everything that is shown is linear radiance over the same part of the world,
so brightness does not change.
"""

from __future__ import annotations

import json
import math
import os
import shlex
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..buffers import buffers_of, views_of
from ..camera import Camera
from ..errors import GiError
from ..options import MAX_SIDE, Settings, picture_count
from ..pictures.image import save_image
from ..renderer import Renderer
from ..resources import resource_dir
from ..scene.files.camera_files import camera_fields
from ..scene.files.light_texts import light_texts
from ..settings import apply_quality, assign, describe
from .navigation import pivot_of
from .pace import Pace, pixels_at

REST_SECONDS = 0.25  # without a move, until the picture gets all its pixels: chosen
SHARED_FRAMES = 8  # that indirect light is averaged over while the camera moves: chosen
TIMING_SECONDS = 0.25  # from measurement to measurement of the passes while moving, as they take time: chosen
REFINEMENT = 4  # of coarseness, that a step at rest takes back: chosen
LOOK_SECONDS = 0.4  # from look to look whether a shader was saved: chosen, a look takes 1.4 ms
DISPLAY = "display"


class Interrupted(Exception):
    """A step was left because what it renders is not wanted any more."""


class Session:
    """A scene in a view: what can be changed are `camera`, `pivot`, the settings, `shown` and `size`."""

    def __init__(self, renderer: Renderer, quality: str = "medium", source: Sequence[str] = ("cornell",)) -> None:
        """`source` are the arguments of `wgpu-gi render` that make the scene."""
        self.renderer = renderer
        self.quality = quality
        self.source = list(source)
        self.start_camera = renderer.camera
        self._start_lights = light_texts(renderer.scene)
        self.pivot = pivot_of(renderer.camera, renderer.scene)
        self.size = renderer.size  # of the picture at rest
        self.shown = DISPLAY
        self.also: tuple[str, ...] = ()  # buffers that steps at rest make besides
        self.made_also = False  # the last step made them
        self._measure = self._force = False
        self.error = ""
        self.pace = Pace()  # while moving
        self._timed = -math.inf  # when the passes were measured last
        self._level = 0  # coarseness of the next step at rest
        self._moved = self._relit = -math.inf  # when the camera did, and when lights changed
        self.at_rest = False  # there is nothing to do until something changes
        self.interrupted = False  # something changed since the last step began
        self.shown_range: tuple[float, float] | None = None  # of the values shown
        self._shaders, self._looked = _shader_times(), time.monotonic()

    @property
    def settings(self) -> Settings:
        """The settings that the next step renders with."""
        return self.renderer.settings

    @property
    def buffers(self) -> tuple[str, ...]:
        """The names of all that can be shown."""
        return (DISPLAY, *buffers_of(self.settings.gi), *views_of(self.settings.gi))

    @property
    def camera(self) -> Camera:
        """The camera of the view; setting it makes the view move."""
        return self.renderer.camera

    @camera.setter
    def camera(self, camera: Camera) -> None:
        self.renderer.camera = camera
        self._moved = time.monotonic()
        self.changed()

    @property
    def measure(self) -> bool:
        """Whether steps measure their passes; setting it runs all of them once."""
        return self._measure

    @measure.setter
    def measure(self, measure: bool) -> None:
        if measure and not self._measure:
            self._force = True
            self.changed()
        self._measure = measure

    @property
    def urgent(self) -> bool:
        """True if a step is wanted although it may take long: the view moves, or something was changed."""
        return self.moving or self.interrupted

    @property
    def moving(self) -> bool:
        """True until some time after the last move."""
        return time.monotonic() - self._moved < REST_SECONDS

    # ------------------------------------------------------------------------------------------------ Changes

    def change(self, name: str, value: object) -> None:
        """Set a setting by its name; one that cannot be is told in `error` and leaves all as it was."""
        text = "none" if value is None else repr(value) if isinstance(value, float) else str(value)
        try:
            assign(self.settings, f"{name}={text}")
        except GiError as error:
            self.error = str(error)
            return
        self.error = ""
        self.changed()

    def set_quality(self, quality: str) -> None:
        """Set all settings that have presets."""
        self.quality = quality
        apply_quality(self.settings, quality)
        self.changed()

    def show(self, name: str) -> None:
        """Show a buffer, or "display"."""
        self.shown = name
        self.changed()

    def resize(self, width: int, height: int) -> None:
        """Give the picture at rest another size."""
        self.size = min(max(width, 1), MAX_SIDE), min(max(height, 1), MAX_SIDE)
        self.changed()

    def changed(self) -> None:
        """Note that something else than the camera changed."""
        self.interrupted, self.at_rest = True, False
        if self.shown not in self.buffers:
            self.shown = DISPLAY

    def relit(self) -> None:
        """Note that lights changed: there are fewer pixels while they do, as while the camera moves."""
        self._relit = self._moved = time.monotonic()
        self.changed()

    def watch_shaders(self) -> bool:
        """Return True if a shader file was seen to change since the last call; the next step takes it."""
        if time.monotonic() - self._looked < LOOK_SECONDS:
            return False
        before, self._shaders = self._shaders, _shader_times()
        self._looked = time.monotonic()
        if before == self._shaders:
            return False
        self.renderer.reload()
        self.changed()
        return True

    # ------------------------------------------------------------------------------------------------ Rendering

    def step(self, tick: Callable[[float], None] | None = None) -> bool:
        """Render a frame, a finer one if nothing changed; return False if there was nothing to do.

        `tick` is called now and then while a frame at rest takes long, with the share that is done; if it changes
        anything, the frame is left. What goes wrong is told in `error`, and the picture before stays.
        """
        if self.at_rest:
            return False
        self.interrupted = False
        moving = self.moving
        size = self._size_at(self.pace.coarseness if moving else self._level)
        resized, self.renderer.size = size != self.renderer.size, size

        def progress(fraction: float) -> None:
            if tick is not None and not moving:
                tick(fraction)
                if self.interrupted:
                    raise Interrupted

        start = time.perf_counter()
        try:
            self.made_also = not moving
            with self._smoothed(moving):
                ran = self._render(progress, moving)
        except Interrupted:
            return False
        except GiError as error:
            self.error, self.at_rest = str(error), True
            return False
        if ran:
            self.error = ""
        if moving:
            if ran and not resized:
                self.pace.note(time.perf_counter() - start)
            self._level = self.pace.coarseness
            return ran or not self.moving
        if self._level:
            self._level = max(self._level - REFINEMENT, 0)
            return True
        self.at_rest = not ran and not self.interrupted
        if ran:
            self.pace.note_rest(time.perf_counter() - start)
        return ran

    def status(self) -> str:
        """Return how far the picture is, in a few words."""
        width, height = self.renderer.size
        settings, frames = self.settings, picture_count(self.settings)
        share = self.renderer.graph.settle_progress()
        done = f", {share:.0%} of {settings.spp} spp" if settings.gi == "path" else ""
        done = f", mean of {frames} frames" if frames > 1 and self.at_rest else done
        return f"{settings.gi}, {width}x{height}{done}"

    def values(self) -> NDArray[np.float32]:
        """Return what is shown as numbers, from the last step."""
        return self.renderer.read_back("radiance" if self.shown == DISPLAY else self.shown)

    def point_at(self, x: float, y: float) -> NDArray[np.float64] | None:
        """Return the world position seen at a share of the picture's width and height; None if that is nothing."""
        self.renderer.step(show=(*self._show(self.moving), "position", "depth"))
        depth, position = self.renderer.read_back("depth"), self.renderer.read_back("position")
        row, column = int(y * depth.shape[0]), int(x * depth.shape[1])
        if not (0 <= row < depth.shape[0] and 0 <= column < depth.shape[1]) or depth[row, column] <= 0:
            return None
        return position[row, column].astype(np.float64)

    def _render(self, progress: Callable[[float], None], moving: bool) -> bool:
        force, self._force = self._force, False
        ran = self.renderer.step(progress, show=self._show(moving), timings=self._measures(moving), force=force)
        self.renderer.graph.device.wait()
        return ran

    @contextmanager
    def _smoothed(self, moving: bool) -> Iterator[None]:
        """Let frames share light while the camera moves; at rest, and where lights change, the settings hold as set."""
        temporal = self.settings.temporal
        own = temporal.frames
        if moving and time.monotonic() - self._relit > REST_SECONDS:
            temporal.frames = max(own, SHARED_FRAMES)
        try:
            yield
        finally:
            temporal.frames = own

    def _measures(self, moving: bool) -> bool:
        now = time.monotonic()
        measures = self._measure and not (moving and now - self._timed < TIMING_SECONDS)
        self._timed = now if measures else self._timed
        return measures

    def _show(self, moving: bool) -> tuple[str, ...]:
        wanted = self.shown if self.shown in self.buffers else DISPLAY
        return tuple(dict.fromkeys((DISPLAY, wanted, *(() if moving else self.also))))

    def _size_at(self, coarseness: int) -> tuple[int, int]:
        scale = math.sqrt(pixels_at(coarseness))
        return max(round(self.size[0] * scale), 1), max(round(self.size[1] * scale), 1)

    # ------------------------------------------------------------------------------------------------ Keeping

    def command(self, output: str = "view.png") -> str:
        """Return the command line that renders this view without a window."""
        width, height = self.size
        camera = json.dumps(self._camera_fields())
        words = ["wgpu-gi", "render", *self.source, "-o", output, "--size", f"{width}x{height}", "--camera", camera]
        for text in light_texts(self.renderer.scene):
            if text not in self._start_lights:
                words += ["--relight", text]
        if self.shown != DISPLAY:
            words += ["--show", self.shown]
        words += ["--gi", self.settings.gi, "--quality", self.quality]
        plain = Settings(gi=self.settings.gi)
        apply_quality(plain, self.quality)
        for row, usual in zip(describe(self.settings), describe(plain), strict=True):
            if row.value != usual.value:
                value = "none" if row.value is None else row.value
                words += ["--set", f"{row.name}={value!r}" if isinstance(value, float) else f"{row.name}={value}"]
        return shlex.join(words)

    def save(self, folder: Path | None = None) -> list[Path]:
        """Write what is shown as .png and linear .exr, all its pixels, with camera and command inside; return them."""
        self._moved = -math.inf
        while self.renderer.size != self.size and not self.error:
            self.step()
        folder = folder or Path.cwd()
        stem = Path(self.source[0]).stem
        number = 1
        while (folder / f"{stem}-{number:03d}.png").exists():
            number += 1
        name = "radiance" if self.shown == DISPLAY else self.shown
        layers = {name: self.values()}
        files = [folder / f"{stem}-{number:03d}{suffix}" for suffix in (".png", ".exr")]
        for file in files:
            metadata = {"command": self.command(file.name), "camera": json.dumps(self._camera_fields())}
            save_image(file, layers, exposure=self.settings.exposure, metadata=metadata)
        return files

    def _camera_fields(self) -> dict[str, object]:
        return camera_fields(self.camera, max(float(np.linalg.norm(self.pivot - self.camera.position)), 1e-9))


def _shader_times() -> dict[str, int]:
    """Return when each shader file was written."""
    times: dict[str, int] = {}
    for folder, _, _ in os.walk(resource_dir("wgsl")):
        with os.scandir(folder) as entries:
            times |= {entry.path: entry.stat().st_mtime_ns for entry in entries if entry.is_file()}
    return times
