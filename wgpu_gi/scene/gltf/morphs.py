"""Morph targets of glTF primitives: displacements, and attribute + sum of weight * displacement (glTF 2.0, 3.7.2.2)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...float_limits import MAX_COORDINATE
from .geometry import as_floats
from .json_object import Damage, JsonObject

Weights = tuple[float, ...]
# What moves while an animation plays, and its field of MorphTarget.
DISPLACED = {"POSITION": "positions", "NORMAL": "normals", "TANGENT": "tangents"}


def rest_weights(node: JsonObject, mesh: JsonObject) -> Weights:
    """Return the weights of a node's mesh without animation, up to the last that is not 0: the node's or the mesh's."""
    weights = list((node if "weights" in node else mesh).numbers("weights")[: target_count(mesh)])
    while weights and weights[-1] == 0.0:
        weights.pop()
    return tuple(weights)


def target_count(mesh: JsonObject) -> int:
    """Return the number of morph targets of a mesh, the largest of its primitives."""
    return max((len(primitive.values("targets")) for primitive in mesh.objects("primitives")), default=0)


def target_names(mesh: JsonObject) -> list[str]:
    """Return the names of the morph targets, which many exporters write as `extras.targetNames`."""
    extras = mesh.raw.get("extras")
    names = extras.get("targetNames") if isinstance(extras, dict) else None
    return [name if isinstance(name, str) else "" for name in names] if isinstance(names, list) else []


def read_displacements(
    arrays: dict[str, NDArray[Any]], primitive: JsonObject, read: Callable[[JsonObject, str], NDArray[Any]]
) -> dict[str, NDArray[np.float32]]:
    """Return the displacements (n, 3) of positions, normals and tangents in `arrays` by key: see `displacement_key`.

    What is wrong is ignored, with a note; values that are not finite are 0.
    """
    found: dict[str, NDArray[np.float32]] = {}
    for number, target in enumerate(primitive.objects("targets")):
        others = [name for name in target.raw if name in arrays and name not in DISPLACED]
        if others:
            target.notes.add(f"{primitive.where}: morph targets of {', '.join(others)} do not move.")
        for name in (name for name in DISPLACED if name in target.raw and name in arrays):
            moves = _displacements(target, name, len(arrays[name]), read)
            if moves is not None and moves.any():
                found[displacement_key(number, name)] = moves
    return found


def displacement_key(target: int, name: str) -> str:
    """Return the key of the displacements of an attribute by a target among the arrays of vertices."""
    return f"{target}/{name}"


def _displacements(
    target: JsonObject, name: str, count: int, read: Callable[[JsonObject, str], NDArray[Any]]
) -> NDArray[np.float32] | None:
    """Return the displacements of one attribute; None, with a note, if they are wrong."""
    try:
        moves = read(target, name)
        if moves.shape != (count, 3):
            raise target.error(f"{name} has the shape {moves.shape} for {count} vertices")
    except Damage as error:
        target.notes.damage(f"{error}; it was ignored.")
        return None
    finite = np.abs(moves) <= MAX_COORDINATE  # false for NaN, too
    if not finite.all():
        target.damage(f"{np.count_nonzero(~finite.all(axis=1))} values of {name} are not finite; they were ignored")
    return np.where(finite, moves, 0).astype(np.float32)


def apply_morphs(
    arrays: dict[str, NDArray[Any]],
    primitive: JsonObject,
    weights: Weights,
    read: Callable[[JsonObject, str], NDArray[Any]],
) -> None:
    """Add the weighted displacements to the attributes in `arrays`, in place; directions are left unnormalised.

    `read` returns an attribute of a target by name. A target whose data is wrong is ignored, with a note.
    """
    for target, weight in zip(primitive.objects("targets"), weights, strict=False):
        for name in target.raw if weight else ():
            if name not in arrays:
                continue
            base = as_floats(name, arrays[name])
            try:
                moves = read(target, name)
                if len(moves) != len(base) or moves.shape[1] > base.shape[1]:
                    raise target.error(f"{name} has the shape {moves.shape}, the attribute {base.shape}")
            except Damage as error:
                target.notes.damage(f"{error}; it was ignored.")
                continue
            # Displacements of tangents have no w. Absurd weights give positions that are left out later.
            moved, columns = base.copy(), moves.shape[1]
            with np.errstate(over="ignore", invalid="ignore"):
                moved[:, :columns] = (base[:, :columns] + weight * moves.astype(np.float64)).astype(np.float32)
            arrays[name] = moved
