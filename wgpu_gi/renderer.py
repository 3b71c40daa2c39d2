"""The Renderer keeps the GPU in step with a scene, a camera and settings, and runs frames; `frame.py` declares them."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .buffers import BUFFERS, buffers_of, check_buffers
from .camera import Camera, Window
from .errors import GiError, warn_of
from .gpu.describe import table
from .gpu.device import open_device
from .gpu.graph import Graph
from .gpu.handles import Texture
from .gpu.schedule import Stale
from .gpu.wgsl.load import refresh
from .gpu_frame import GpuFrame, View, copy_of, instances_sent, instances_shown
from .options import TECHNIQUES, Settings, check_size, check_window, technique_of
from .pictures.picture import Picture
from .pictures.tables import Table
from .pixel_tracer import PixelTruth, check_counts, checked_pixels
from .records import KnownAttributes
from .scene.check import check_camera, check_scene, check_structure
from .scene.files.camera_files import camera_of
from .scene.load import lit
from .scene.pose import Pose
from .scene.rules import shown
from .scene.scene import Scene
from .settings import validate
from .surface_tracer import checked_rays
from .techniques.shared.sampling import CameraSettings
from .upload.scene_upload import SceneUpload

__all__ = ["BUFFERS", "TECHNIQUES", "CameraSettings", "Renderer", "Settings"]


class Renderer(KnownAttributes):
    """Renders a scene, once or many times.

    Change `scene`, `camera`, `settings` or `size` between frames; the next `run` uploads what changed and runs the
    passes that depend on it. A new exposure keeps the frames averaged so far. A new `spp` keeps the samples if the
    result is bit for bit that of a new renderer. With `moving`, pictures are single frames, and their radiance is
    anti-aliased over those before (`camera.antialias`). Pictures are (height, width, 3) float32 linear radiance, row 0
    on top.

    With a `time` in seconds, the renderer shows its scene at that time of `animation` (a name or an index in
    `scene.animations`; None: the first): before 0 the first pose, after the end the last. The animation drives the
    values that its channels name: transforms, joints, morph weights, values of lights, cameras and materials. All else
    follows `scene`, which may change at any time. A `camera` that is in `scene.cameras` moves with it. With the time
    None, the scene is shown as it stands.

    With a `window`, `Window(corner, whole)`, pictures of `size` are that part of a larger picture, and the camera's
    angle is that of the whole.

    A Renderer serves one thread at a time; a second thread gets a GiError while the first renders. Renderers in
    several threads take turns at the GPU, frame by frame. A new process must be spawned, not forked.
    """

    __slots__ = (
        "_checked",
        "_closed",
        "_complete",
        "_device",
        "_gpu",
        "_lock",
        "_pose",
        "_ran",
        "_shaders",
        "animation",
        "automatic_exposure",
        "camera",
        "moving",
        "on_compile",
        "scene",
        "settings",
        "size",
        "time",
        "window",
    )

    def __init__(
        self,
        scene: Any,
        *,
        size: tuple[int, int] = (640, 360),
        camera: Camera | str | int | dict[str, Any] | None = None,
        settings: Settings | None = None,
        adapter: str | None = None,
    ) -> None:
        """Open the adapter (by part of its name, or the best). Raises GiError for bad values, or without an adapter.

        `scene` is a Scene, which is rendered as it stands, black if it has no light; or what `load` takes. `camera` is
        a Camera, the name or the index of one in the scene, "auto", "inside" (at eye height), or the fields of a camera
        file; None: the scene's first, else "auto".
        """
        if isinstance(scene, Scene):
            check_scene(scene)
        else:
            scene, notes = lit(scene)
            warn_of(notes, stacklevel=2)
        self.scene: Scene = scene
        self.size = size
        self.window: Window | None = None  # the part of a larger picture that pictures are
        self.camera: Camera = camera_of(scene, camera)
        self.settings = Settings() if settings is None else settings
        self.time: float | None = None
        self.animation: str | int | None = None
        self._pose = Pose()
        self._checked: Settings | None = None  # a copy of the last settings that were valid
        self._check_values()
        if adapter is not None and not isinstance(adapter, str):
            raise GiError(f"adapter must be a part of the name of an adapter, not {shown(adapter)}")
        self._device = open_device(adapter, large_buffers=True)
        check_size(size, self._device)
        self._lock = threading.RLock()
        self._closed = False
        with self._device.use():
            self._gpu = GpuFrame(self._device)
            self._shaders = refresh()  # which version of the shader files is in use
        self.automatic_exposure = 0.0  # EV of `display` while `settings.exposure` is None; a viewer sets it
        # Receives how many pipelines of a new frame are compiled, and how many there are, as long as that takes.
        self.on_compile: Callable[[int, int], None] | None = None
        self.moving = False  # the next frames are those of a moving picture
        self._ran: dict[str, Stale] = {}  # why each pass ran, in the last step that ran any
        self._complete = False  # every pixel is known to have all its samples

    def __repr__(self) -> str:
        width, height = self.size
        return f"<Renderer {width}x{height}, {self.settings.gi}, {'closed' if self._closed else self.adapter_name}>"

    @property
    def adapter_name(self) -> str:
        """Name of the adapter in use."""
        return self._device.adapter_name

    @property
    def is_cpu(self) -> bool:
        """True if the adapter is a CPU."""
        return self._device.is_cpu

    @property
    def exposure(self) -> float:
        """EV of the buffer `display`."""
        return self.automatic_exposure if self.settings.exposure is None else self.settings.exposure

    @property
    def buffers(self) -> tuple[str, ...]:
        """The names of the buffers of the technique in the settings."""
        return buffers_of(self.settings.gi)

    @property
    def graph(self) -> Graph:
        """The render graph, for timings and the plan; `step` redeclares its passes and resources when they change."""
        return self._gpu.graph

    def release(self) -> None:
        """Free all GPU memory of this renderer; it can render again, from scratch."""
        with self._alone():
            self._gpu.release()

    def close(self) -> None:
        """Free all GPU memory for good; `with Renderer(...) as renderer:` calls it at the end of the block."""
        if not self._closed:
            self.release()
            self._closed = True

    def __enter__(self) -> Renderer:
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()

    def forget(self) -> None:
        """Drop all state of earlier frames; the next frame is that of a new renderer. The scene stays on the GPU."""
        with self._alone():
            self._gpu.forget()

    def expect_motion(self) -> None:
        """Prepare for all motion of the animation; call before the first frame, with the time set.

        A picture then does not depend, by rounding, on the frames before it: on which instances have moved, and where
        they stood at first.
        """
        with self._alone():
            view, rest = self._view(), {id(i) for i in self.scene.instances}
            self._gpu.expect_motion(view, [i for i in view.scene.instances if id(i) not in rest])

    def reload(self) -> bool:
        """Return True if shader files have changed; the next step then loads them.

        Steps do not read shader files otherwise.
        """
        with self._alone():
            before, self._shaders = self._shaders, refresh()
        if self._shaders == before:
            return False
        self._gpu.invalidate(declaration=True)
        return True

    @property
    def has_history(self) -> bool:
        """True if a pass of the last step reads contents of the previous frame."""
        return any(p.reads_history for p in self._gpu.graph.order)

    def __del__(self) -> None:
        """Free GPU memory; wgpu keeps textures and buffers until they are destroyed."""
        if hasattr(self, "_gpu"):
            self._device.discard(*self._gpu.releases)

    @property
    def shows_preview(self) -> bool:
        """True if the last step rendered a preview, which the still picture of the same view replaces."""
        return self._gpu.shows_preview

    @property
    def finished(self) -> int:
        """Frames in the mean of the still picture, or samples per pixel of the path tracer; 0 before the first frame.

        A picture can be read back as soon as it is above 0, even after an exception within a step.
        """
        return self._gpu.finished

    @contextmanager
    def _alone(self) -> Iterator[None]:
        """Use the device and this renderer. Raises GiError if another thread uses this renderer."""
        with self._reserved(), self._device.use():
            yield

    @contextmanager
    def _reserved(self) -> Iterator[None]:
        """Keep other threads from using this renderer, but not from using others. Raises GiError if one uses it."""
        if self._closed:
            raise GiError("this Renderer is closed; make a new one")
        self._device.check()
        if not self._lock.acquire(blocking=False):
            raise GiError("another thread is using this Renderer; make a Renderer for each thread")
        try:
            yield
        finally:
            self._lock.release()

    def run(
        self,
        progress: Callable[[float], None] | None = None,
        *,
        show: tuple[str, ...] | None = None,
        check: bool = False,
        timings: bool = False,
    ) -> None:
        """Render until the picture has all its samples or frames; `progress` receives the fraction done, 0 to 1.

        `show` names the buffers to read back, None all of the technique; passes that none of them needs do not run.
        `check` raises GiError at the first NaN, infinite or negative value that a pass writes; `timings` measures each
        pass. While `moving`, it renders one frame, and at first those that bounces of light need to settle.
        """
        with self._reserved():
            while self.step(progress, show=show, check=check, timings=timings):
                if self._view().aliased is None and self._gpu.index >= 0:
                    break
        if progress is not None:
            progress(1.0)

    def step(
        self,
        progress: Callable[[float], None] | None = None,
        *,
        show: tuple[str, ...] | None = None,
        check: bool = False,
        timings: bool = False,
        force: bool = False,
        preview: bool = False,
    ) -> bool:
        """Render one frame, which refines the last one if nothing changed. Return False if there was nothing to do.

        `force` runs every pass that `show` needs, changed or not. `preview`: the view moves, so a changed frame may
        err more in less time; the still picture then starts over without it.
        """
        self._check_values()
        shown = self.buffers if show is None else show
        check_buffers(shown, self.settings.gi)
        with self._alone():
            try:
                return self._step(shown, progress, check, timings, force, preview)
            except BaseException:
                # The frame is incomplete: the next step uploads everything again and restarts its average.
                self._gpu.invalidate()
                raise

    def _step(
        self,
        shown: tuple[str, ...],
        progress: Callable[[float], None] | None,
        check: bool,
        timings: bool,
        force: bool,
        preview: bool,
    ) -> bool:
        gpu, view, technique = self._gpu, self._view(), technique_of(self.settings.gi)
        check_camera(view.camera)
        gpu.graph.on_compile = self.on_compile
        gpu.prepare(view, shown, force, preview)
        graph, frames = gpu.graph, view.frames
        before = graph.settle_progress()
        runs = max((p.settle for p in graph.order), default=0)

        def on_chunk(fraction: float) -> None:
            if progress is not None:
                progress(min(1.0, (0.0 if before >= 1.0 else before) + fraction / max(runs, 1)))

        ran = gpu.run(self.settings, force, timings=timings, check=check, on_chunk=on_chunk)
        if progress is not None and frames > 1:
            ahead = technique.warm_up(self.settings)
            progress((ahead + gpu.index + 1) / (ahead + frames))
        if ran:
            self._complete = False
            self._ran = graph.last_run
        elif technique.refine is not None and not self._complete and technique.refined.intersection(shown):
            gpu.refining = technique.refine(graph, gpu.kept, self.settings)
            self._complete = not gpu.refining
            return gpu.refining
        return ran

    def read_back(self, name: str = "radiance") -> Picture:
        """Return a buffer of the last run as (height, width, 3) float32; `depth` as (height, width).

        radiance, direct, indirect, emission: W/(m2 sr). standard_error: of radiance by its random numbers, W/(m2 sr);
        radiance itself where a single frame or sample does not tell, 0 where nothing is random. depth: metres along the
        ray, 0 without a surface. position: world, metres. normal: unit, towards the viewer. motion: pixels right and
        down since the previous frame, and the distance in that frame in metres. instance: place in the scene's list,
        from 1; 0 without a surface. display: (height, width, 3) uint8, sRGB with exposure and tone curve, for screens.
        Raises GiError for an unknown buffer.
        """
        check_buffers((name,), self.settings.gi)
        with self._alone():
            return Picture(self._gpu.read_back(name, self._view()), name, self.settings.exposure)

    def trace_pixels(
        self,
        pixels: ArrayLike,
        spp: int,
        *,
        seed: int = 0,
        replicates: int = 8,
        progress: Callable[[float], None] | None = None,
    ) -> PixelTruth:
        """Return the path-traced radiance of `pixels` (n, 2): whole numbers x, y, from the top left corner.

        Each gets `spp` paths, in `replicates` parts with independent random numbers that `seed` chooses, none of which
        a picture has; the spread of the parts gives the error. Camera, size, jitter, bounces (None: unlimited) and
        transparency are the renderer's; the scene is that of the last frame. The picture and its average stay. Raises
        GiError for pixels outside the picture and for numbers that do not fit.
        """
        self._check_values()
        chosen = checked_pixels(pixels, self.size)
        check_counts(spp, replicates, seed)
        with self._alone():
            view = self._view()
            upload, settings = self._gpu.scene_upload(view), view.settings
            jitter, transparent = settings.camera.jitter, settings.transparent
            seen = upload.view(view.camera, view.size, jitter, transparent=transparent, window=view.window)
            return self._gpu.pixels.trace(
                upload, seen, settings, chosen, spp=spp, seed=seed, replicates=replicates, progress=progress
            )

    def surfaces(self) -> dict[str, NDArray[np.float32]]:
        """Return the buffers albedo, normal, depth and instance, as `read_back` does, without rendering a picture.

        They are those of the scene, camera and size as they stand.
        """
        self._check_values()
        with self._alone():
            upload, seen, scene = self._seen()
            found = self._gpu.surfaces.surfaces(upload, seen)
            found["instance"] = instances_shown(found["instance"], scene)
            return found

    def amodal(self) -> NDArray[np.int64]:
        """Return how many pixels of the picture each instance would cover alone, and their box: (instances, 5).

        Columns: pixels, x, y, width, height. Pixels count by their centres, as in the buffer `instance`.
        """
        self._check_values()
        with self._alone():
            upload, seen, scene = self._seen()
            sent, found = instances_sent(scene), np.zeros((len(scene.instances), 5), np.int64)
            found[sent] = self._gpu.surfaces.amodal(upload, seen, len(sent))
            return found

    def corners(self) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return the triangle that each pixel's centre shows, and the point on it.

        Its vertices by place in the instance's mesh, (h, w, 3), and their weights, (h, w, 3), which mean nothing where
        the buffer `instance` is 0.
        """
        self._check_values()
        with self._alone():
            upload, seen, _ = self._seen()
            return self._gpu.surfaces.corners(upload, seen)

    def reaches(
        self, starts: ArrayLike, directions: ArrayLike, limits: ArrayLike, scene: Scene | None = None
    ) -> NDArray[np.bool_]:
        """Return whether rays get as far as `limits` (n,), in lengths of `directions` (n, 3), from `starts` (n, 3).

        All in world space, metres; a limit may be infinite. `scene`: None is the renderer's. A surface does not
        count if it lies in the last 0.01 % of the length, or if it is blended or thin, smooth glass that lets pass more
        than half of the light. Raises GiError for rays that do not fit, and a scene that cannot be rendered.
        """
        self._check_values()
        rays = checked_rays(starts, directions, limits)
        with self._alone():
            upload, seen, own = self._seen()
            if scene is not None and scene is not own:
                upload = self._gpu.surfaces.upload_of(scene, self.settings.diffuse)
            return self._gpu.surfaces.reaches(upload, seen, *rays)

    def _seen(self) -> tuple[SceneUpload, NDArray[np.void], Scene]:
        """Return the GPU's copy of the scene as it stands, its uniform View without jitter, and the scene."""
        view = self._view()
        check_camera(view.camera)
        upload = self._gpu.current_upload(view)
        return upload, upload.view(view.camera, view.size, False, window=view.window), view.scene

    def display_texture(self) -> Any:
        """Return the wgpu texture of the buffer `display`, rgba8unorm; valid until the next step."""
        handle = self._gpu.source("display", self.settings.gi).handle
        assert isinstance(handle, Texture)
        return handle.object()

    def plan(self) -> Table:
        """Return a table of the passes of the last frame that ran any: what each did, and why."""
        return table(self._gpu.graph.plan(self._ran, counts=True)) if self._ran else Table("")

    def timings(self) -> Table:
        """Return the median milliseconds of each pass that was measured, as a text table."""
        rows = [(r.name, r.ms) for r in self._gpu.graph.plan() if r.ms is not None]
        rows.append(("sum", sum(ms for _, ms in rows)))
        lines = [f"{name:<24} {ms:9.2f} ms" for name, ms in rows]
        return Table("\n".join(lines), ("pass", "ms"), [(name, f"{ms:.2f}") for name, ms in rows])

    @property
    def posed_scene(self) -> Scene:
        """The scene that the next frame shows: at `time`, or `scene` itself. Each frame poses the same objects anew."""
        return self._posed()[0]

    @property
    def posed_camera(self) -> Camera:
        """The camera of the next frame: where the animation moves it, else `camera` itself."""
        return self._posed()[1]

    def _posed(self) -> tuple[Scene, Camera]:
        return self._pose.at(self.scene, self.camera, self.time, self.animation)

    def _view(self) -> View:
        return View(*self._posed(), self.size, replace(self.settings, exposure=self.exposure), self.moving, self.window)

    def _check_values(self) -> None:
        """Raise GiError for settings, a size, a camera or a scene that cannot be rendered.

        The values of a scene are checked when it is new, and when it is uploaded.
        """
        if not isinstance(self.settings, Settings):
            raise GiError(f"settings must be Settings(...), not {shown(self.settings)}")
        if self.settings != self._checked:
            validate(self.settings)
            self._checked = copy_of(self.settings)
        check_size(self.size)
        check_window(self.size, self.window)
        if self.window is not None and self.moving:
            raise GiError("a moving picture has no window: its frames follow from one another; render it whole")
        check_camera(self.camera)
        check_structure(self.scene)
