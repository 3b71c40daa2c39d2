"""Errors of a technique while an animation plays, against path-traced pictures of the same poses.

Unlike `moving_bench`, the truth is that of the scene, so a technique's own bias counts.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..options import Settings
from ..renderer import Renderer
from ..scene.deformation import is_deformed
from ..scene.player import Player
from ..scene.scene import Instance, Scene
from .metrics import bias, relmse
from .moving import Seen, revealed, squared_errors
from .results import PlayedErrors
from .truth import LAYERS, Truth

MOMENTS = (0.25, 0.45, 0.75)  # of the animation: pictures of these times are compared
HISTORIES = (1, 8, 24)  # values of temporal.frames; 1: no history
RATE = 30.0  # frames per second
NEW_FOR = 8  # frames, a quarter of a second, for which a point that came into view counts as disoccluded
COMPARED = ("full", "indirect")
GEOMETRY = ("position", "normal", "depth", "instance")

TruthAt = Callable[[float], Truth]


def measure_played(
    scene: Scene,
    camera: Camera,
    size: tuple[int, int],
    settings: Settings,
    truth_at: TruthAt,
    report: Callable[[float], None],
    adapter: str | None = None,
) -> list[PlayedErrors]:
    """Return the errors at MOMENTS of the scene's first animation, for each number of frames of HISTORIES.

    truth_at: takes seconds, returns the truth of the scene at that time. Frames play until the history is full.
    """
    player = Player(scene, None)
    played = _Played(player, camera)
    moments = [share * player.animation.duration for share in MOMENTS]
    single = replace(settings, camera=replace(settings.camera, frames=1, jitter=False))
    found: dict[int, list[dict[str, float | None]]] = {history: [] for history in HISTORIES}
    counts = {history: max(history, NEW_FOR + 1) for history in HISTORIES}
    total, done = len(moments) * sum(counts.values()), 0
    with Renderer(player.scene, size=size, camera=camera, settings=single, adapter=adapter) as renderer:
        for moment in moments:
            truth = truth_at(moment)
            for history, frames in counts.items():
                renderer.settings = replace(single, temporal=replace(settings.temporal, frames=history))
                found[history].append(played.errors(renderer, moment, frames, truth))
                done += frames
                report(done / total)
    return [PlayedErrors(history, **_mean(errors)) for history, errors in found.items()]


def _mean(errors: list[dict[str, float | None]]) -> dict[str, float | None]:
    """Return the means over moments of the values that could be measured."""
    known = {name: [value for e in errors if (value := e[name]) is not None] for name in errors[0]}
    return {name: float(np.mean(values)) if values else None for name, values in known.items()}


class _Played:
    """Plays up to a moment, and compares the last frame."""

    def __init__(self, player: Player, camera: Camera) -> None:
        self.player, self.camera = player, camera

    def errors(self, renderer: Renderer, moment: float, frames: int, truth: Truth) -> dict[str, float | None]:
        """Render `frames` frames up to a moment; return relMSE, bias and ghosts of the last."""
        show = tuple(LAYERS[layer] for layer in COMPARED)
        seen: Seen | None = None
        ages: NDArray[np.int64] | None = None
        poses: list[NDArray[np.float64]] = []
        renderer.forget()
        for number in range(frames):
            self.player.pose(max(moment - (frames - 1 - number) / RATE, 0.0))
            renderer.step(show=(*show, *GEOMETRY), preview=True)
            if number < frames - NEW_FOR - 1:
                continue
            shown = {name: renderer.read_back(name) for name in GEOMETRY}
            now = Seen(self.camera, shown["position"], shown["normal"], shown["depth"] > 0)
            earlier, poses = poses, [np.array(i.world_from_local) for i in self.player.scene.instances]
            if seen is not None:
                ages = revealed(now, seen, self._points_before(now, shown["instance"], earlier), ages)
            seen = now
        new = None if ages is None else (ages < NEW_FOR) & truth.surface
        values: dict[str, float | None] = {}
        for layer in COMPARED:
            picture, true = renderer.read_back(LAYERS[layer]), truth.layers[layer]
            lit = bool(truth.surface.any()) and float(true[truth.surface].mean()) > 0
            values[f"relmse_{layer}"] = relmse(picture, true, truth.noise.get(layer), truth.surface) if lit else None
            values[f"bias_{layer}"] = bias(picture, true, truth.surface) if lit else None
            ghost = None if new is None or not (lit and new.any()) else squared_errors(picture, true)[new]
            values[f"ghost_{layer}"] = None if ghost is None else float(ghost.mean())
        return values

    def _points_before(
        self, now: Seen, shown: NDArray[np.float32], earlier: list[NDArray[np.float64]]
    ) -> NDArray[np.float64]:
        """Return where the surface points were in the last frame, world, (h, w, 3).

        Points of what deforms are taken for old: they count as ghosts in no frame.
        """
        points = now.position.copy()
        numbers = shown.astype(np.int64) - 1
        instances: list[Instance] = self.player.scene.instances
        for number in np.unique(numbers[now.surface]):
            own = numbers == number
            if is_deformed(instances[number]):
                continue
            change = earlier[number] @ np.linalg.inv(instances[number].world_from_local)
            points[own] = points[own] @ change[:3, :3].T + change[:3, 3]
        return points
