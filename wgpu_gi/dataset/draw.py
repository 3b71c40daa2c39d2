"""Draws what a frame of a data set shows: scene, placed objects, light, camera, and what moves until the second time.

The seed of the configuration and the number of the frame determine all of it: each part has a generator of its own
(PCG64, seeded by seed, frame and part), so that frames may be drawn in any order, and a change of one part of a
configuration leaves the others as they were. Errs by a cube of `surroundings` where objects are put: they may float, or
sink, by a hundredth of the scene.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..errors import GiError
from ..scene.files.environment_files import load_environment
from ..scene.load import read_scene
from ..scene.scene import DirectionalLight, Environment, Instance, Light, PointLight, Scene, SpotLight
from .cameras import draw_camera
from .config import Config, LightRanges, Motion, Placed, SkyRanges
from .surroundings import Surroundings

Array = NDArray[np.float64]
SCENE, OBJECTS, LIGHTS, SKY, CAMERA, MOTION, NOISE, TIME = range(8)  # the parts that have generators
PLACES = 200  # tried for an object before it is left out


@dataclass
class Drawn:
    """What a frame shows. `category_of` has an id for each instance, `record` all values that were drawn."""

    scene: Scene
    camera: Camera
    second: tuple[Scene, Camera] | None
    category_of: list[int]
    seed: int  # of the technique's random numbers
    record: dict[str, Any]


class Drawer:
    """Draws the frames of a configuration; keeps the files that it has loaded."""

    def __init__(self, config: Config) -> None:
        self._config = config
        self._surroundings = lru_cache(8)(lambda i: Surroundings.of(self._load(i)))
        self._sky = lru_cache(8)(lambda file: load_environment(config.path(file)))
        self._object = lru_cache(64)(lambda file: read_scene(config.path(file)))

    def _load(self, number: int) -> Scene:
        chosen = self._config.scenes[number]
        scene = read_scene(self._config.path(chosen.file))
        if chosen.environment is not None:
            scene.environment = load_environment(self._config.path(chosen.environment))
        return scene

    def draw(self, frame: int) -> Drawn:
        """Draw a frame. Raises GiError if a file cannot be loaded, and if no camera is found."""
        config = self._config

        def random(part: int) -> np.random.Generator:
            return np.random.default_rng([config.seed, frame, part])

        # Scene and objects.
        number = int(random(SCENE).integers(len(config.scenes)))
        surroundings = self._surroundings(number)
        chosen, seconds = config.scenes[number], None
        if chosen.time is None:
            scene = copy(surroundings.scene)
        else:
            seconds = float(random(TIME).uniform(*chosen.time))
            scene = surroundings.scene.at(seconds)
        things, boxes = self._place(surroundings, random(OBJECTS))
        scene.instances = [*scene.instances, *(instance for thing in things for instance in thing.instances)]
        # Light.
        scene.lights, lights = _varied_lights(scene.lights, config.lights, random(LIGHTS))
        scene.environment, sky = self._varied_sky(scene.environment, config.sky, random(SKY))
        # Camera, and the second time.
        around = Surroundings(surroundings.scene, surroundings.sight, boxes)
        share = frame / max(config.frames - 1, 1)
        aspect = config.size[0] / config.size[1]
        cameras = chosen.cameras or config.cameras
        assert cameras is not None
        try:
            camera, view = draw_camera(cameras, around, random(CAMERA), aspect, share)
        except GiError as error:
            raise GiError(f"frame {frame}: {error}") from None
        second, motion = None, None
        if config.motion is not None:
            second, motion = _second(
                scene, camera, len(surroundings.scene.instances), things, config.motion, random(MOTION)
            )
        seed = int(random(NOISE).integers(2**32))
        record = {
            "seed": [config.seed, frame],
            "noise_seed": seed,
            "scene": chosen.file,
            "time": seconds,
            "objects": [thing.record for thing in things],
            "lights": lights,
            "sky": sky,
            "camera": view,
            "motion": motion,
        }
        return Drawn(scene, camera, second, self._categories(scene), seed, record)

    def _categories(self, scene: Scene) -> list[int]:
        """Return the id of the first category with a pattern that matches the name of each instance; 0: none."""
        kinds = [*enumerate(self._config.categories.values(), 1)]
        return [
            next((key for key, patterns in kinds if any(fnmatchcase(i.name, p) for p in patterns)), 0)
            for i in scene.instances
        ]

    def _place(self, surroundings: Surroundings, random: np.random.Generator) -> tuple[list[Thing], Array]:
        """Return the objects that were put, and their boxes (n, 2, 3)."""
        things: list[Thing] = []
        boxes: list[Array] = []
        for placed in self._config.objects:
            for _ in range(int(random.integers(placed.count[0], placed.count[1] + 1))):
                file = placed.files[int(random.integers(len(placed.files)))]
                found = _put(self._object(file), file, placed, surroundings, boxes, random)
                if found is not None:
                    things.append(found[0])
                    boxes.append(found[1])
        return things, np.array(boxes).reshape(-1, 2, 3)

    def _varied_sky(
        self, sky: Environment | None, ranges: SkyRanges, random: np.random.Generator
    ) -> tuple[Environment | None, dict[str, Any] | None]:
        """Return the environment of a frame, and what was drawn."""
        file = ranges.files[int(random.integers(len(ranges.files)))] if ranges.files else None
        sky = sky if file is None else self._sky(file)
        if sky is None:
            return None, None
        factor, turn = _factor(ranges.intensity, random), float(random.uniform(*ranges.rotation_deg))
        varied = copy(sky)
        varied.color = tuple(factor * channel for channel in sky.color)  # type: ignore[assignment]
        varied.rotation = sky.rotation + math.radians(turn)
        return varied, {"file": file, "intensity": factor, "rotation_deg": turn}


@dataclass
class Thing:
    """A placed object: its instances, and what was drawn."""

    instances: list[Instance]
    record: dict[str, Any]


def _put(
    model: Scene,
    file: str,
    placed: Placed,
    surroundings: Surroundings,
    boxes: list[Array],
    random: np.random.Generator,
) -> tuple[Thing, Array] | None:
    """Put an object on a floor, apart from the scene and from `boxes`; return it and its box, None without a place."""
    low, high = surroundings.sight.bounds
    bounds = model.bounds()
    scale = float(random.uniform(*placed.size)) / max(float((bounds[1] - bounds[0]).max()), 1e-30)
    turn = float(random.uniform(*placed.turn_deg))
    # Turn and scale it about the middle of its underside.
    matrix = _about_y(turn) @ np.diag([scale, scale, scale, 1.0])
    foot = np.array([*((bounds[0] + bounds[1]) / 2)[:1], bounds[0, 1], ((bounds[0] + bounds[1]) / 2)[2]])
    matrix[:3, 3] = -matrix[:3, :3] @ foot
    moved = copy(model)
    moved.instances = [*_moved(model.instances, matrix, Path(file).stem)]
    local = moved.bounds()
    for _ in range(PLACES):
        x, _, z = random.uniform(low, high)
        spaces = surroundings.spaces(float(x), float(z))
        if not spaces:
            continue
        at = np.array([x, spaces[int(random.integers(len(spaces)))][0], z])
        box = local + at
        apart = all((box[0] >= other[1]).any() or (box[1] <= other[0]).any() for other in boxes)
        if apart and _is_empty(surroundings, box):
            shift = np.eye(4)
            shift[:3, 3] = at
            known = {"file": file, "position": at.tolist(), "scale": scale, "turn_deg": turn}
            return Thing([*_moved(moved.instances, shift)], known), box
    return None


def _is_empty(surroundings: Surroundings, box: Array) -> bool:
    """Tell whether no cube above the floor holds surfaces within a box, and whether it is within the scene."""
    sight = surroundings.sight
    first = np.floor((box[0] - sight.low) / sight.side).astype(int)
    first[1] += 2
    last = np.floor((box[1] - sight.low) / sight.side).astype(int) + 1
    last[1] = max(last[1], first[1] + 1)
    inside = (box[0, [0, 2]] >= sight.bounds[0, [0, 2]]).all() and (box[1, [0, 2]] <= sight.bounds[1, [0, 2]]).all()
    return bool(inside) and not sight.filled[tuple(slice(a, b) for a, b in zip(first, last, strict=True))].any()


def _moved(instances: list[Instance], matrix: Array, prefix: str = "") -> Iterator[Instance]:
    """Yield copies of instances moved by a matrix, with names such as duck/beak."""
    for instance in instances:
        each = copy(instance)
        each.world_from_local = matrix @ np.asarray(instance.world_from_local, np.float64)
        each.name = f"{prefix}/{instance.name}" if prefix else instance.name
        yield each


def _varied_lights(
    lights: list[Light], ranges: LightRanges, random: np.random.Generator
) -> tuple[list[Light], list[dict[str, Any]]]:
    """Return the lights of a frame, and what was drawn for each."""
    varied, drawn = [], []
    for light in lights:
        each = copy(light)
        factor, color = _factor(ranges.intensity, random), 1 + ranges.color * random.uniform(-1, 1, 3)
        angles, shift = ranges.turn_deg * random.uniform(-1, 1, 3), ranges.shift * random.uniform(-1, 1, 3)
        each.intensity = light.intensity * factor
        each.color = tuple(np.maximum(np.array(light.color) * color, 0.0).tolist())
        if isinstance(each, DirectionalLight | SpotLight):
            each.direction = (_rotation(angles) @ np.asarray(each.direction, np.float64)).tolist()
        if isinstance(each, PointLight | SpotLight):
            each.position = (np.asarray(each.position, np.float64) + shift).tolist()
        varied.append(each)
        drawn.append({"name": light.name, "intensity": factor, "color": color, "turn_deg": angles, "shift": shift})
    return varied, drawn


def _second(
    scene: Scene, camera: Camera, fixed: int, things: list[Thing], motion: Motion, random: np.random.Generator
) -> tuple[tuple[Scene, Camera], dict[str, Any]]:
    """Return scene and camera at the second time, and what was drawn; instances from `fixed` on are those of things."""
    shift, turn = motion.camera_shift * random.uniform(-1, 1, 3), motion.camera_turn_deg * random.uniform(-1, 1, 3)
    moved = copy(camera)
    moved.world_from_view = camera.world_from_view.copy()
    moved.world_from_view[:3, :3] = _rotation(turn) @ camera.world_from_view[:3, :3]
    moved.world_from_view[:3, 3] += shift
    later, drawn = copy(scene), []
    later.instances = [copy(instance) for instance in scene.instances[:fixed]]
    for thing in things:
        way = motion.object_shift * random.uniform(-1, 1, 3) * [1, 0, 1]
        angle = motion.object_turn_deg * float(random.uniform(-1, 1))
        # About the place where it stands.
        place = np.array(thing.record["position"])
        matrix = _about_y(angle)
        matrix[:3, 3] = place + way - matrix[:3, :3] @ place
        later.instances += _moved(thing.instances, matrix)
        drawn.append({"shift": way, "turn_deg": angle})
    return (later, moved), {"camera_shift": shift, "camera_turn_deg": turn, "objects": drawn}


def _factor(ranges: tuple[float, float], random: np.random.Generator) -> float:
    """Draw a factor, uniformly in its logarithm."""
    return float(math.exp(random.uniform(*np.log(ranges))))


def _about_y(degrees: float) -> Array:
    """Return the rotation (4, 4) about +Y."""
    matrix = np.eye(4)
    matrix[:3, :3] = _rotation((0.0, degrees, 0.0))
    return matrix


def _rotation(degrees: tuple[float, float, float] | Array) -> Array:
    """Return the rotation (3, 3) by angles about X, then Y, then Z."""
    product = np.eye(3)
    for axis, angle in enumerate(np.radians(degrees)):
        c, s = math.cos(angle), math.sin(angle)
        turn = np.eye(3)
        i, j = (axis + 1) % 3, (axis + 2) % 3
        turn[i, i] = turn[j, j] = c
        turn[i, j], turn[j, i] = -s, s
        product = turn @ product
    return product
