"""The frame: every technique in order, and the Renderer that keeps a scene, a camera and a graph in step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from .camera import Camera
from .errors import GiError
from .gpu.describe import table
from .gpu.device import open_device
from .gpu.graph import Graph
from .gpu.handles import Handle
from .scene.camera_files import framing_camera
from .scene.scene import Scene
from .scene.upload import SceneUpload
from .settings import setting, validate
from .techniques.reference import PathSettings, declare_primary, declare_reference, path_runs
from .techniques.scene_inputs import SceneInputs, share_scene

MAX_SIDE = 8192  # the default limit of WebGPU for a texture's side
MAX_PIXELS = 2**25  # 96 bytes of running means and results each: 3 GiB

# What `read_back` and `--show` know: the graph's texture or per-pixel buffer, and the channels of it.
BUFFER_SOURCES: dict[str, tuple[str, slice | int]] = {
    "radiance": ("path/radiance", slice(0, 3)),
    "direct": ("path/direct", slice(0, 3)),
    "indirect": ("path/indirect", slice(0, 3)),
    "emission": ("path/emission", slice(0, 3)),
    "standard_error": ("path/standard_error", slice(0, 3)),
    "albedo": ("primary/albedo", slice(0, 3)),
    "normal": ("primary/normal", slice(0, 3)),
    "depth": ("primary/normal", 3),
    "position": ("primary/position", slice(0, 3)),
}
BUFFERS = tuple(BUFFER_SOURCES)


@dataclass
class CameraSettings:
    """How pixels are sampled."""

    jitter: bool = setting(True, "Average over the pixel's square (box filter) instead of sampling its centre.")


@dataclass
class Settings:
    """What to render and how well. Sections are reached as `section.name` by `--set`."""

    gi: str = setting("path", "Technique: path (path tracer) or none (direct light only).", choices=("path", "none"))
    bounces: int | None = setting(None, "Indirect bounces; none for all of them.", "bounces", range=(0, 10_000))
    spp: int = setting(64, "Samples per pixel of the path tracer.", "samples", range=(1, 10_000_000))
    seed: int = setting(0, "Seed of all random numbers.", range=(0, 2**32 - 1))
    diffuse: bool = setting(False, "Treat every material as Lambert with its base colour.")
    camera: CameraSettings = field(default_factory=CameraSettings)
    path: PathSettings = field(default_factory=PathSettings)


def declare_frame(graph: Graph, settings: Settings, scene: SceneInputs, extra_runs: int = 0) -> list[Handle]:
    """Declare the passes of a frame; return what can be shown. The first page to read.

    `extra_runs` are for pixels whose paths are too long to be done in the runs planned.
    """
    # Until there is a deferred base, direct light alone is the path tracer without indirect bounces.
    bounces = 0 if settings.gi == "none" else settings.bounces
    runs = path_runs(settings.path, settings.spp) + extra_runs
    reference = declare_reference(
        graph, settings.path, scene, spp=settings.spp, runs=runs, bounces=bounces, seed=settings.seed
    )
    primary = declare_primary(graph, scene)
    return [
        reference.radiance,
        reference.direct,
        reference.indirect,
        reference.emission,
        reference.standard_error,
        primary.albedo,
        primary.normal,
        primary.position,
    ]


class Renderer:
    """Renders a scene, once or many times.

    Change `scene`, `camera`, `settings` or `size` as you like; the next `run` sends what changed to the GPU and runs
    the passes that it makes stale. Pictures are (height, width, 3) float32 linear radiance, row 0 on top.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        size: tuple[int, int] = (640, 360),
        camera: Camera | None = None,
        settings: Settings | None = None,
        adapter: str | None = None,
    ) -> None:
        """Open the adapter (by part of its name, or the best). Raises GiError for a bad size, or without an adapter."""
        self.scene = scene
        self.size = size
        self.camera = camera or (scene.cameras[0] if scene.cameras else framing_camera(scene))
        self.settings = settings or Settings()
        check_size(*size)
        self._device = open_device(adapter, large_buffers=True)
        self._graph = Graph(self._device)
        self._upload: SceneUpload | None = None
        self._declared: tuple[object, ...] | None = None
        self._plan = ""
        self._complete = False  # every pixel is known to have all its samples
        self._extra_runs = 0  # of the path tracer, for pixels that are behind

    @property
    def adapter_name(self) -> str:
        """Name of the adapter in use."""
        return self._device.adapter_name

    @property
    def is_cpu(self) -> bool:
        """True if the adapter is a CPU."""
        return self._device.is_cpu

    def release(self) -> None:
        """Free all GPU memory of this renderer; it can render again, from scratch."""
        self._graph.release()
        if self._upload is not None:
            self._upload.release()
        self._graph, self._upload, self._declared = Graph(self._device), None, None

    def __del__(self) -> None:
        """Textures and buffers of wgpu linger until destroyed."""
        if hasattr(self, "_graph"):
            self._graph.release()
            if self._upload is not None:
                self._upload.release()

    def run(
        self,
        progress: Callable[[float], None] | None = None,
        *,
        show: tuple[str, ...] = BUFFERS,
        check: bool = False,
        timings: bool = False,
    ) -> None:
        """Render until the picture has all its samples; `progress` is called with the fraction done, 0 to 1.

        `show` names the buffers that will be read back: passes that none of them needs are not run. `check` raises
        GiError at the first NaN, infinite or negative value that a pass writes; `timings` measures each pass.
        """
        while self.step(progress, show=show, check=check, timings=timings):
            pass
        if progress is not None:
            progress(1.0)

    def step(
        self,
        progress: Callable[[float], None] | None = None,
        *,
        show: tuple[str, ...] = BUFFERS,
        check: bool = False,
        timings: bool = False,
        force: bool = False,
    ) -> bool:
        """Render one frame, a refinement of the one before if nothing changed; return False if there was nothing to do.

        `force` runs every pass that `show` needs, changed or not.
        """
        for name in show:
            _check_buffer(name)
        self._prepare(show)
        before = self._graph.settle_progress()
        total_runs = path_runs(self.settings.path, self.settings.spp) + self._extra_runs

        def on_chunk(fraction: float) -> None:
            if progress is not None:
                progress(min(1.0, (0.0 if before >= 1.0 else before) + fraction / total_runs))

        ran = self._graph.run(force, timings=timings, check=check, on_chunk=on_chunk)
        if not ran and not self._complete and any(BUFFER_SOURCES[name][0].startswith("path/") for name in show):
            self._complete = self._catch_up()
            ran = not self._complete
        elif ran:
            self._complete = False
            self._plan = table(self._graph.plan())
        return ran

    def _catch_up(self) -> bool:
        """Plan more runs for pixels whose paths took so many steps that they are behind; return True if none is."""
        samples = int(self._graph.read_back("path/emission").reshape(-1, 4)[:, 3].min())
        missing = self.settings.spp - samples
        runs = path_runs(self.settings.path, self.settings.spp) + self._extra_runs
        # As many runs as the slowest pixel needs at its pace so far.
        self._extra_runs += -(-missing * runs // max(samples, 1))
        return missing <= 0

    def read_back(self, name: str = "radiance") -> NDArray[np.float32]:
        """Return a buffer of the last run as (height, width, 3) float32; `depth` as (height, width).

        radiance, direct, indirect, emission, standard_error: W/(m2 sr). depth: metres along the ray, 0 where nothing is
        seen. position: world, metres. normal: unit, towards the viewer. Raises GiError for an unknown name.
        """
        _check_buffer(name)
        source, channels = BUFFER_SOURCES[name]
        pixels = self._graph.read_back(source).reshape(self._graph.size[1], self._graph.size[0], 4)
        values: NDArray = pixels[..., channels]
        if name == "position" and self._upload is not None:
            seen = pixels[..., 3:] > 0
            values = np.where(seen, values + self._upload.origin, 0.0)
        return np.ascontiguousarray(values, np.float32)

    def plan(self) -> str:
        """Return what each pass did in the last frame that ran any, and why, as a text table."""
        return self._plan

    def timings(self) -> str:
        """Return the median milliseconds of each pass that was measured, as a text table."""
        rows = [r for r in self._graph.plan() if r.ms is not None]
        lines = [f"{r.name:<24} {r.ms:9.2f} ms" for r in rows]
        return "\n".join([*lines, f"{'sum':<24} {sum(r.ms or 0 for r in rows):9.2f} ms"])

    def _prepare(self, show: tuple[str, ...]) -> None:
        """Send what changed and declare the frame anew if its shape changed."""
        check_size(*self.size)
        validate(self.settings)
        if self._upload is None or self._upload.diffuse != self.settings.diffuse:
            if self._upload is not None:
                self._upload.release()
            self._upload = SceneUpload(self._device, self.settings.diffuse)
        self._upload.update(self.scene)
        inputs = share_scene(self._graph, self._upload)
        self._graph.uniform("scene", self._upload.info)
        self._graph.uniform("view", self._upload.view(self.camera, self.size, self.settings.camera.jitter))
        copied = replace(self.settings, camera=replace(self.settings.camera), path=replace(self.settings.path))
        declared = (copied, self.size, inputs.features, frozenset(show), self._extra_runs)
        if declared == self._declared:
            return
        self._graph.begin(self.size)
        inputs = share_scene(self._graph, self._upload)
        declare_frame(self._graph, self.settings, inputs, self._extra_runs)
        self._graph.compile([BUFFER_SOURCES[name][0] for name in show])
        self._declared = declared


def render(
    scene: Scene,
    *,
    size: tuple[int, int] = (640, 360),
    camera: Camera | None = None,
    gi: str = "path",
    spp: int = 64,
    bounces: int | None = None,
    seed: int = 0,
    diffuse: bool = False,
    show: str = "radiance",
    settings: Settings | None = None,
    adapter: str | None = None,
    progress: Callable[[float], None] | None = None,
) -> NDArray[np.float32]:
    """Render one picture: (height, width, 3) float32 linear radiance in W/(m2 sr), or the buffer `show`.

    The sections of `settings` give the finer knobs; its first level is replaced by the arguments here. Raises GiError
    for bad values.
    """
    chosen = replace(settings or Settings(), gi=gi, spp=spp, bounces=bounces, seed=seed, diffuse=diffuse)
    renderer = Renderer(scene, size=size, camera=camera, settings=chosen, adapter=adapter)
    renderer.run(progress, show=(show,))
    return renderer.read_back(show)


def _check_buffer(name: str) -> None:
    if name not in BUFFER_SOURCES:
        raise GiError(f"there is no buffer {name!r}; there is {', '.join(BUFFERS)}")


def check_size(width: int, height: int) -> None:
    """Raise GiError if a picture of this size cannot be rendered."""
    if width < 1 or height < 1:
        raise GiError(f"size {width}x{height}: a picture has at least 1x1 pixels")
    if width > MAX_SIDE or height > MAX_SIDE or width * height > MAX_PIXELS:
        raise GiError(
            f"size {width}x{height}: at most {MAX_SIDE} pixels a side and {MAX_PIXELS // 2**20} million in all;"
            " make it smaller"
        )
