"""A frame on the GPU: the copy of a scene, and the declared passes, both kept in step with the view to render."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import fields, is_dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .buffers import Source
from .camera import Camera, Window
from .errors import GiError
from .frame import declare_frame
from .gpu.device import Device
from .gpu.graph import Graph
from .options import Settings, check_size, picture_count, samples_of, technique_of, varies, why_aliased
from .pixel_tracer import PixelTracer
from .scene.scene import Instance, Scene
from .surface_tracer import SurfaceTracer
from .techniques.shared.composite import MEANS
from .techniques.shared.scene_inputs import SceneInputs
from .techniques.shared.technique import Kept, Shot
from .upload.fingerprint import Fingerprint
from .upload.scene_upload import SceneUpload

DRAWN = 1 << 16  # frames after which random numbers repeat


class View(NamedTuple):
    """What a frame shows: a scene from a camera, at a size; the exposure of `settings` is that of `display`.

    `moving`: it is a frame of a moving picture, to be anti-aliased over time. `window`: the part of a
    larger picture that it is.
    """

    scene: Scene
    camera: Camera
    size: tuple[int, int]
    settings: Settings
    moving: bool = False
    window: Window | None = None

    @property
    def aliased(self) -> str | None:
        """Why the frame is not anti-aliased over time; None if it is, empty for a still picture."""
        return why_aliased(self.settings) if self.moving else ""

    @property
    def frames(self) -> int:
        """Number of frames of a still picture; one of a moving picture."""
        return 1 if self.aliased is None else picture_count(self.settings, self.scene)


class GpuFrame:
    """The graph, the GPU's copy of the scene, and which frame of a still picture comes next."""

    def __init__(self, device: Device) -> None:
        self._device = device
        self.graph = Graph(device)
        self.pixels = PixelTracer(device)
        self.surfaces = SurfaceTracer(device)
        self.upload: SceneUpload | None = None
        self.kept = Kept()  # state of the techniques
        self.index = 0  # among the frames of a still picture; negative during the warm-up
        self._drawn = 0  # which random numbers the first frame of the picture draws
        self._undrawn = 0  # the first that no frame has drawn
        self._moving = -1  # number of the frame in an anti-aliased moving picture
        self._repeated = 0  # frames of it since its view has last changed
        self.finished = 0  # frames of the still picture that are in its mean, or samples; 0 until the first is complete
        self.refining = False  # the technique has planned more runs than were declared
        self._sources: dict[str, Source] = {}
        self._declared: tuple[object, ...] | None = None
        self._inputs: tuple[Any, ...] | None = None  # all that determines the picture
        self._rested = False  # nothing has moved in the last step
        self._preview = False  # the last frame may have been a preview
        self.shows_preview = False  # it was one

    def invalidate(self, declaration: bool = False) -> None:
        """Upload everything again in the next step and restart the average; with `declaration`, declare it, too."""
        self._inputs = None
        if declaration:
            self._declared = None

    def forget(self) -> None:
        """Drop all state of earlier frames but the GPU's copy of the scene."""
        self.graph.release()
        self.graph, self.kept, self._sources = Graph(self._device), Kept(), {}
        self._undrawn, self._moving, self.finished = 0, -1, 0
        if self.upload is not None:
            self.upload.forget_motion()
        self.invalidate(declaration=True)

    def release(self) -> None:
        """Free all GPU memory."""
        self.forget()
        self.pixels.graph.release()
        self.surfaces.release()
        if self.upload is not None:
            self.upload.release()
            self.upload = None

    @property
    def releases(self) -> list[Callable[[], None]]:
        """The functions that free the GPU memory, for `Device.discard`."""
        releases = [self.graph.release, self.pixels.graph.release, self.surfaces.release]
        return releases + ([] if self.upload is None else [self.upload.release])

    def prepare(self, view: View, show: tuple[str, ...], force: bool, preview: bool) -> None:
        """Upload what changed; redeclare the frame if its passes changed. `preview`: as in `Renderer.step`."""
        check_size(view.size, self._device)
        settings, camera, frames = view.settings, view.camera, view.frames
        pose = (np.asarray(camera.world_from_view).tobytes(), camera.yfov, camera.orthographic_height)
        aliased = view.aliased
        seen = (Fingerprint(view.scene), pose, view.size, show, frames, aliased, view.window)
        before = self._inputs or ()
        refining, self.refining = self.refining, False
        still = not force and seen == before[: len(seen)]
        same = still and not refining and (settings,) == before[len(seen) :]
        if same and self._rested and self._is_complete(view):
            return
        # One more step after the last change sets all motion to zero.
        self._rested = same
        known = before[len(seen)] if before else None
        inputs = (*seen, known if settings == known else copy_of(settings))
        if not still:
            self.finished = 0
        # No preview is among the frames of a still picture.
        previewed, self._preview = self.shows_preview, preview and not still
        goes_on, up_to_date = same and not previewed and aliased is not None, None
        if still and not same:
            # Only settings differ: keep the frames averaged so far unless a pass of the mean has become stale.
            finished, self.finished = self.finished, 0
            self._update(view, inputs)
            up_to_date = self.index, self._drawn
            goes_on = not previewed and not any(name.startswith(MEANS) for name in self.graph.stale())
            self.finished = finished if goes_on else 0
        first = -technique_of(settings.gi).warm_up(settings)
        if goes_on:
            self.index = min(self.index + 1, frames - 1)
        else:
            # An average over moving frames needs new samples; without it, noise that stands still flickers less.
            averages = settings.temporal.frames > 1 or aliased is None
            self._moving = self._moving + 1 if aliased is None else -1
            self._repeated = self._repeated + 1 if same else 0
            self.index = min(first + max(self._moving, 0), 0)
            self._drawn = self._undrawn % DRAWN if averages else 0
        self._undrawn = self._drawn + max(self.index, 0) + 1
        if (self.index, self._drawn) != up_to_date:
            self._update(view, inputs)

    def run(
        self, settings: Settings, force: bool, *, timings: bool, check: bool, on_chunk: Callable[[float], None]
    ) -> bool:
        """Run the passes of the prepared frame as `Graph.run` does, and count what the picture then averages."""
        samples = technique_of(settings.gi).averages_samples
        try:
            ran = self.graph.run(force, timings=timings, check=check, on_chunk=on_chunk)
        except BaseException:
            # The picture is what it was before, or nothing if this was its first run.
            why = self.graph.last_run
            first = any(p.settle and p.name in why and why[p.name].kind == "changed" for p in self.graph.order)
            if first if samples else self.index <= 0:
                self.finished = 0
            raise
        runs = [p.state.settle_index + 1 for p in self.graph.order if p.settle]
        if ran and samples:
            # Buffers of the surfaces alone are complete after one run.
            self.finished = samples_of(settings, max(runs)) if runs else settings.spp
        elif ran:
            self.finished = max(self.index + 1, 0)
        return ran

    def _is_complete(self, view: View) -> bool:
        """Return whether another frame of the same view would not improve the picture."""
        if view.aliased is None:
            return self._repeated >= view.settings.camera.antialias
        return self.index + 1 >= view.frames

    def _update(self, view: View, inputs: tuple[Any, ...]) -> None:
        """Update the GPU's copy of the scene, and the declaration."""
        scene, _, _, show, *_ = inputs
        found = self._send(view, scene)
        self._inputs = inputs
        self._declare(view, show, found)
        self.shows_preview = found.is_preview

    def _send(self, view: View, scene: Fingerprint) -> SceneInputs:
        """Update the GPU data of the scene that the technique needs; return the inputs of the technique."""
        settings, upload = view.settings, self.fitting_upload(view.settings)
        if self._inputs is None or scene != self._inputs[0]:
            upload.update(view.scene)
        upload.set_seed(settings.seed)
        shot = Shot(
            self.graph,
            upload,
            view.scene,
            view.camera,
            view.size,
            self.index,
            view.frames,
            self._drawn,
            None if self._moving < 0 else self._moving,
            self.kept,
            self._preview,
            view.window,
        )
        return technique_of(settings.gi).inputs(shot, settings)

    def fitting_upload(self, settings: Settings) -> SceneUpload:
        """Return the GPU's copy of the scene; a new, empty one if there is none, or none that fits the settings."""
        if self.upload is None or self.upload.diffuse != settings.diffuse:
            if self.upload is not None:
                self.upload.release()
            self.upload = SceneUpload(self._device, settings.diffuse)
            self.invalidate(declaration=True)
        return self.upload

    def expect_motion(self, view: View, instances: list[Instance]) -> None:
        """Lay out the GPU's copy of the scene for motion of these instances; call before the first frame."""
        upload = self.fitting_upload(view.settings)
        upload.expect_motion(instances)
        upload.update(view.scene)

    def scene_upload(self, view: View) -> SceneUpload:
        """Return the GPU's copy of the scene as the last frame showed it; without a frame, as `view` has it."""
        upload = self.fitting_upload(view.settings)
        if self._declared is None:
            upload.update(view.scene)
        return upload

    def current_upload(self, view: View) -> SceneUpload:
        """Return the GPU's copy of the scene as `view` has it."""
        upload, scene = self.fitting_upload(view.settings), Fingerprint(view.scene)
        if self._inputs is None or self._inputs[0] != scene:
            upload.update(view.scene)
            self._inputs = None
        return upload

    def _declare(self, view: View, show: tuple[str, ...], inputs: SceneInputs) -> None:
        """Redeclare the frame if its passes would differ."""
        assert self._inputs is not None
        declared = (*self._inputs[2:], inputs.shape())
        if declared == self._declared:
            return
        self._declared = None
        self.graph.begin(view.size)
        frames = 1 if inputs.is_preview else view.frames
        exact = not varies(view.settings, view.scene)
        self._sources = declare_frame(self.graph, view.settings, inputs, frames, view.aliased, exact)
        wanted = [self.source(name, view.settings.gi).handle for name in show]
        self.graph.compile([handle for handle in wanted if handle is not None])
        self._declared = declared

    def source(self, name: str, gi: str) -> Source:
        """Return the source of a buffer of the last frame. Raises GiError if that frame does not have the buffer."""
        if name not in self._sources:
            absent = technique_of(gi).views.get(name) if self._sources else None
            raise GiError(f"{name!r} is empty: {absent or 'run the renderer first'}")
        return self._sources[name]

    def read_back(self, name: str, view: View) -> NDArray:
        """Return a buffer of the last frame, (height, width, 3) or (height, width) float32; `display` in bytes."""
        source = self.source(name, view.settings.gi)
        width, height = self.graph.size
        if source.handle is None:
            return np.zeros((height, width, 3), np.float32)
        pixels: NDArray = self.graph.read_back(source.handle).reshape(height, width, 4)
        if name == "display":
            return np.ascontiguousarray(pixels[..., :3])
        values: NDArray = pixels[..., source.first : source.first + source.count]
        if name == "position" and self.upload is not None:
            values = np.where(pixels[..., 3:] > 0, values + self.upload.origin, 0.0)
        if name == "instance":
            values = instances_shown(values, view.scene)
        return np.ascontiguousarray(values if source.count > 1 else values[..., 0], np.float32)


def instances_sent(scene: Scene) -> list[int]:
    """Return the places of the instances that are on the GPU, in their order there: those with triangles."""
    return [place for place, instance in enumerate(scene.instances) if len(instance.mesh.triangles)]


def instances_shown(numbers: NDArray[np.float32], scene: Scene) -> NDArray[np.float32]:
    """Return places in the scene's list, from 1, for numbers of instances on the GPU, from 1; 0 stays 0."""
    places = np.array([0, *(place + 1 for place in instances_sent(scene))], np.float32)
    shown: NDArray[np.float32] = places[numbers.astype(np.int64)]
    return shown


def copy_of(settings: Settings) -> Settings:
    """Return a copy with copies of the sections; all other values are immutable."""
    values = {field.name: getattr(settings, field.name) for field in fields(settings)}
    sections: dict[str, Any] = {name: copy(value) for name, value in values.items() if is_dataclass(value)}
    return replace(settings, **sections)
