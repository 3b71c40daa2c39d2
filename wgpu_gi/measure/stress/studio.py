"""Takes pictures of many scenes with one renderer, and measures their time; turns what goes wrong into `Trouble`."""

from __future__ import annotations

import gc
import logging
import time
from collections.abc import Callable, Iterable, Sequence
from copy import deepcopy
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import wgpu
from numpy.typing import NDArray

from ...camera import Camera
from ...errors import GiError
from ...options import TECHNIQUES, Settings
from ...renderer import Renderer
from ...scene.player import Player
from ...scene.scene import Scene
from ...settings import apply_quality

LIGHT = ("radiance", "direct", "indirect", "emission")
SHOWN = (*LIGHT, "albedo", "depth")
PATH_SPP = 8  # samples per pixel of the path tracer for one seed: as long as a frame of many-light
REMEMBERED = 6  # views: the truths of the techniques for one scene
FRAME_SECONDS = 20.0  # bound for a picture of one seed

Layers = dict[str, NDArray[np.float64]]


class Trouble(Exception):
    """A picture that could not be taken: `kind` is the class of the failure."""

    def __init__(self, kind: str, sentence: str) -> None:
        super().__init__(sentence)
        self.kind, self.sentence = kind, sentence


@dataclass(frozen=True)
class View:
    """What to take a picture of, and how."""

    scene: Scene
    camera: Camera | None = None  # None: the first of the scene
    size: tuple[int, int] | None = None  # None: that of the studio
    bounces: int | None = None
    visible_only: bool = False
    spp: int = PATH_SPP
    frames: int | None = 1  # of a still picture; None: those of the studio's settings
    before: Camera | None = None  # a pose that the camera had before
    times: tuple[float, ...] = ()  # to which the first animation plays, in seconds, one after the other
    shaken: bool = False  # each seed turns the camera by up to half a pixel, so that pixels sample their squares


@dataclass
class Times:
    """Milliseconds of pictures: the first of a scene, which uploads and declares, and those of further seeds."""

    first: list[float] = field(default_factory=list)
    further: list[float] = field(default_factory=list)


class Studio:
    """Renders views with one renderer, so that pipelines are shared. `make` makes the renderer; tests replace it."""

    def __init__(
        self,
        size: tuple[int, int] = (64, 36),
        quality: str = "medium",
        adapter: str | None = None,
        settings: Settings | None = None,
        frame_seconds: float = FRAME_SECONDS,
        make: Callable[..., Renderer] = Renderer,
    ) -> None:
        self.size, self.adapter, self.frame_seconds, self._make = size, adapter, frame_seconds, make
        self.thorough = True  # False: statistical checks take fewer seeds, while a scene is reduced
        self.settings = settings or Settings()
        if settings is None:
            apply_quality(self.settings, quality)
        self.times: dict[str, Times] = {}
        self._memory: dict[tuple[object, ...], list[Layers]] = {}
        self._renderer: Renderer | None = None
        self._errors = _ErrorLog()

    def take(self, gi: str, view: View, seeds: Iterable[int] = (0,), *, check: bool = False) -> list[Layers]:
        """Return a picture for each seed, float64 layers by name; `check` names the pass of a bad value.

        Each picture starts without history. Raises Trouble for an error, a validation error or a frame that takes too
        long.
        """
        seeds = list(seeds)
        try:
            with self._errors:
                pictures = [self._one(gi, view, seed, first=k == 0, check=check) for k, seed in enumerate(seeds)]
        except Trouble:
            self.reset()
            raise
        except GiError as error:
            self.reset()
            raise Trouble("refused", str(error)) from error
        except wgpu.GPUError as error:
            self.reset()
            raise Trouble("validation", " ".join(str(error).split())[:400]) from error
        except Exception as error:
            self.reset()
            raise Trouble(f"raised {type(error).__name__}", f"{type(error).__name__}: {error}"[:400]) from error
        if self._errors.messages:
            self.reset()
            raise Trouble("validation", self._errors.messages[0])
        return pictures

    def remembered(self, gi: str, view: View, seeds: Sequence[int]) -> list[Layers]:
        """Return pictures as `take`, from memory for one of the last views: techniques share their truths."""
        key = (gi, view, tuple(seeds), self.size)
        if key not in self._memory:
            if len(self._memory) >= REMEMBERED:
                del self._memory[next(iter(self._memory))]
            self._memory[key] = self.take(gi, view, seeds)
        return self._memory[key]

    def reset(self) -> None:
        """Free all GPU memory; the next picture has a new renderer."""
        if self._renderer is not None:
            self._renderer.release()
            self._renderer = None

    def counts(self) -> dict[str, int]:
        """Return the number of GPU buffers and textures that the process has, after the release of the renderer."""
        self.reset()
        gc.collect()
        counts = object_counts()
        return {name: int(counts[name]["count"]) for name in ("Buffer", "Texture", "BindGroup", "TextureView")}

    def _one(self, gi: str, view: View, seed: int, first: bool, check: bool) -> Layers:
        settings = deepcopy(self.settings)
        settings.gi, settings.seed, settings.spp, settings.bounces = gi, seed, view.spp, view.bounces
        settings.camera.jitter = False
        if view.frames is not None:
            settings.camera.frames = view.frames
        settings.path.visible_only = view.visible_only
        renderer = self._prepared(view, settings, first)
        if view.before is not None:
            at_rest, renderer.camera = renderer.camera, view.before
            self._run(renderer, check)
            renderer.camera = at_rest
        if view.times:
            player = Player(view.scene, None)
            renderer.scene = player.scene
            for moment in view.times[:-1]:
                player.pose(moment)
                self._run(renderer, check)
            player.pose(view.times[-1])
        started = self._now(renderer)
        self._run(renderer, check)
        layers = {name: np.asarray(renderer.read_back(name), np.float64) for name in SHOWN}
        times = self.times.setdefault(gi, Times())
        (times.first if first else times.further).append((self._now(renderer) - started) * 1e3)
        return layers

    def _prepared(self, view: View, settings: Settings, first: bool) -> Renderer:
        camera = view.camera or view.scene.cameras[0]
        if view.shaken:
            camera = _shaken(camera, view.size or self.size, settings.seed)
        if self._renderer is None:
            self._renderer = self._make(
                view.scene, size=view.size or self.size, camera=camera, settings=settings, adapter=self.adapter
            )
            return self._renderer
        renderer = self._renderer
        if first or renderer.has_history:
            renderer.forget()
        renderer.scene, renderer.camera, renderer.settings = view.scene, camera, settings
        renderer.size = view.size or self.size
        return renderer

    def _now(self, renderer: Renderer) -> float:
        """Return seconds: of this process on a CPU adapter, so that other load does not count, else of the wall."""
        return time.process_time() if renderer.is_cpu else time.perf_counter()

    def _run(self, renderer: Renderer, check: bool) -> None:
        """Render to the end, within the bound of time."""
        started = self._now(renderer)

        def watch(fraction: float) -> None:
            if self._now(renderer) - started > self.frame_seconds:
                raise Trouble("slow", f"a picture takes more than {self.frame_seconds:g} s")

        while renderer.step(watch, show=SHOWN, check=check):
            watch(0.0)


def object_counts() -> dict[str, Any]:
    """Return the numbers of wgpu objects that Python holds, by type."""
    return wgpu.diagnostics.object_counts.get_dict()


class _ErrorLog(logging.Handler):
    """Collects the errors that wgpu logs instead of raising, while it is entered."""

    def __init__(self) -> None:
        super().__init__(logging.ERROR)
        self.messages: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Keep the message on one line."""
        self.messages.append(" ".join(record.getMessage().split())[:400])

    def __enter__(self) -> None:
        self.messages.clear()
        logging.getLogger("wgpu").addHandler(self)

    def __exit__(self, *_: object) -> None:
        logging.getLogger("wgpu").removeHandler(self)


def _shaken(camera: Camera, size: tuple[int, int], seed: int) -> Camera:
    """Return the camera turned, or moved if it is orthographic, by a random part of a pixel."""
    dx, dy = np.random.default_rng([seed, size[1]]).uniform(-0.5, 0.5, 2) / size[1]
    pose = camera.world_from_view.copy()
    if camera.orthographic_height is not None:
        pose[:3, 3] += camera.orthographic_height * (dx * pose[:3, 0] + dy * pose[:3, 1])
        return replace(camera, world_from_view=pose)
    # Turn about the camera's y axis, then about its x axis.
    angles = np.arctan(2 * np.tan(camera.yfov / 2) * np.array([dx, dy]))
    (cy, cx), (sy, sx) = np.cos(angles), np.sin(angles)
    pose[:3, :3] = pose[:3, :3] @ np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    pose[:3, :3] = pose[:3, :3] @ np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    return replace(camera, world_from_view=pose)


def techniques() -> tuple[str, ...]:
    """Return all techniques, fast ones first."""
    return tuple(sorted(TECHNIQUES, key=lambda gi: gi == "path"))
