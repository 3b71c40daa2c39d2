"""Skinned meshes of a glTF file in their rest pose: linear blend skinning by the unanimated nodes (glTF 2.0, 3.7.3)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import GiError
from ..mesh_cleaning import unit_rows
from .accessors import Accessors
from .document import Document
from .json_object import Damage, JsonObject


class SkinDamage(GiError):
    """An error that costs the skin of a mesh; the mesh can be shown without it."""


def joint_matrices(
    document: Document, accessors: Accessors, skin: int, world_of_node: list[NDArray[np.float64] | None]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the joint matrices (k, 4, 4) of a skin, relative to a frame at its first joint, and that frame, (4, 4).

    Positions relative to that frame are small numbers, wherever the mesh is in the world. Raises SkinDamage.
    """
    description = document.array("skins")[skin]
    try:
        joints = description.indices("joints", len(world_of_node), "nodes")
        placed = [matrix for joint in joints if (matrix := world_of_node[joint]) is not None]
        if not joints or len(placed) < len(joints):
            raise description.error("it has no joints" if not joints else "a joint's transform is out of range")
        frame = np.eye(4)
        frame[:3, 3] = placed[0][:3, 3]
        posed = np.stack(placed)
        posed[:, :3, 3] -= frame[:3, 3]
        if "inverseBindMatrices" in description:
            values = accessors.read(description.index("inverseBindMatrices", len(accessors), "accessors"))
            if values.shape[1] != 16 or len(values) < len(joints):
                raise description.error(f"inverseBindMatrices must hold {len(joints)} MAT4")
            if not np.isfinite(values).all():
                raise description.error("inverseBindMatrices must be finite")
            posed = posed @ values[: len(joints)].astype(np.float64).reshape(-1, 4, 4).transpose(0, 2, 1)
    except Damage as error:
        raise SkinDamage(str(error)) from None
    return posed, frame


def apply_skin(
    vertices: dict[str, NDArray[np.float32]],
    joints: NDArray[np.float64],
    primitive: JsonObject,
    read: Callable[[str], NDArray[Any] | None],
) -> None:
    """Pose positions, normals and tangents of `vertices` in place; `read` returns other attributes by name, or None.

    Directions are transformed by the linear part of the blended matrix (glTF 2.0, 3.7.3.3) and normalised. A vertex
    without weights follows its first joint. Raises Damage if there are no influences of the right type.
    """
    positions = vertices["POSITION"]
    matrices = _blended_matrices(len(positions), joints, primitive, read)
    # Transform positions and directions.
    posed = np.einsum("nij,nj->ni", matrices[:, :, :3], positions) + matrices[:, :, 3]
    vertices["POSITION"] = posed.astype(np.float32)
    for name in ("NORMAL", "TANGENT"):
        if name in vertices:
            turned = np.einsum("nij,nj->ni", matrices[:, :, :3], vertices[name][:, :3])
            vertices[name] = np.column_stack([unit_rows(turned), vertices[name][:, 3:]])


def _blended_matrices(
    count: int, joints: NDArray[np.float64], primitive: JsonObject, read: Callable[[str], NDArray[Any] | None]
) -> NDArray[np.float64]:
    """Return the joint matrices of each vertex, (count, 3, 4), blended over all sets of four influences."""
    matrices = np.zeros((count, 3, 4))
    total = np.zeros(count)
    first: NDArray[np.int64] | None = None
    number = 0
    while (bound := read(f"JOINTS_{number}")) is not None and (weights := read(f"WEIGHTS_{number}")) is not None:
        if bound.dtype.kind != "u" or not bound.shape == weights.shape == (count, 4):
            raise primitive.error(f"JOINTS_{number} and WEIGHTS_{number} must hold 4 values for each position")
        for column in range(4):
            joint, weight = bound[:, column].astype(np.int64), weights[:, column].astype(np.float64)
            valid = (joint < len(joints)) & (weight > 0.0) & np.isfinite(weight)
            if ((joint >= len(joints)) & (weight != 0.0)).any():
                primitive.damage(f"JOINTS_{number} refers to joint {joint.max()} of {len(joints)}; it was ignored")
            joint, weight = np.where(joint < len(joints), joint, 0), np.where(valid, weight, 0.0)
            first = joint if first is None else first
            matrices += weight[:, None, None] * joints[joint, :3]
            total += weight
        number += 1
    if first is None:
        raise primitive.error("its mesh has a skin, but it has no JOINTS_0 and WEIGHTS_0")
    # Normalise the weights.
    free = total <= 0.0
    if free.any():
        primitive.damage(f"{np.count_nonzero(free)} vertices have no skin weights; they follow their first joint")
        matrices[free] = joints[first[free], :3]
    return matrices / np.where(free, 1.0, total)[:, None, None]
