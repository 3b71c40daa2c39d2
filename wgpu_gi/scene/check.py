"""Checks every value of scenes and cameras, since code may set any value; loaders check files earlier.

A message names the value as Python does: `scene.lights[2].intensity must be a number from 0 to 1e+20, not -1`.
"""

from __future__ import annotations

import math
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..errors import GiError
from ..float_limits import LARGEST_HEIGHT, LARGEST_LIGHT, LARGEST_YFOV, MAX_COORDINATE, SMALLEST_HEIGHT, SMALLEST_YFOV
from ..webgpu_limits import MAX_TEXTURE_SIDE
from .animation import Animation
from .animation_check import animation_fault
from .material_check import material_fault, named
from .mesh_check import materials_fault, mesh_fault, pose_fault, posed_reach, reach_of
from .rules import Rule, array, fault_of, instance_of, items, number, optional, shown, text, vector
from .scene import DirectionalLight, Environment, Instance, Light, Mesh, PointLight, Scene, SpotLight

# float64 cannot invert a transform whose determinant is below this, with its largest entry scaled to 1.
SINGULAR = 1e-15
_LAST_ROW = (0.0, 0.0, 0.0, 1.0)  # of an affine transform
_NO_WEIGHTS = ()
_NOT_RIGID = 1e-3  # of a camera's axes from unit length and right angles: above the rounding of float32 products

_SCENE = {
    "instances": items(Instance),
    "lights": items(PointLight, SpotLight, DirectionalLight),
    "environment": optional(instance_of(Environment)),
    "cameras": items(Camera),
    "name": text,
    "notes": items(str),
    "animations": items(Animation),
}
_COLOR = vector(3, 0, LARGEST_LIGHT)
_LIGHT = {"intensity": number(0, LARGEST_LIGHT), "color": _COLOR, "name": text}
_POSITION = vector(3, -MAX_COORDINATE, MAX_COORDINATE)
_RANGE = Rule(lambda v: v is None or v == math.inf or number(0, MAX_COORDINATE).allows(v), "None or a number of metres")
_DIRECTION = Rule(lambda v: vector(3).allows(v) and any(v), "3 finite numbers, not all of them zero")
_ANGLE = number(0, math.pi, "radians")
_POINT = {"position": _POSITION, "range": _RANGE, **_LIGHT}
_SPOT = {**_POINT, "direction": _DIRECTION, "inner_cone_angle": _ANGLE, "outer_cone_angle": _ANGLE}
_SUN = {"direction": _DIRECTION, **_LIGHT}
_ENVIRONMENT = {
    "color": _COLOR,
    "image": optional(array("numbers", None, None, 3)),
    "rotation": number(unit="radians"),
    "name": text,
}
_CAMERA = {
    "yfov": number(SMALLEST_YFOV, LARGEST_YFOV, "radians"),
    "orthographic_height": optional(number(SMALLEST_HEIGHT, LARGEST_HEIGHT, "m")),
    "name": text,
}

_BRIGHTEST: WeakKeyDictionary[Environment, tuple[Any, float]] = WeakKeyDictionary()  # image, and its largest value


def check_structure(scene: Scene) -> None:
    """Raise GiError unless the scene consists of the right objects; their values are not checked. Takes little time."""
    if not isinstance(scene, Scene):
        raise GiError(f"the scene must be a Scene, not {shown(scene)}; gi.load makes one")
    _raise("scene", scene, fault_of(scene, _SCENE))
    for name, kind in (("mesh", Mesh), ("name", str)):
        kinds = [type(getattr(instance, name)) for instance in scene.instances]
        if not all(issubclass(found, kind) for found in set(kinds)):
            k = next(k for k, found in enumerate(kinds) if not issubclass(found, kind))
            wrong = shown(getattr(scene.instances[k], name))
            raise GiError(f"scene.instances[{k}].{name} must be a {kind.__name__}, not {wrong}")
    for where, mesh in _meshes(scene):
        _raise(where, mesh, materials_fault(mesh))


def check_scene(scene: Scene) -> None:
    """Raise GiError for the first value that cannot be rendered: a wrong type, NaN, negative light, out of range."""
    check_structure(scene)
    known: set[int] = set()
    for where, mesh in _meshes(scene):
        _raise(where, mesh, mesh_fault(mesh))
        for k, material in enumerate(mesh.materials):
            if id(material) not in known:
                known.add(id(material))
                _raise(f"{where}.materials[{k}]", material, material_fault(material))
    _check_instances(scene.instances)
    for k, light in enumerate(scene.lights):
        _raise(f"scene.lights[{k}]", light, _light_fault(light))
    if scene.environment is not None:
        _raise("scene.environment", scene.environment, _environment_fault(scene.environment))
    for k, animation in enumerate(scene.animations):
        _raise(f"scene.animations[{k}]", animation, animation_fault(animation))


def check_camera(camera: Camera, where: str = "camera") -> None:
    """Raise GiError for a camera that sees nothing: not finite, not rigid, no angle, no height."""
    if not isinstance(camera, Camera):
        raise GiError(f"{where} must be a Camera, not {shown(camera)}")
    fault = fault_of(camera, _CAMERA)
    matrix = _matrix(camera.world_from_view)
    if matrix is None or not isinstance(camera.world_from_view, np.ndarray):
        fault = f"world_from_view must be a finite (4, 4) numpy array, not {shown(camera.world_from_view)}"
    elif not (np.abs(matrix) <= MAX_COORDINATE).all() or not _is_rigid(matrix):
        fault = f"world_from_view must be a rotation and a translation of at most {MAX_COORDINATE:g} m, without scale"
    _raise(where, camera, fault)


def is_singular(matrix: NDArray[np.float64]) -> bool:
    """Tell whether a (4, 4) transform flattens a mesh so that float64 cannot invert it."""
    return bool(_singular(matrix[None, :3, :3])[0])


def _singular(linear: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell for each (n, 3, 3) matrix whether its determinant vanishes, with the largest entry scaled to 1."""
    scale = np.abs(linear).max((1, 2))[:, None, None]
    flat: NDArray[np.bool_] = np.abs(np.linalg.det(linear / np.where(scale > 0, scale, 1))) <= SINGULAR
    return flat


def _is_rigid(matrix: NDArray[np.float64]) -> bool:
    """Tell whether a matrix keeps lengths; it may mirror."""
    axes = matrix[:3, :3]
    return bool(np.abs(axes.T @ axes - np.eye(3)).max() < _NOT_RIGID) and np.allclose(matrix[3], _LAST_ROW, atol=1e-6)


def _raise(where: str, owner: Any, fault: str | None) -> None:
    """Raise GiError for a fault that begins with a field of `owner`, which is at `where`."""
    if fault is not None:
        raise GiError(f"{where}.{fault}{named(owner)}")


def _meshes(scene: Scene) -> list[tuple[str, Mesh]]:
    """Return the distinct meshes, each with the place of its first use."""
    first: dict[int, int] = {}
    for k, instance in enumerate(scene.instances):
        first.setdefault(id(instance.mesh), k)
    return [(f"scene.instances[{k}].mesh", scene.instances[k].mesh) for k in first.values()]


def _check_instances(instances: list[Instance]) -> None:
    """Check all transforms at once, since this runs whenever one of many instances moves; meshes must be correct."""
    if not instances:
        return
    # Find a transform that is no matrix.
    try:
        given = np.array([i.world_from_local for i in instances])
    except ValueError:  # of different shapes
        given = np.zeros(0)
    stacked = given.astype(np.float64) if given.dtype.kind in "fiu" else np.zeros(0)
    if stacked.shape != (len(instances), 4, 4) or not np.isfinite(stacked).all():
        k, wrong = next((k, i) for k, i in enumerate(instances) if _matrix(i.world_from_local) is None)
        value = shown(wrong.world_from_local)
        _raise(f"scene.instances[{k}]", wrong, f"world_from_local must be a finite (4, 4) matrix, not {value}")
    # Find a pose that does not suit its mesh.
    posed = [k for k, i in enumerate(instances) if i.joint_matrices is not None or i.morph_weights is not _NO_WEIGHTS]
    for k in posed:
        _raise(f"scene.instances[{k}]", instances[k], pose_fault(instances[k]))
    # Find a transform that projects, flattens its mesh or moves it too far.
    linear = stacked[:, :3, :3]
    meshes = {id(i.mesh): i.mesh for i in instances}
    place = {key: k for k, key in enumerate(meshes)}
    reach = np.array([reach_of(mesh) for mesh in meshes.values()])[[place[id(i.mesh)] for i in instances]]
    for k in posed:
        reach[k] = posed_reach(instances[k])
    with np.errstate(over="ignore", invalid="ignore"):
        flat = _singular(linear)
        extent = np.einsum("nij,nj->ni", np.abs(linear), reach) + np.abs(stacked[:, :3, 3])
    for wrong_ones, sentence in (
        (~np.isclose(stacked[:, 3], _LAST_ROW, atol=1e-6).all(1), "must be affine, with the last row 0 0 0 1"),
        (flat, "must not be singular (it flattens the mesh); give it a scale above zero"),
        (~(extent <= MAX_COORDINATE).all(1), f"must keep the mesh within {MAX_COORDINATE:g} m of the origin"),
    ):
        if wrong_ones.any():
            k = int(np.argmax(wrong_ones))
            _raise(f"scene.instances[{k}]", instances[k], f"world_from_local {sentence}")


def _matrix(value: Any) -> NDArray[np.float64] | None:
    """Return a finite (4, 4) matrix; None for anything else."""
    try:
        matrix = np.asarray(value)
    except ValueError:  # rows of different lengths
        return None
    if matrix.dtype.kind not in "fiu" or matrix.shape != (4, 4) or not np.isfinite(matrix).all():
        return None
    return matrix.astype(np.float64)


def size_fault(name: str, pixels: NDArray[Any]) -> str | None:
    """Return what is wrong with the size of an image (height, width, channels); None if nothing is."""
    height, width = pixels.shape[:2]
    if min(height, width) >= 1 and max(height, width) <= MAX_TEXTURE_SIDE:
        return None
    return f"{name} must have from 1 to {MAX_TEXTURE_SIDE} rows and columns, not {width}x{height}; scale the image"


def _light_fault(light: Light) -> str | None:
    rules = _SUN if isinstance(light, DirectionalLight) else _SPOT if isinstance(light, SpotLight) else _POINT
    fault = fault_of(light, rules)
    if fault is not None:
        return fault
    if max(light.color) * float(light.intensity) > LARGEST_LIGHT:
        return f"intensity times its color must be at most {LARGEST_LIGHT:g}"
    if isinstance(light, SpotLight) and light.inner_cone_angle > light.outer_cone_angle:
        return f"inner_cone_angle must be at most outer_cone_angle, {light.outer_cone_angle:g}"
    return None


def _environment_fault(environment: Environment) -> str | None:
    fault = fault_of(environment, _ENVIRONMENT)
    image = environment.image
    if fault is not None or image is None:
        return fault
    # An image is treated as immutable once in use: check its pixels once.
    known, brightest = _BRIGHTEST.get(environment, (None, 0.0))
    if known is not image:
        fault = size_fault("image", image)
        if fault is not None:
            return fault
        darkest, brightest = float(image.min()), float(image.max())
        if not 0 <= darkest <= brightest <= LARGEST_LIGHT:
            return f"image must hold radiance from 0 to {LARGEST_LIGHT:g}, not from {darkest:g} to {brightest:g}"
        _BRIGHTEST[environment] = image, brightest
    if brightest * max(environment.color) > LARGEST_LIGHT:
        return f"color times the brightest pixel of its image must be at most {LARGEST_LIGHT:g}"
    return None
