"""Skinned meshes of a glTF file in their rest pose: linear blend skinning by the unanimated nodes (glTF 2.0, 3.7.3)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..mesh_cleaning import unit_rows
from .accessors import Accessors
from .document import Document
from .json_object import JsonObject


def joint_matrices(
    document: Document, accessors: Accessors, skin: int, world_of_node: list[NDArray[np.float64]]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the joint matrices (k, 4, 4) of a skin, relative to a frame at its first joint, and that frame, (4, 4).

    Positions relative to that frame are small numbers, wherever the mesh is in the world.
    """
    description = document.array("skins")[skin]
    joints = description.indices("joints", len(world_of_node), "nodes")
    if not joints:
        raise description.error("it has no joints; the file is damaged")
    frame = np.eye(4)
    frame[:3, 3] = world_of_node[joints[0]][:3, 3]
    posed = np.stack([world_of_node[joint] for joint in joints])
    posed[:, :3, 3] -= frame[:3, 3]
    if "inverseBindMatrices" in description:
        values = accessors.read(description.index("inverseBindMatrices", len(accessors), "accessors"))
        if values.shape[1] != 16 or len(values) < len(joints):
            raise description.error(f"inverseBindMatrices must hold {len(joints)} MAT4; the file is damaged")
        if not np.isfinite(values).all():
            raise description.error("inverseBindMatrices must be finite; the file is damaged")
        posed = posed @ values[: len(joints)].astype(np.float64).reshape(-1, 4, 4).transpose(0, 2, 1)
    return posed, frame


def apply_skin(
    vertices: dict[str, NDArray[np.float32]],
    joints: NDArray[np.float64],
    primitive: JsonObject,
    read: Callable[[str], NDArray[Any] | None],
) -> None:
    """Pose positions, normals and tangents of `vertices` in place; `read` returns other attributes by name, or None.

    Directions are transformed by the linear part of the blended matrix (glTF 2.0, 3.7.3.3) and normalised.
    """
    # Blend the joint matrices of each vertex over all sets of four joints.
    positions = vertices["POSITION"]
    matrices = np.zeros((len(positions), 3, 4))
    total = np.zeros(len(positions))
    number = 0
    while (bound := read(f"JOINTS_{number}")) is not None and (weights := read(f"WEIGHTS_{number}")) is not None:
        if bound.dtype.kind != "u" or not bound.shape == weights.shape == (len(positions), 4):
            raise primitive.error(f"JOINTS_{number} and WEIGHTS_{number} must hold 4 values for each position")
        if int(bound.max()) >= len(joints):
            raise primitive.error(f"JOINTS_{number} refers to joint {bound.max()}; its skin has {len(joints)}")
        for column in range(4):
            matrices += weights[:, column, None, None] * joints[bound[:, column], :3]
            total += weights[:, column]
        number += 1
    if number == 0:
        raise primitive.error("its mesh has a skin, but it has no JOINTS_0 and WEIGHTS_0; the file is damaged")
    matrices /= np.where(total > 0.0, total, 1.0)[:, None, None]
    # Transform positions and directions.
    posed = np.einsum("nij,nj->ni", matrices[:, :, :3], positions) + matrices[:, :, 3]
    vertices["POSITION"] = posed.astype(np.float32)
    for name in ("NORMAL", "TANGENT"):
        if name in vertices:
            turned = np.einsum("nij,nj->ni", matrices[:, :, :3], vertices[name][:, :3])
            vertices[name] = np.column_stack([unit_rows(turned), vertices[name][:, 3:]])
