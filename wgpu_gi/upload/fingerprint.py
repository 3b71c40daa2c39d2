"""Change detection: tells whether a scene has changed since the last frame.

It runs in every frame, so it compares small values by value and large arrays by identity.
"""

from __future__ import annotations

from dataclasses import fields
from operator import attrgetter
from typing import Any

import numpy as np

from ..scene.mesh_check import arrays_of
from ..scene.scene import Environment, Instance, Light, Material, Scene, Texture, values_of

_material_values = attrgetter(*[f.name for f in fields(Material) if f.name != "name"])
_texture_values = attrgetter(*[f.name for f in fields(Texture) if f.name != "image"])
_IMMUTABLE = frozenset({bool, int, float, str, tuple, type(None)})


class Fingerprint:
    """Two fingerprints are equal if no part of the scene was replaced or changed between them.

    Arrays of meshes, and images, are compared by identity: they are immutable once in use.
    A fingerprint keeps the objects that it compares by identity alive, so that their ids are not reused.
    """

    def __init__(self, scene: Scene) -> None:
        meshes = scene.meshes
        materials = {id(m): m for mesh in meshes for m in mesh.materials}.values()
        self._arrays = [arrays_of(mesh) for mesh in meshes]  # kept alive
        # Lists of instances, meshes and materials compare by identity, as their classes define no equality.
        self._values: list[Any] = [
            list(scene.instances),
            [i.mesh for i in scene.instances],
            _transforms(scene.instances),
            _poses(scene.instances),
            [list(mesh.materials) for mesh in meshes],
            [id(array) for arrays in self._arrays for array in arrays],
            [_material(m) for m in materials],
            [_light(light) for light in scene.lights],
            None if scene.environment is None else _environment(scene.environment),
        ]
        self._image = None if scene.environment is None else scene.environment.image

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Fingerprint) and self._image is other._image and self._values == other._values

    __hash__ = None  # type: ignore[assignment]


def _transforms(instances: list[Instance]) -> bytes:
    """Return the bytes of all transforms."""
    try:
        return b"".join([i.world_from_local.data for i in instances])
    except (AttributeError, BufferError, TypeError):  # lists, or arrays that are not contiguous
        return b"".join([np.asarray(i.world_from_local).tobytes() for i in instances])


def _poses(instances: list[Instance]) -> list[Any]:
    """Return the joint matrices and morph weights of those that have any, in comparable form."""
    return [
        (k, None if i.joint_matrices is None else np.asarray(i.joint_matrices).tobytes(), _frozen(i.morph_weights))
        for k, i in enumerate(instances)
        if i.joint_matrices is not None or not isinstance(i.morph_weights, tuple) or i.morph_weights
    ]


def _material(material: Material) -> tuple[Any, ...]:
    """Return the values of a material in comparable form."""
    return _all_frozen(_material_values(material))


def _light(light: Light) -> tuple[Any, ...]:
    """Return the values of a light in comparable form."""
    return type(light), *[_frozen(value) for name, value in values_of(light).items() if name != "name"]


def _environment(environment: Environment) -> tuple[Any, ...]:
    """Return the values of an environment, except its image, in comparable form."""
    return _frozen(environment.color), environment.rotation


def _frozen(value: Any) -> Any:
    """Return a value that in-place changes cannot alter: lists, arrays and textures become tuples."""
    if isinstance(value, Texture):
        return value.image, _all_frozen(_texture_values(value))
    if isinstance(value, np.ndarray):
        return value.tolist()
    return _all_frozen(tuple(value)) if isinstance(value, list) else value


def _all_frozen(values: tuple[Any, ...]) -> tuple[Any, ...]:
    return tuple([value if type(value) in _IMMUTABLE else _frozen(value) for value in values])
