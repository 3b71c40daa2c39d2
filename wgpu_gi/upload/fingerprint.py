"""Tells cheaply whether a scene is as it was: what may change is compared by value, large arrays by identity."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..scene.scene import Material, Scene, Texture


class Fingerprint:
    """Equal to another one if no part of the scene was exchanged or changed in between.

    Meshes, but for their materials, and pictures count by identity: their arrays are immutable in use.
    """

    def __init__(self, scene: Scene) -> None:
        instances = scene.instances
        meshes = {id(i.mesh): i.mesh for i in instances}
        materials = {id(m): m for mesh in meshes.values() for m in mesh.materials}
        # Identities are unique among living objects only: what counts by identity is kept alive.
        self._alive: list[Any] = [*instances, *meshes.values(), *materials.values()]
        self._matrices = b"".join([np.asarray(i.world_from_local).tobytes() for i in instances])
        self._placed = [(id(i), id(i.mesh)) for i in instances]
        self._used = [[id(m) for m in mesh.materials] for mesh in meshes.values()]
        self._materials = [self._material(material) for material in materials.values()]
        self._lights = [
            (type(light), *[_value(value) for name, value in vars(light).items() if name != "name"])
            for light in scene.lights
        ]
        environment = scene.environment
        self._environment: tuple[Any, ...] = ()
        if environment is not None:
            self._alive.append(environment.image)
            self._environment = (*environment.color, id(environment.image), environment.rotation)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Fingerprint) and self._values() == other._values()

    __hash__ = None  # type: ignore[assignment]

    def _values(self) -> list[Any]:
        return [value for name, value in vars(self).items() if name != "_alive"]

    def _material(self, material: Material) -> list[Any]:
        values: list[Any] = [id(material)]
        for name, value in vars(material).items():
            if isinstance(value, Texture):
                self._alive.append(value.image)
                values += [id(part) if part is value.image else _copy(part) for part in vars(value).values()]
            elif name != "name":
                values.append(_copy(value))
        return values


def _copy(value: Any) -> Any:
    """Return lists and arrays, which may be changed in place, as tuples."""
    return tuple(value) if isinstance(value, list | np.ndarray) else value


def _value(value: Any) -> Any:
    """Return arrays and lists, which have no single truth or may be changed in place, as bytes."""
    return value if value is None or isinstance(value, str | float | int) else np.asarray(value).tobytes()
