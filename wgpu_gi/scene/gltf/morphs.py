"""Morph targets of a glTF primitive at the weights of rest: attribute + sum of weight * displacement (3.7.2.2)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .geometry import as_floats
from .json_object import Damage, JsonObject

Weights = tuple[float, ...]


def rest_weights(node: JsonObject, mesh: JsonObject) -> Weights:
    """Return the weights of a node's mesh without animation, up to the last that is not 0: the node's or the mesh's."""
    count = max((len(primitive.values("targets")) for primitive in mesh.objects("primitives")), default=0)
    weights = list((node if "weights" in node else mesh).numbers("weights")[:count])
    while weights and weights[-1] == 0.0:
        weights.pop()
    return tuple(weights)


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
