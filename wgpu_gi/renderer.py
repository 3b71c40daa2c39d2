"""The Renderer keeps the GPU in step with a scene, a camera and settings, and runs frames; `frame.py` declares them."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from copy import copy
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .buffers import BUFFERS, Source, buffers_of, check_buffers
from .camera import Camera
from .errors import GiError, warn_of
from .frame import declare_frame
from .gpu.describe import table
from .gpu.device import open_device
from .gpu.graph import Graph
from .gpu.handles import Texture
from .gpu.schedule import Stale
from .gpu.wgsl.load import refresh
from .options import TECHNIQUES, Settings, check_size, picture_count, technique_of
from .pictures.picture import Picture
from .pictures.tables import Table
from .records import KnownAttributes
from .scene.check import check_camera, check_scene, check_structure
from .scene.files.camera_files import camera_of
from .scene.load import lit
from .scene.rules import shown
from .scene.scene import Scene
from .settings import validate
from .techniques.shared.composite import MEANS
from .techniques.shared.sampling import CameraSettings
from .techniques.shared.scene_inputs import SceneInputs
from .techniques.shared.technique import Kept, Shot
from .upload.fingerprint import Fingerprint
from .upload.scene_upload import SceneUpload

__all__ = ["BUFFERS", "TECHNIQUES", "CameraSettings", "Renderer", "Settings"]


class Renderer(KnownAttributes):
    """Renders a scene, once or many times.

    Change `scene`, `camera`, `settings` or `size` between frames; the next `run` uploads what changed and runs the
    passes that depend on it. A new exposure keeps the frames averaged so far. A new `spp` keeps the samples if the
    result is bit for bit that of a new renderer. Pictures are (height, width, 3) float32 linear radiance, row 0 on top.

    A Renderer serves one thread at a time; a second thread gets a GiError while the first renders. Renderers in
    several threads take turns at the GPU, frame by frame. A new process must be spawned, not forked.
    """

    __slots__ = (
        "_checked",
        "_closed",
        "_complete",
        "_declared",
        "_device",
        "_frame",
        "_graph",
        "_inputs",
        "_kept",
        "_lock",
        "_ran",
        "_refining",
        "_rested",
        "_shaders",
        "_sources",
        "_upload",
        "automatic_exposure",
        "camera",
        "scene",
        "settings",
        "size",
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
        self.camera: Camera = camera_of(scene, camera)
        self.settings = Settings() if settings is None else settings
        self._checked: Settings | None = None  # a copy of the last settings that were valid
        self._check_values()
        if adapter is not None and not isinstance(adapter, str):
            raise GiError(f"adapter must be a part of the name of an adapter, not {shown(adapter)}")
        self._device = open_device(adapter, large_buffers=True)
        check_size(size, self._device)
        self._lock = threading.RLock()
        self._closed = False
        with self._device.use():
            self._graph = Graph(self._device)
            self._shaders = refresh()  # which version of the shader files is in use
        self._upload: SceneUpload | None = None
        self._kept = Kept()
        self.automatic_exposure = 0.0  # EV of `display` while `settings.exposure` is None; a viewer sets it
        self._sources: dict[str, Source] = {}
        self._declared: tuple[object, ...] | None = None
        self._inputs: tuple[Any, ...] | None = None  # all that determines the picture
        self._frame = 0  # index among the frames of a still picture; negative during the warm-up
        self._rested = False  # nothing has moved in the last step
        self._ran: dict[str, Stale] = {}  # why each pass ran, in the last step that ran any
        self._complete = False  # every pixel is known to have all its samples
        self._refining = False  # the technique has planned more runs than were declared

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
        return self._graph

    def release(self) -> None:
        """Free all GPU memory of this renderer; it can render again, from scratch."""
        with self._alone():
            self.forget()
            if self._upload is not None:
                self._upload.release()
                self._upload = None

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
            self._graph.release()
            self._graph, self._declared, self._inputs = Graph(self._device), None, None
            self._sources = {}
            self._kept = Kept()

    def reload(self) -> bool:
        """Return True if shader files have changed; the next step then loads them.

        Steps do not read shader files otherwise.
        """
        with self._alone():
            before, self._shaders = self._shaders, refresh()
        if self._shaders == before:
            return False
        self._declared = self._inputs = None
        return True

    @property
    def has_history(self) -> bool:
        """True if a pass of the last step reads contents of the previous frame."""
        return any(p.reads_history for p in self._graph.order)

    def __del__(self) -> None:
        """Free GPU memory; wgpu keeps textures and buffers until they are destroyed."""
        if hasattr(self, "_graph"):
            uploads = [] if self._upload is None else [self._upload.release]
            self._device.discard(self._graph.release, *uploads)

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
        pass.
        """
        with self._reserved():
            while self.step(progress, show=show, check=check, timings=timings):
                pass
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
    ) -> bool:
        """Render one frame, which refines the last one if nothing changed. Return False if there was nothing to do.

        `force` runs every pass that `show` needs, changed or not.
        """
        self._check_values()
        shown = self.buffers if show is None else show
        check_buffers(shown, self.settings.gi)
        with self._alone():
            try:
                return self._step(shown, progress, check, timings, force)
            except BaseException:
                # The frame is incomplete: the next step uploads everything again and restarts its average.
                self._inputs = None
                raise

    def _step(
        self,
        shown: tuple[str, ...],
        progress: Callable[[float], None] | None,
        check: bool,
        timings: bool,
        force: bool,
    ) -> bool:
        self._prepare(shown, force)
        graph, frames, technique = self._graph, picture_count(self.settings, self.scene), technique_of(self.settings.gi)
        before = graph.settle_progress()
        runs = max((p.settle for p in graph.order), default=0)

        def on_chunk(fraction: float) -> None:
            if progress is not None:
                progress(min(1.0, (0.0 if before >= 1.0 else before) + fraction / max(runs, 1)))

        ran = graph.run(force, timings=timings, check=check, on_chunk=on_chunk)
        if progress is not None and frames > 1:
            ahead = technique.warm_up(self.settings)
            progress((ahead + self._frame + 1) / (ahead + frames))
        if ran:
            self._complete = False
            self._ran = graph.last_run
        elif technique.refine is not None and not self._complete and technique.refined.intersection(shown):
            self._refining = technique.refine(graph, self._kept, self.settings)
            self._complete = not self._refining
            return self._refining
        return ran

    def read_back(self, name: str = "radiance") -> Picture:
        """Return a buffer of the last run as (height, width, 3) float32; `depth` as (height, width).

        radiance, direct, indirect, emission, standard_error: W/(m2 sr). depth: metres along the ray, 0 without a
        surface. position: world, metres. normal: unit, towards the viewer. motion: pixels right and down since the
        previous frame, and the distance in that frame in metres. instance: place in the scene's list, from 1; 0 without
        a surface. display: (height, width, 3) uint8, sRGB with exposure and tone curve, for screens. Raises GiError for
        an unknown buffer.
        """
        check_buffers((name,), self.settings.gi)
        with self._alone():
            return self._read_back(name)

    def _read_back(self, name: str) -> Picture:
        source = self._source(name)
        width, height = self._graph.size
        if source.handle is None:
            return self._picture(name, np.zeros((height, width, 3), np.float32))
        pixels = self._graph.read_back(source.handle).reshape(height, width, 4)
        if name == "display":
            return self._picture(name, pixels[..., :3])
        values: NDArray = pixels[..., source.first : source.first + source.count]
        if name == "position" and self._upload is not None:
            values = np.where(pixels[..., 3:] > 0, values + self._upload.origin, 0.0)
        if name == "instance":
            # Instances without triangles are not on the GPU.
            shown = [number for number, i in enumerate(self.scene.instances, 1) if len(i.mesh.triangles)]
            values = np.array([0, *shown])[values.astype(np.int64)]
        return self._picture(name, (values if source.count > 1 else values[..., 0]).astype(np.float32, copy=False))

    def _picture(self, name: str, values: NDArray) -> Picture:
        return Picture(np.ascontiguousarray(values), name, self.settings.exposure)

    def display_texture(self) -> Any:
        """Return the wgpu texture of the buffer `display`, rgba8unorm; valid until the next step."""
        handle = self._source("display").handle
        assert isinstance(handle, Texture)
        return handle.object()

    def plan(self) -> Table:
        """Return a table of the passes of the last frame that ran any: what each did, and why."""
        return table(self._graph.plan(self._ran)) if self._ran else Table("")

    def timings(self) -> Table:
        """Return the median milliseconds of each pass that was measured, as a text table."""
        rows = [(r.name, r.ms) for r in self._graph.plan() if r.ms is not None]
        rows.append(("sum", sum(ms for _, ms in rows)))
        lines = [f"{name:<24} {ms:9.2f} ms" for name, ms in rows]
        return Table("\n".join(lines), ("pass", "ms"), [(name, f"{ms:.2f}") for name, ms in rows])

    def _prepare(self, show: tuple[str, ...], force: bool) -> None:
        """Upload what changed; redeclare the frame if its passes changed."""
        check_size(self.size, self._device)
        settings = replace(self.settings, exposure=self.exposure)
        scene = Fingerprint(self.scene)
        camera = self.camera
        pose = (np.asarray(camera.world_from_view).tobytes(), camera.yfov, camera.orthographic_height)
        frames = picture_count(settings, self.scene)
        seen = (scene, pose, self.size, show, frames)
        before = self._inputs or ()
        refining, self._refining = self._refining, False
        still = not force and seen == before[: len(seen)]
        same = still and not refining and (settings,) == before[len(seen) :]
        if same and self._rested and self._frame + 1 >= frames:
            return
        # One more step after the last change sets all motion to zero.
        self._rested = same
        known = before[len(seen)] if before else None
        inputs = (*seen, known if settings == known else _copy(settings))
        goes_on, up_to_date = same, None
        if still and not same:
            # Only settings differ: keep the frames averaged so far unless a pass of the mean has become stale.
            self._update(inputs)
            up_to_date = self._frame
            goes_on = not any(name.startswith(MEANS) for name in self._graph.stale())
        first = -technique_of(settings.gi).warm_up(settings)
        self._frame = min(self._frame + 1, frames - 1) if goes_on else first
        if self._frame != up_to_date:
            self._update(inputs)

    def _update(self, inputs: tuple[Any, ...]) -> None:
        """Update the GPU's copy of the scene, and the declaration."""
        scene, _, _, show, *_ = inputs
        found = self._send(scene)
        self._inputs = inputs
        self._declare(show, found)

    def _send(self, scene: Fingerprint) -> SceneInputs:
        """Update the GPU data of the scene that the technique needs; return the inputs of the technique."""
        settings, upload = self.settings, self._upload
        if upload is None or upload.diffuse != settings.diffuse:
            if upload is not None:
                upload.release()
            self._upload = upload = SceneUpload(self._device, settings.diffuse)
            self._inputs = None
        if self._inputs is None or scene != self._inputs[0]:
            upload.update(self.scene)
        frames = picture_count(settings, self.scene)
        shot = Shot(self._graph, upload, self.scene, self.camera, self.size, self._frame, frames, self._kept)
        return technique_of(settings.gi).inputs(shot, settings)

    def _declare(self, show: tuple[str, ...], inputs: SceneInputs) -> None:
        """Redeclare the frame if its passes would differ."""
        assert self._inputs is not None
        declared = (*self._inputs[2:], inputs.shape())
        if declared == self._declared:
            return
        self._declared = None
        self._graph.begin(self.size)
        self._sources = declare_frame(
            self._graph,
            replace(self.settings, exposure=self.exposure),
            inputs,
            picture_count(self.settings, self.scene),
        )
        wanted = [self._source(name).handle for name in show]
        self._graph.compile([handle for handle in wanted if handle is not None])
        self._declared = declared

    def _source(self, name: str) -> Source:
        """Return the source of a buffer of the last frame. Raises GiError if that frame does not have the buffer."""
        if name not in self._sources:
            absent = technique_of(self.settings.gi).views.get(name) if self._sources else None
            raise GiError(f"{name!r} is empty: {absent or 'run the renderer first'}")
        return self._sources[name]

    def _check_values(self) -> None:
        """Raise GiError for settings, a size, a camera or a scene that cannot be rendered.

        The values of a scene are checked when it is new, and when it is uploaded.
        """
        if not isinstance(self.settings, Settings):
            raise GiError(f"settings must be Settings(...), not {shown(self.settings)}")
        if self.settings != self._checked:
            validate(self.settings)
            self._checked = _copy(self.settings)
        check_size(self.size)
        check_camera(self.camera)
        check_structure(self.scene)


def _copy(settings: Settings) -> Settings:
    """Return a copy with copies of the sections; all other values are immutable."""
    values = {field.name: getattr(settings, field.name) for field in fields(settings)}
    sections: dict[str, Any] = {name: copy(value) for name, value in values.items() if is_dataclass(value)}
    return replace(settings, **sections)
