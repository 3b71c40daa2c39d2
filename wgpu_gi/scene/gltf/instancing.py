"""Instances of one node by EXT_mesh_gpu_instancing: translations, rotations and scales from accessors."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...float_limits import MAX_COORDINATE
from ..transforms import rotation_matrices
from .accessors import Accessors
from .document import Document
from .json_object import Damage, JsonObject

_WIDTHS = {"TRANSLATION": 3, "ROTATION": 4, "SCALE": 3}
_BYTES = 1024  # of an instance: its matrix and Python objects


def instance_matrices(
    document: Document, accessors: Accessors, node: JsonObject, world_from_node: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return node_from_instance (n, 4, 4) of a node: the identity without the extension, or if that is damaged."""
    extension = node.extension("EXT_mesh_gpu_instancing")
    if extension is None:
        return np.eye(4)[None]
    try:
        matrices = _matrices(document, accessors, extension)
    except Damage as error:
        document.notes.damage(f"{error}; its mesh is shown once.")
        return np.eye(4)[None]
    with np.errstate(over="ignore", invalid="ignore"):
        placed = (np.abs(world_from_node @ matrices) < MAX_COORDINATE).all(axis=(1, 2))  # false for NaN, too
    if not placed.all():
        extension.damage(f"{np.count_nonzero(~placed)} instances are not finite or out of range; they were left out")
    return matrices[placed]


def _matrices(document: Document, accessors: Accessors, extension: JsonObject) -> NDArray[np.float64]:
    """Return translation * rotation * scale of each instance. Raises Damage."""
    # Read the attributes, of which some may be absent.
    attributes = extension.child("attributes")
    values: dict[str, NDArray[np.float64]] = {}
    for name, width in _WIDTHS.items():
        if name in attributes:
            array = accessors.read(attributes.index(name, len(accessors), "accessors"))
            if array.shape[1] != width or len(array) != len(next(iter(values.values()), array)):
                raise attributes.error(f"{name} must have {width} components, and as many elements as the others")
            document.budget.take(_BYTES * len(array), extension.where)
            values[name] = array.astype(np.float64)
    if not values:
        raise attributes.error("it has no TRANSLATION, ROTATION or SCALE")
    # Multiply them.
    matrices = np.tile(np.eye(4), (len(next(iter(values.values()))), 1, 1))
    if "ROTATION" in values:
        matrices[:, :3, :3] = rotation_matrices(values["ROTATION"])
    if "SCALE" in values:
        matrices[:, :3, :3] *= values["SCALE"][:, None, :]
    if "TRANSLATION" in values:
        matrices[:, :3, 3] = values["TRANSLATION"]
    return matrices
