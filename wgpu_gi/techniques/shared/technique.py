"""What a technique is to the rest: its promise, the scene that it asks for, and the light that it returns.

Each folder of `techniques/` offers, in its `__init__`, a `Technique` with the settings that it reads and what it needs
of the scene, and `declare_...(graph, settings, scene)`, which declares its passes and returns a `Light`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar, get_type_hints

from ...camera import Camera
from ...gpu.graph import Graph
from ...gpu.handles import Buffer
from ...scene.scene import Scene
from ...upload.scene_upload import SceneUpload
from .scene_inputs import SceneInputs

T = TypeVar("T")


class Kept:
    """What a renderer keeps for its techniques from frame to frame: one instance of each class that they ask for."""

    def __init__(self) -> None:
        self._instances: dict[type, Any] = {}

    def __call__(self, kind: type[T]) -> T:
        """Return the instance of `kind`, made at the first call."""
        if kind not in self._instances:
            self._instances[kind] = kind()
        found: T = self._instances[kind]
        return found


@dataclass(frozen=True)
class Shot:
    """One frame to render: the scene, its copy on the GPU, and the camera.

    `frame` counts the frames of a still picture from 0 to `frames` - 1; those of the warm-up before them are negative.
    """

    graph: Graph
    upload: SceneUpload
    scene: Scene
    camera: Camera
    size: tuple[int, int]
    frame: int
    frames: int
    kept: Kept


@dataclass
class Light:
    """The light of a frame by layers: (r, g, b, -) per pixel in W/(m2 sr), rows from the top.

    emission: sources seen directly. direct: light scattered once, indirect: more often (None: there is none). radiance:
    their sum, if the technique adds them itself. views: what else can be shown, by the names in
    `Technique.extra` and `Technique.views`.
    """

    emission: Buffer
    direct: Buffer
    indirect: Buffer | None = None
    radiance: Buffer | None = None
    views: dict[str, Buffer] = field(default_factory=dict)


def _no_warm_up(settings: Any) -> int:
    return 0


@dataclass(frozen=True)
class Technique:
    """A technique for indirect light: what it promises, and what it needs.

    sentence: what it does, for lists of techniques.
    bounces: how many bounces of indirect light it finds; None: as many as are asked for, or all.
    most_bounces: how many may be asked for, if there is a limit.
    is_random: True if each frame of a still picture draws other samples, so that their mean converges.
    options: a Protocol with the settings that it reads; all others have no effect.
    inputs: brings what it needs of the scene on the GPU up to date, once per frame, and returns it.
    extra: buffers that it can show besides those that all techniques have.
    views: debug views, and for each the reason why a frame may lack it.
    averages_samples: True if it averages samples itself; then a still picture is one frame.
    warm_up: how many frames come before the first one that a still picture averages.
    refine: plans more runs for a picture that lacks samples after all its runs; returns True if it did.
    refined: the buffers that such runs improve.
    """

    sentence: str
    bounces: int | None
    is_random: bool
    options: type
    inputs: Callable[[Shot, Any], SceneInputs]
    most_bounces: int | None = None
    extra: tuple[str, ...] = ("motion",)
    views: Mapping[str, str] = field(default_factory=dict)
    averages_samples: bool = False
    warm_up: Callable[[Any], int] = _no_warm_up
    refine: Callable[[Graph, Kept, Any], bool] | None = None
    refined: frozenset[str] = frozenset()

    @property
    def sections(self) -> frozenset[str]:
        """The names of the fields of `Settings` that it reads."""
        return frozenset(get_type_hints(self.options))
