"""Checks the arrays of a mesh: types, shapes, ranges and indices. Arrays are immutable, so each is checked once."""

from __future__ import annotations

from dataclasses import dataclass
from operator import attrgetter
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from ..float_limits import MAX_COORDINATE
from .rules import array, fault_of, items, optional, text
from .scene import Material, Mesh

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
}
_MATERIALS = {"materials": items(Material)}
_ATTRIBUTES = ("normals", "tangents", "texcoords0", "texcoords1", "colors")
_arrays = attrgetter("positions", "triangles", "material_of_triangle", *_ATTRIBUTES)


@dataclass
class _Facts:
    """What the arrays of a correct mesh hold: the largest |coordinate| per axis, (3,), and material index."""

    arrays: tuple[Any, ...]
    reach: NDArray[np.float64]
    last_material: int  # -1 without triangles


_KNOWN: WeakKeyDictionary[Mesh, _Facts] = WeakKeyDictionary()


def arrays_of(mesh: Mesh) -> tuple[Any, ...]:
    """Return the arrays of a mesh, positions first, and None for those it does not have."""
    found: tuple[Any, ...] = _arrays(mesh)
    return found


def are_same(some: tuple[Any, ...], others: tuple[Any, ...]) -> bool:
    """Tell whether two results of `arrays_of` hold the same objects."""
    return all(a is b for a, b in zip(some, others, strict=True))


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
    return None


def _within(values: NDArray[Any], low: float, high: float) -> bool:
    """Tell whether all values are in range; NaN is not."""
    return not values.size or low <= values.min().item() <= values.max().item() <= high


def _first_outside(values: NDArray[Any], low: float, high: float) -> Any:
    """Return the first value out of range."""
    return next(value for value in values.ravel().tolist() if not low <= value <= high)


def _facts_of(mesh: Mesh) -> _Facts:
    """Return the facts of a mesh whose arrays are correct."""
    reach = np.abs(mesh.positions).max(0).astype(np.float64) if len(mesh.positions) else np.zeros(3)
    if not len(mesh.triangles):
        return _Facts(arrays_of(mesh), reach, -1)
    slots = mesh.material_of_triangle
    return _Facts(arrays_of(mesh), reach, 0 if slots is None else int(slots.max()))
