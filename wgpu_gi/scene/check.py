"""Checks the values of scenes and cameras, since code may set any value; loaders check files earlier."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..errors import GiError
from .scene import Environment, Instance, Light, Material, Scene, SpotLight

# float64 cannot invert a transform whose determinant is below this, with its largest entry scaled to 1.
SINGULAR = 1e-15


def check_scene(scene: Scene) -> None:
    """Raise GiError for invalid values: singular transforms, negative light, reflectance above 1, NaN."""
    _check_instances(scene.instances)
    for light in scene.lights:
        _check_light(light)
    for material in scene.materials:
        _check_material(material)
    if scene.environment is not None:
        _check_environment(scene.environment)


def _check_instances(instances: list[Instance]) -> None:
    # Check all transforms at once, since this runs whenever one of many instances moves.
    matrices = [np.asarray(i.world_from_local, np.float64) for i in instances]
    for instance, matrix in zip(instances, matrices, strict=True):
        if matrix.shape != (4, 4):
            raise GiError(f"instance {instance.name!r}: world_from_local must be a (4, 4) matrix")
    stacked = np.array(matrices).reshape(-1, 4, 4)
    linear = stacked[:, :3, :3]
    scale = np.abs(linear).max((1, 2), initial=0.0)[:, None, None]
    with np.errstate(invalid="ignore"):
        volume = np.abs(np.linalg.det(linear / np.where(scale > 0, scale, 1)))
    finite: NDArray[np.bool_] = np.asarray(np.isfinite(stacked[:, :3]).all((1, 2)))
    valid = finite & (volume > SINGULAR)
    if not valid.all():
        first = int(np.argmin(valid))
        reason = "its transform is singular (flattens it); give it a scale above zero"
        raise GiError(
            f"instance {instances[first].name!r}: {reason if finite[first] else 'world_from_local must be finite'}"
        )


def _check_material(material: Material) -> None:
    where = f"material {material.name!r}"
    shares = [*material.base_color, material.metallic, material.roughness]
    if len(material.base_color) != 4 or not all(0 <= v <= 1 for v in shares):
        raise GiError(f"{where}: base_color (4 values), metallic and roughness must lie between 0 and 1")
    _check_color(where, "emission", material.emission)
    if not math.isfinite(material.alpha_cutoff) or not math.isfinite(material.normal_scale):
        raise GiError(f"{where}: alpha_cutoff and normal_scale must be finite")


def _check_environment(environment: Environment) -> None:
    where = f"environment {environment.name!r}"
    _check_color(where, "color", environment.color)
    if not np.isfinite(environment.rotation):
        raise GiError(f"{where}: rotation must be finite")
    if environment.image is not None and (np.ndim(environment.image) != 3 or environment.image.shape[2] != 3):
        raise GiError(f"{where}: image must be (height, width, 3)")


def check_camera(camera: Camera) -> None:
    """Raise GiError for a camera that sees nothing: not finite, no angle, no height."""
    matrix = np.asarray(camera.world_from_view, np.float64)
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
        raise GiError(f"camera {camera.name!r}: world_from_view must be a finite (4, 4) matrix")
    if camera.orthographic_height is None:
        if not 0 < camera.yfov < np.pi:
            raise GiError(f"camera {camera.name!r}: yfov must lie between 0 and pi radians, not {camera.yfov}")
    elif not 0 < camera.orthographic_height < np.inf:
        raise GiError(
            f"camera {camera.name!r}: orthographic_height must be above 0 m, not {camera.orthographic_height}"
        )


def _check_light(light: Light) -> None:
    where = f"light {light.name!r}"
    _check_color(where, "color", light.color)
    if not 0 <= light.intensity < np.inf:
        raise GiError(f"{where}: intensity must be finite and not negative")
    for name in ("position", "direction"):
        place = getattr(light, name, (0.0, 0.0, 0.0))
        if len(place) != 3 or not np.isfinite(np.asarray(place, np.float64)).all():
            raise GiError(f"{where}: {name} must be three finite numbers")
    if isinstance(light, SpotLight) and not 0 <= light.inner_cone_angle <= light.outer_cone_angle <= np.pi:
        raise GiError(f"{where}: its cone angles must satisfy 0 <= inner <= outer <= pi radians")


def _check_color(where: str, name: str, color: Sequence[float]) -> None:
    if len(color) != 3 or not all(0 <= v < np.inf for v in color):
        raise GiError(f"{where}: {name} must be three numbers, finite and not negative")
