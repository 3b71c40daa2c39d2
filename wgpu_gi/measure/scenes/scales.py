"""Generated scenes of extreme size or position: a room or a street, scaled and moved with its lights and camera.

Scaling by s multiplies intensities by s^2, so the picture stays that of the scene at its own size.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...camera import Camera
from ...scene.scene import DirectionalLight, Instance, Light, Scene, values_of
from .draws import Draws
from .outdoors import street
from .rooms import furnished_room

BASES: tuple[Callable[[Draws], Scene], ...] = (furnished_room, furnished_room, street)
SMALLEST, LARGEST, FARTHEST = 1e-6, 1e6, 1e7


def tiny(draws: Draws) -> Scene:
    """Return a room or street at 1e-6 to 0.1 of its size; half of them in the vertices, half in the matrices."""
    return _scaled(draws, draws.log_uniform(SMALLEST, 0.1))


def huge(draws: Draws) -> Scene:
    """Return a room or street at 10 to 1e6 times its size; half of them in the vertices, half in the matrices."""
    return _scaled(draws, draws.log_uniform(10.0, LARGEST))


def far(draws: Draws) -> Scene:
    """Return a room or street 1e3 to 1e7 m from the origin in a random direction, scaled by 0.1 to 10."""
    scene = draws.choice(BASES)(draws)
    distance = draws.log_uniform(1e3, FARTHEST)
    direction = draws.choice((np.eye(3)[draws.integer(0, 2)], draws.rotation()[:, 0]))
    offset = (distance * direction).astype(np.float32).astype(np.float64)
    return transformed(scene, draws.log_uniform(0.1, 10.0) if draws.chance(0.5) else 1.0, offset)


def _scaled(draws: Draws, scale: float) -> Scene:
    scene = draws.choice(BASES)(draws)
    if draws.chance(0.5):
        _scale_vertices(scene, scale)
    else:
        scene = transformed(scene, scale)
    return scene


def _scale_vertices(scene: Scene, scale: float) -> None:
    """Scale the scene in place: the vertices of its meshes, and the translations of its instances."""
    for mesh in scene.meshes:
        mesh.positions = mesh.positions * np.float32(scale)
    whole = transformed(scene, scale)
    for instance, scaled in zip(scene.instances, whole.instances, strict=True):
        instance.world_from_local[:3, 3] = scaled.world_from_local[:3, 3]
    scene.lights, scene.cameras = whole.lights, whole.cameras


def transformed(scene: Scene, scale: float, offset: object = (0.0, 0.0, 0.0)) -> Scene:
    """Return the scene scaled about the origin, then moved by `offset` (metres); point lights shine scale^2 as much."""
    shift = np.asarray(offset, np.float64)
    instances = []
    for instance in scene.instances:
        matrix = instance.world_from_local.copy()
        matrix[:3] *= scale
        matrix[:3, 3] += shift
        instances.append(Instance(instance.mesh, matrix, instance.name))
    lights = [_transformed_light(light, scale, shift) for light in scene.lights]
    cameras = []
    for camera in scene.cameras:
        pose = camera.world_from_view.copy()
        pose[:3, 3] = pose[:3, 3] * scale + shift
        height = None if camera.orthographic_height is None else camera.orthographic_height * scale
        cameras.append(Camera(pose, camera.yfov, height, camera.name))
    return Scene(instances, lights, scene.environment, cameras, scene.name)


def _transformed_light(light: Light, scale: float, shift: np.ndarray) -> Light:
    fields = values_of(light)
    if not isinstance(light, DirectionalLight):
        x, y, z = (np.asarray(light.position, np.float64) * scale + shift).tolist()
        reach = None if light.range is None else light.range * scale
        fields |= {"position": (x, y, z), "intensity": light.intensity * scale * scale, "range": reach}
    return type(light)(**fields)
