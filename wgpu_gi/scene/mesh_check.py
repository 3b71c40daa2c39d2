"""Checks the arrays of a mesh, its skin and morph targets, and the poses of instances: types, shapes, ranges, indices.

Each mesh once until one of its arrays is replaced, since arrays are immutable.
"""

from __future__ import annotations

from dataclasses import dataclass
from operator import attrgetter
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from ..float_limits import LARGEST_FACTOR, MAX_COORDINATE
from .rules import Rule, array, fault_of, instance_of, is_number, items, optional, text
from .scene import Instance, Material, Mesh, MorphTarget, Skin

_FIELDS = {
    "positions": array("numbers", None, 3),
    "triangles": array("integers", None, 3),
    "material_of_triangle": optional(array("integers", None)),
    "normals": optional(array("numbers", None, 3)),
    "tangents": optional(array("numbers", None, 4)),
    "texcoords0": optional(array("numbers", None, 2)),
    "texcoords1": optional(array("numbers", None, 2)),
    "colors": optional(array("numbers", None, 4)),
    "name": text,
    "skin": optional(instance_of(Skin)),
    "morph_targets": items(MorphTarget),
}
_SKIN = {"joints": array("integers", None, None), "weights": array("numbers", None, None)}
_ROWS = optional(array("numbers", None, 3))
_MORPH_TARGET = {"positions": _ROWS, "normals": _ROWS, "tangents": _ROWS, "name": text}
_POSE = {
    "joint_matrices": optional(array("numbers", None, 4, 4)),
    "morph_weights": Rule(
        lambda v: isinstance(v, (tuple, list)) and all(is_number(w) and abs(w) <= LARGEST_FACTOR for w in v),
        f"a tuple of numbers from {-LARGEST_FACTOR:g} to {LARGEST_FACTOR:g}",
    ),
}
MOST_JOINTS = 1 << 16
_WEIGHT_ERROR = 1e-3  # of the sum of a vertex's weights: above the rounding of 8-bit weights that were normalised
_MATERIALS = {"materials": items(Material)}
_ATTRIBUTES = ("normals", "tangents", "texcoords0", "texcoords1", "colors")
_arrays = attrgetter("positions", "triangles", "material_of_triangle", *_ATTRIBUTES, "skin", "morph_targets")


@dataclass
class _Facts:
    """What the arrays of a correct mesh hold: the largest |coordinate| per axis, (3,), and indices.

    `target_reach` (t, 3) is the largest |displacement| of each morph target.
    """

    arrays: tuple[Any, ...]
    reach: NDArray[np.float64]
    target_reach: NDArray[np.float64]
    last_material: int  # -1 without triangles
    last_joint: int  # -1 without a skin


_KNOWN: WeakKeyDictionary[Mesh, _Facts] = WeakKeyDictionary()


def arrays_of(mesh: Mesh) -> tuple[Any, ...]:
    """Return the arrays of a mesh, positions first, its skin and morph targets; None for those it does not have."""
    found: tuple[Any, ...] = _arrays(mesh)
    if isinstance(mesh.skin, Skin):
        found += mesh.skin.joints, mesh.skin.weights
    for target in mesh.morph_targets if isinstance(mesh.morph_targets, list) else ():
        if isinstance(target, MorphTarget):
            found += target, target.positions, target.normals, target.tangents
    return found


def are_same(some: tuple[Any, ...], others: tuple[Any, ...]) -> bool:
    """Tell whether two results of `arrays_of` hold the same objects."""
    return len(some) == len(others) and all(a is b for a, b in zip(some, others, strict=True))


def materials_fault(mesh: Mesh) -> str | None:
    """Return what is wrong with the type of a mesh's list of materials; None if nothing is."""
    return fault_of(mesh, _MATERIALS)


def mesh_fault(mesh: Mesh) -> str | None:
    """Return what is wrong with a mesh, beginning with the field; None if nothing is. Materials are only counted."""
    facts = _KNOWN.get(mesh)
    if facts is None or not are_same(facts.arrays, arrays_of(mesh)):
        fault = _array_fault(mesh)
        if fault is not None:
            return fault
        facts = _KNOWN[mesh] = _facts_of(mesh)
    if facts.last_material >= len(mesh.materials):
        return f"materials has {len(mesh.materials)}, but a triangle has material {facts.last_material}"
    return None


def reach_of(mesh: Mesh) -> NDArray[np.float64]:
    """Return the largest |coordinate| per axis, (3,), of a mesh without fault."""
    return _KNOWN[mesh].reach


def posed_reach(instance: Instance) -> NDArray[np.float64]:
    """Return a bound of |coordinate| per axis, (3,), of a posed mesh without fault, in the instance's local space."""
    facts, weights = _KNOWN[instance.mesh], np.abs(np.asarray(instance.morph_weights, np.float64))
    reach: NDArray[np.float64] = facts.reach + weights @ facts.target_reach[: len(weights)]
    if instance.joint_matrices is not None and len(instance.joint_matrices):
        largest = np.abs(instance.joint_matrices).max(0)
        reach = largest[:3, :3] @ reach + largest[:3, 3]
    return reach


def pose_fault(instance: Instance) -> str | None:
    """Return what is wrong with the pose of an instance, whose mesh has no fault; None if nothing is."""
    fault = fault_of(instance, _POSE)
    if fault is not None:
        return fault
    count, last = len(instance.mesh.morph_targets), _KNOWN[instance.mesh].last_joint
    if len(instance.morph_weights) > count:
        return f"morph_weights has {len(instance.morph_weights)} weights, but its mesh has {count} morph targets"
    matrices = instance.joint_matrices
    if matrices is None:
        return None
    if last < 0 or len(matrices) <= last:
        return f"joint_matrices has {len(matrices)}, but the skin of its mesh has {last + 1} joints"
    if not np.isfinite(matrices).all() or not np.allclose(matrices[:, 3], (0.0, 0.0, 0.0, 1.0), atol=1e-6):
        return "joint_matrices must be finite and affine, with the last row 0 0 0 1"
    return None


def _array_fault(mesh: Mesh) -> str | None:
    """Return the first fault of the fields."""
    fault = fault_of(mesh, _FIELDS)
    if fault is not None:
        return fault
    # Every row belongs to a vertex or a triangle.
    count = len(mesh.positions)
    lengths = dict.fromkeys(_ATTRIBUTES, count) | {"material_of_triangle": len(mesh.triangles)}
    for name, length in lengths.items():
        values = getattr(mesh, name)
        if values is not None and len(values) != length:
            of = "triangles" if name == "material_of_triangle" else "positions"
            return f"{name} must have a row for each of the {length} {of}, not {len(values)} rows"
    # Indices and values are in range.
    if len(mesh.triangles) and not _within(mesh.triangles, 0, count - 1):
        wrong = _first_outside(mesh.triangles, 0, count - 1)
        return f"triangles must be indices from 0 to {count - 1} into positions, not {wrong}"
    for name in ("positions", *_ATTRIBUTES):
        values = getattr(mesh, name)
        if values is not None and not np.isfinite(values).all():
            row = int(np.argmin(np.isfinite(values).all(1)))
            return f"{name}[{row}] must be finite, not ({', '.join(f'{value:g}' for value in values[row].tolist())})"
    if not _within(mesh.positions, -MAX_COORDINATE, MAX_COORDINATE):
        wrong = _first_outside(mesh.positions, -MAX_COORDINATE, MAX_COORDINATE)
        return f"positions must lie between {-MAX_COORDINATE:g} and {MAX_COORDINATE:g} m, not at {wrong}"
    if mesh.material_of_triangle is not None and len(mesh.triangles):
        low = int(mesh.material_of_triangle.min())
        if low < 0:
            return f"material_of_triangle must be indices into materials, not {low}"
    return _skin_fault(mesh) or _morphs_fault(mesh)


def _skin_fault(mesh: Mesh) -> str | None:
    """Return the first fault of a mesh's skin."""
    skin, count = mesh.skin, len(mesh.positions)
    if skin is None:
        return None
    if (fault := fault_of(skin, _SKIN)) is not None:
        return f"skin.{fault}"
    if not len(skin.joints) == len(skin.weights) == count or skin.joints.shape != skin.weights.shape:
        rows = f"have the same shape, with a row for each of the {count} positions"
        return f"skin.joints and skin.weights must {rows}, not {skin.joints.shape} and {skin.weights.shape}"
    if not skin.joints.shape[1]:
        return "skin.joints must have at least one column"
    if not _within(skin.joints, 0, MOST_JOINTS - 1):
        wrong = _first_outside(skin.joints, 0, MOST_JOINTS - 1)
        return f"skin.joints must be indices from 0 to {MOST_JOINTS - 1}, not {wrong}"
    if not _within(skin.weights, 0, 1 + _WEIGHT_ERROR):
        return f"skin.weights must be from 0 to 1, not {_first_outside(skin.weights, 0, 1 + _WEIGHT_ERROR):g}"
    sums = skin.weights.sum(1, dtype=np.float64)
    if count and np.abs(sums - 1).max() > _WEIGHT_ERROR:
        row = int(np.abs(sums - 1).argmax())
        return f"skin.weights[{row}] must sum to 1, not to {sums[row]:g}"
    return None


def _morphs_fault(mesh: Mesh) -> str | None:
    """Return the first fault of a mesh's morph targets."""
    for k, target in enumerate(mesh.morph_targets):
        if (fault := fault_of(target, _MORPH_TARGET)) is not None:
            return f"morph_targets[{k}].{fault}"
        for name in ("positions", "normals", "tangents"):
            values = getattr(target, name)
            if values is not None and len(values) != len(mesh.positions):
                rows = f"a row for each of the {len(mesh.positions)} positions"
                return f"morph_targets[{k}].{name} must have {rows}, not {len(values)}"
            if values is not None and not _within(values, -MAX_COORDINATE, MAX_COORDINATE):
                return f"morph_targets[{k}].{name} must be finite, at most {MAX_COORDINATE:g} m"
    return None


def _within(values: NDArray[Any], low: float, high: float) -> bool:
    """Tell whether all values are in range; NaN is not."""
    return not values.size or low <= values.min().item() <= values.max().item() <= high


def _first_outside(values: NDArray[Any], low: float, high: float) -> Any:
    """Return the first value out of range."""
    return next(value for value in values.ravel().tolist() if not low <= value <= high)


def _facts_of(mesh: Mesh) -> _Facts:
    """Return the facts of a mesh whose arrays are correct."""
    reach = _reach(mesh.positions)
    moves = [np.zeros(3) if t.positions is None else _reach(t.positions) for t in mesh.morph_targets]
    target_reach = np.array(moves).reshape(-1, 3)
    last_joint = -1 if mesh.skin is None or not len(mesh.skin.joints) else int(mesh.skin.joints.max())
    slots = mesh.material_of_triangle
    last_material = -1 if not len(mesh.triangles) else 0 if slots is None else int(slots.max())
    return _Facts(arrays_of(mesh), reach, target_reach, last_material, last_joint)


def _reach(positions: NDArray[Any]) -> NDArray[np.float64]:
    """Return the largest |coordinate| per axis, (3,); zeros without positions."""
    return np.abs(positions).max(0, initial=0).astype(np.float64)
