"""What a scene may hold: loaders keep to it, scenes that are made or changed in code may not."""

from __future__ import annotations

import numpy as np

from ..errors import GiError
from .scene import Scene

FLAT = 1e-15  # determinant of a transform, its largest entry scaled to 1, below which float64 cannot invert it


def check_scene(scene: Scene) -> None:
    """Raise GiError for values that mean nothing: transforms that flatten or are not finite, negative light."""
    matrices = [np.asarray(i.world_from_local, np.float64) for i in scene.instances]
    for instance, matrix in zip(scene.instances, matrices, strict=True):
        if matrix.shape != (4, 4):
            raise GiError(f"instance {instance.name!r}: world_from_local must be a (4, 4) matrix")
    stacked = np.array(matrices).reshape(-1, 4, 4)
    linear = stacked[:, :3, :3]
    scale = np.abs(linear).max((1, 2), initial=0.0)[:, None, None]
    with np.errstate(invalid="ignore"):
        volume = np.abs(np.linalg.det(linear / np.where(scale > 0, scale, 1)))
    flat = np.asarray(~(volume > FLAT)).tolist()
    finite = np.asarray(np.isfinite(stacked[:, :3]).all((1, 2))).tolist()
    for instance, is_finite, is_flat in zip(scene.instances, finite, flat, strict=True):
        if not is_finite:
            raise GiError(f"instance {instance.name!r}: world_from_local must be finite")
        if is_flat:
            raise GiError(
                f"instance {instance.name!r}: its transform flattens it to nothing; give it a scale above zero"
            )
    for light in scene.lights:
        values = np.asarray([*light.color, light.intensity], np.float64)
        if not np.isfinite(values).all() or (values < 0).any():
            raise GiError(f"light {light.name!r}: color and intensity must be finite and not negative")
    for material in scene.materials:
        values = np.asarray([*material.base_color, *material.emission, material.metallic, material.roughness])
        if not np.isfinite(values).all() or (values < 0).any():
            raise GiError(f"material {material.name!r}: its values must be finite and not negative")
