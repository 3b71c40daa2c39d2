"""Renders moving pictures of a technique and measures flicker, lag and ghosts; `moving.py` defines them.

Three motions: the camera moves and turns, an instance moves, all light steps to four times its value and back.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..options import Settings, why_aliased
from ..pictures.color import REC709_LUMINANCE
from ..renderer import Renderer
from ..scene.scene import Instance, Scene
from .moving import Seen, flicker, lag, relative_errors, revealed, squared_errors
from .results import MovingErrors
from .truth import LAYERS

# The camera walks a circle in its image plane and turns to and fro: in a room of 10 m, up to 2 cm and 1.6 degrees a
# frame, which a person at a walk does at 60 frames per second.
WALK_RADIUS, WALK_FRAMES = 1 / 100, 32  # share of the diagonal of the scene's box; frames for one turn
SWING = np.radians(8.0)
# The instance swings by this share of the diagonal, which shows what was behind it.
OBJECT_SWING = 1 / 25
LARGEST_OBJECT = 0.5  # share of the scene's diagonal: a room, a wall or a ground does not move
WARM_UP = 12  # frames that fill the history first
SETTLED_FRAMES = 32  # of a converged picture
NEW_FOR = 4  # frames for which a point that came into view counts as disoccluded
STEP, STEP_FRAMES = 4.0, 32  # all light times a power of two, so that pictures scale exactly; frames to get there
GEOMETRY = ("position", "normal", "depth", "instance")


@dataclass(frozen=True)
class View:
    """What a frame shows."""

    scene: Scene
    camera: Camera


Pictures = Mapping[str, NDArray[np.float32]]


def measure_moving(
    scene: Scene,
    camera: Camera,
    size: tuple[int, int],
    settings: Settings,
    frames: int,
    report: Callable[[float], None],
    adapter: str | None = None,
) -> dict[str, MovingErrors | None]:
    """Return the metrics of the full picture and of indirect light, over `frames` frames of each motion.

    aliased, antialiased: of the full picture against box-filtered ones, without and with temporal anti-aliasing, if the
    settings have any. frames: 2 or more. A layer is None where surfaces are black; ghosts behind an object are None if
    nothing can move.
    """

    single = replace(settings, camera=replace(settings.camera, frames=1, jitter=False))
    settled = replace(
        settings,
        camera=replace(settings.camera, frames=SETTLED_FRAMES, jitter=False),
        temporal=replace(settings.temporal, frames=1),
        spp=SETTLED_FRAMES * settings.spp,  # of the path tracer, which averages samples instead of frames
    )
    jittered = replace(settings, camera=replace(settings.camera, frames=1, jitter=True))
    # Each with the settings of its truth: pixel centres, or box filtered.
    tasks = [({layer: layer for layer in ("full", "indirect")}, single, settled, False)]
    if why_aliased(jittered) is None:
        boxed = replace(settled, camera=replace(settled.camera, jitter=True))
        tasks += [({"full": "aliased"}, single, boxed, False), ({"full": "antialiased"}, jittered, boxed, True)]
    found: dict[str, MovingErrors | None] = {}
    for number, (names, own, truth, moving) in enumerate(tasks):

        def part(fraction: float, number: int = number) -> None:
            report((number + fraction) / len(tasks))

        errors = _measure(scene, camera, size, own, truth, frames, part, adapter, tuple(names), moving)
        found |= {names[layer]: e for layer, e in errors.items()}
    return found


def _measure(
    scene: Scene,
    camera: Camera,
    size: tuple[int, int],
    settings: Settings,
    settled: Settings,
    frames: int,
    report: Callable[[float], None],
    adapter: str | None,
    layers: tuple[str, ...],
    moving: bool,
) -> dict[str, MovingErrors | None]:
    """Return the metrics of some layers, against pictures with the settings `settled`."""

    def opened(settings: Settings) -> Renderer:
        return Renderer(scene, size=size, camera=camera, settings=settings, adapter=adapter)

    def part(first: float, last: float) -> Callable[[float], None]:
        return lambda fraction: report(first + (last - first) * fraction)

    with opened(settings) as renderer, opened(settled) as truth:
        number = _object_of(renderer, scene, camera)
        renderer.moving = moving
        walk = _Run(renderer, truth, partial(_walk, scene, camera), layers)
        walk.measure(frames, part(0.0, 0.45))
        swing = None
        if number is not None:
            swing = _Run(renderer, truth, _Swing(scene, camera, number), layers)
            swing.measure(frames, part(0.45, 0.9))
        lags = _lags(renderer, scene, camera, layers, part(0.9, 1.0))
    return {layer: _errors(layer, walk, swing, lags[layer]) for layer in layers}


def _errors(layer: str, walk: _Run, swing: _Run | None, frames_late: int | None) -> MovingErrors | None:
    if not walk.light[layer][1] > 0:
        return None
    x, t = walk.light[layer]
    ghosts = None if swing is None or not swing.ghosts[layer] else float(np.mean(swing.ghosts[layer]))
    return MovingErrors(
        flicker=walk.flicker(layer),
        lag=frames_late,
        ghost_camera=float(np.mean(walk.ghosts[layer])) if walk.ghosts[layer] else None,
        ghost_object=ghosts,
        relmse=float(np.mean([e.mean() for e in walk.squared[layer]])),
        bias=x / t - 1.0,
    )


class _Run:
    """The frames of one motion, each with the converged picture of its view."""

    def __init__(
        self,
        renderer: Renderer,
        truth: Renderer,
        view_at: Callable[[int], View],
        layers: tuple[str, ...],
    ) -> None:
        self.renderer, self.truth, self.view_at = renderer, truth, view_at
        self.seen: list[Seen] = []
        self.errors: dict[str, list[NDArray[np.float64]]] = {layer: [] for layer in layers}
        self.squared: dict[str, list[NDArray[np.float64]]] = {layer: [] for layer in layers}
        self.ghosts: dict[str, list[float]] = {layer: [] for layer in layers}  # errors of disoccluded pixels
        self.light = dict.fromkeys(layers, (0.0, 0.0))  # sums of pictures and of truths

    def measure(self, frames: int, report: Callable[[float], None]) -> None:
        """Render a warm-up and `frames` frames; keep their errors."""
        ages: NDArray[np.int64] | None = None
        show = tuple(LAYERS[layer] for layer in self.errors)
        self.renderer.forget()
        for number in range(-WARM_UP, frames):
            view = self.view_at(number)
            self.renderer.scene, self.renderer.camera = view.scene, view.camera
            self.renderer.step(show=(*show, *GEOMETRY), preview=True)
            if number < -NEW_FOR:
                continue
            pictures = {name: self.renderer.read_back(name) for name in (*show, *GEOMETRY)}
            seen = Seen(view.camera, pictures["position"], pictures["normal"], pictures["depth"] > 0)
            if self.seen:
                points = self._points_before(number, pictures)
                ages = revealed(seen, self.seen[-1], points, ages)
            self.seen.append(seen)
            if number >= 0:
                self._compare(view, pictures, seen.surface, ages)
            report((number + NEW_FOR + 1) / (frames + NEW_FOR))
        del self.seen[:NEW_FOR]

    def _points_before(self, number: int, pictures: Pictures) -> NDArray[np.float64]:
        """Return where the surface points of a frame were in the last frame, world, (h, w, 3)."""
        points = np.asarray(pictures["position"], np.float64)
        if not isinstance(self.view_at, _Swing):
            return points
        change = self.view_at.pose(number - 1) @ np.linalg.inv(self.view_at.pose(number))
        own = pictures["instance"][..., None] == self.view_at.moved + 1
        return np.where(own, points @ change[:3, :3].T + change[:3, 3], points)

    def _compare(self, view: View, pictures: Pictures, surface: NDArray[np.bool_], ages: object) -> None:
        self.truth.scene, self.truth.camera = view.scene, view.camera
        self.truth.run(show=tuple(LAYERS[layer] for layer in self.errors))
        new = np.asarray(ages) < NEW_FOR
        for layer, (x, t) in self.light.items():
            picture, truth = pictures[LAYERS[layer]], self.truth.read_back(LAYERS[layer])
            squared = squared_errors(picture, truth)
            self.errors[layer].append(relative_errors(picture, truth))
            self.squared[layer].append(squared[surface])
            self.ghosts[layer] += squared[new].tolist()
            self.light[layer] = x + float(picture[surface].sum()), t + float(truth[surface].sum())

    def flicker(self, layer: str) -> float | None:
        """Return the flicker of the surface points that the middle frame shows."""
        middle = self.seen[len(self.seen) // 2]
        points, normals = middle.position[middle.surface], middle.normal[middle.surface]
        seen, errors = [], []
        for frame, values in zip(self.seen, self.errors[layer], strict=True):
            shown, pixels = frame.shows(points, normals)
            seen.append(shown)
            errors.append(values[tuple(pixels.T)])
        return flicker(np.array(errors), np.array(seen))


def _walk(scene: Scene, camera: Camera, number: int) -> View:
    """Return the view of the camera that walks and turns."""
    angle = 2 * np.pi * number / WALK_FRAMES
    radius = WALK_RADIUS * _diagonal(scene)
    turn = SWING * np.sin(angle)
    pose = np.array(camera.world_from_view, np.float64)
    pose[:3, 3] += pose[:3, :2] @ (radius * np.array([np.cos(angle), np.sin(angle)]))
    yaw = np.array([[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]])
    pose[:3, :3] = pose[:3, :3] @ yaw
    return View(scene, replace(camera, world_from_view=pose))


class _Swing:
    """The views of an instance that swings along the camera's right, in place, so that frames know its motion."""

    def __init__(self, scene: Scene, camera: Camera, moved: int) -> None:
        self.moved, self.camera = moved, camera
        self._right = camera.world_from_view[:3, 0] * OBJECT_SWING * _diagonal(scene)
        self._at_rest = np.array(scene.instances[moved].world_from_local, np.float64)
        instances: list[Instance] = list(scene.instances)
        instances[moved] = self._instance = replace(scene.instances[moved])
        self._scene = replace(scene, instances=instances)

    def pose(self, number: int) -> NDArray[np.float64]:
        """Return the instance's transform in a frame, world_from_local."""
        shift = np.eye(4)
        shift[:3, 3] = self._right * np.sin(2 * np.pi * number / WALK_FRAMES)
        return shift @ self._at_rest

    def __call__(self, number: int) -> View:
        """Move the instance; return the view of a frame. All its views share one scene."""
        self._instance.world_from_local = self.pose(number)
        return View(self._scene, self.camera)


def _diagonal(scene: Scene) -> float:
    return float(np.linalg.norm(np.ptp(scene.bounds(), axis=0))) or 1.0


def _object_of(renderer: Renderer, scene: Scene, camera: Camera) -> int | None:
    """Return the place of the most visible instance that can move; None without one."""
    renderer.scene, renderer.camera = scene, camera
    renderer.step(show=("instance",))
    shown = renderer.read_back("instance").astype(np.int64)
    counts = np.bincount(shown.ravel(), minlength=len(scene.instances) + 1)[1:]
    for number in np.flatnonzero(counts):
        if _diagonal(replace(scene, instances=[scene.instances[number]])) > LARGEST_OBJECT * _diagonal(scene):
            counts[number] = 0
    return int(counts.argmax()) if counts.any() else None


def _lags(
    renderer: Renderer, scene: Scene, camera: Camera, layers: tuple[str, ...], report: Callable[[float], None]
) -> dict[str, int | None]:
    """Return for each layer the frames until a step of all light is 90 % there, up or down, whichever takes longer."""
    bright = brightened(scene, STEP)
    # The same random numbers with constant light: the ratio of both has no noise.
    constant = _means(renderer, camera, layers, [scene] * (WARM_UP + STEP_FRAMES))
    report(1 / 3)
    up = _means(renderer, camera, layers, [scene] * WARM_UP + [bright] * STEP_FRAMES)
    report(2 / 3)
    down = _means(renderer, camera, layers, [bright] * WARM_UP + [scene] * STEP_FRAMES)
    report(1.0)
    lags: dict[str, int | None] = {}
    for layer, values in constant.items():
        after, rise, fall = (np.array(run[layer][WARM_UP:]) for run in (constant, up, down))
        lit = all(value > 0 for value in values)
        lags[layer] = None
        if lit:
            lags[layer] = max(lag((rise / after - 1) / (STEP - 1)), lag((STEP - fall / after) / (STEP - 1)))
    return lags


def _means(renderer: Renderer, camera: Camera, layers: tuple[str, ...], scenes: list[Scene]) -> dict[str, list[float]]:
    """Return the mean luminance of each layer in frames that show `scenes` one after the other."""
    means: dict[str, list[float]] = {layer: [] for layer in layers}
    renderer.forget()
    renderer.camera = camera
    for scene in scenes:
        renderer.scene = scene
        renderer.step(show=tuple(LAYERS[layer] for layer in means), force=True, preview=True)
        for layer, values in means.items():
            values.append(float((renderer.read_back(LAYERS[layer]) @ REC709_LUMINANCE).mean()))
    return means


def brightened(scene: Scene, factor: float) -> Scene:
    """Return the scene with all its light times `factor`."""

    def scaled(color: tuple[float, float, float]) -> tuple[float, float, float]:
        return (factor * color[0], factor * color[1], factor * color[2])

    materials = {id(m): replace(m, emission=scaled(m.emission)) for m in scene.materials}
    meshes = {id(m): replace(m, materials=[materials[id(own)] for own in m.materials]) for m in scene.meshes}
    environment = scene.environment
    if environment is not None:
        environment = replace(environment, color=scaled(environment.color))
    return replace(
        scene,
        instances=[replace(i, mesh=meshes[id(i.mesh)]) for i in scene.instances],
        lights=[replace(light, intensity=factor * light.intensity) for light in scene.lights],
        environment=environment,
    )
