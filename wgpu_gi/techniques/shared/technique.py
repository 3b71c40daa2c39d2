"""The interface of a technique: its properties, its scene inputs, and the light that it returns.

The `__init__` of each folder in `techniques/` defines a `Technique`, with the settings and scene inputs that it reads,
and `declare_...(graph, settings, scene)`, which declares its passes and returns a `Light`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple, TypeVar, get_type_hints

from ...camera import Camera, Window
from ...gpu.graph import Graph
from ...gpu.handles import Buffer, Texture
from ...scene.scene import Scene
from ...upload.scene_upload import SceneUpload
from .scene_inputs import SceneInputs
from .stage import Stage

T = TypeVar("T")


class Kept:
    """State that a renderer keeps for its techniques between frames: one instance of each class that they request."""

    def __init__(self) -> None:
        self._instances: dict[type, Any] = {}

    def __call__(self, kind: type[T]) -> T:
        """Return the instance of `kind`; the first call creates it."""
        if kind not in self._instances:
            self._instances[kind] = kind()
        found: T = self._instances[kind]
        return found


@dataclass(frozen=True)
class Shot:
    """One frame to render: the scene, its copy on the GPU, and the camera.

    `frame`: number in a still picture, 0 to `frames` - 1; negative for the warm-up frames before. `drawn`: number of
    the frames before this picture whose random numbers it must not repeat. `moving`: number of the frame in a moving
    picture that is anti-aliased over time, else None. `preview`: the view moves, and a still picture will start over.
    `window`: the part of a larger picture that the picture is; None: it is whole.
    """

    graph: Graph
    upload: SceneUpload
    scene: Scene
    camera: Camera
    size: tuple[int, int]
    frame: int
    frames: int
    drawn: int
    moving: int | None
    kept: Kept
    preview: bool
    window: Window | None = None


@dataclass
class Light:
    """The light of a frame by layers: (r, g, b, -) per pixel in W/(m2 sr), rows from the top.

    emission: sources seen directly. direct: light scattered once. indirect: light scattered more often (None: none).
    radiance: their sum, and standard_error: of radiance, if the technique computes them. views: further buffers to
    show, by the names in `Technique.extra` and `Technique.views`. distance: of the surface at each pixel, metres, 0:
    none; all that have `motion` have it. tint: factor on all layers, still to be applied, of the glass that a pixel
    shows; None: 1.
    """

    emission: Buffer
    direct: Buffer
    indirect: Buffer | None = None
    radiance: Buffer | None = None
    standard_error: Buffer | None = None
    views: dict[str, Buffer] = field(default_factory=dict)
    distance: Texture | None = None
    tint: Buffer | None = None


class Reach(NamedTuple):
    """What a window of a picture must hold so that its pixels equal those of the whole picture.

    margin: pixels around a pixel that its light, filters and noise estimate depend on. step: windows begin at multiples
    of it, so that patterns of pixels are those of the whole picture.
    """

    margin: int
    step: int = 1


def _no_warm_up(settings: Any) -> int:
    return 0


@dataclass(frozen=True)
class Technique:
    """A technique for indirect light: its properties and its needs.

    sentence: what it does, for lists of techniques.
    bounces: number of bounces of indirect light that it finds; None: as many as requested, or all.
    most_bounces: largest number of bounces that may be requested; None: no limit.
    is_random: True if each frame of a still picture draws new samples, so that their mean converges.
    options: a Protocol with the settings that it reads; all others have no effect.
    inputs: updates its scene inputs on the GPU once per frame, and returns them.
    extra: buffers that it can show besides those of all techniques.
    views: debug views, each with the reason why a frame may lack it.
    screen_space: True if only surfaces in the picture can occlude or send light.
    occludes_sky: False if the environment lights every surface as if nothing were in the way.
    averages_samples: True if it averages samples itself; a still picture is then one frame.
    warm_up: returns the number of frames before the first one that a still picture averages.
    refine: plans more runs for a picture that lacks samples after all its runs; returns whether it did.
    refined: the buffers that these runs improve.
    reach: returns what a window of the picture must hold for equal pixels; None: pixels depend on the whole picture.
    stages: what its error may be due to, in the order in which `measure/attribute.py` exchanges them.
    found: returns the number of bounces of indirect light that its settings find, None for all; by default `bounces`.
    """

    sentence: str
    bounces: int | None
    is_random: bool
    options: type
    inputs: Callable[[Shot, Any], SceneInputs]
    most_bounces: int | None = None
    extra: tuple[str, ...] = ("motion",)
    views: Mapping[str, str] = field(default_factory=dict)
    screen_space: bool = False
    occludes_sky: bool = True
    averages_samples: bool = False
    warm_up: Callable[[Any], int] = _no_warm_up
    refine: Callable[[Graph, Kept, Any], bool] | None = None
    refined: frozenset[str] = frozenset()
    reach: Callable[[Any], Reach] | None = None
    stages: tuple[Stage, ...] = ()
    found: Callable[[Any], int | None] | None = None

    def bounces_found(self, settings: Any) -> int | None:
        """Return the number of bounces of indirect light in a picture, None for all."""
        found: int | None = self.found(settings) if self.found is not None else self.bounces
        counts = [count for count in (found, settings.bounces) if count is not None]
        return min(counts) if counts else None

    @property
    def sections(self) -> frozenset[str]:
        """The names of the fields of `Settings` that it reads."""
        return frozenset(get_type_hints(self.options))
