"""Skins of a glTF file: joint matrices of a pose, the influences of vertices, and linear blend skinning (3.7.3)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import GiError
from ...float_limits import MAX_COORDINATE
from ..mesh_check import MOST_JOINTS
from ..mesh_cleaning import unit_rows
from .accessors import Accessors
from .document import Document
from .json_object import Damage, JsonObject

Influences = tuple[NDArray[np.int64], NDArray[np.float64]]  # joints and weights (n, k) of vertices; rows sum to 1


class SkinDamage(GiError):
    """An error that costs the skin of a mesh; the mesh can be shown without it."""


@dataclass
class RestSkin:
    """A skin at rest: the nodes that are its joints, `matrices` (k, 4, 4) relative to `frame`, (4, 4).

    The frame stands at the first joint. Positions relative to it are small numbers, wherever the mesh is in the world.
    """

    joints: list[int]
    inverse_bind: NDArray[np.float64]
    matrices: NDArray[np.float64]
    frame: NDArray[np.float64]


def rest_skin(
    document: Document, accessors: Accessors, skin: int, world_of_node: list[NDArray[np.float64] | None]
) -> RestSkin:
    """Return a skin posed by the world matrices of the nodes. Raises SkinDamage."""
    description = document.array("skins")[skin]
    try:
        joints = description.indices("joints", len(world_of_node), "nodes")
        placed = [matrix for joint in joints if (matrix := world_of_node[joint]) is not None]
        if not joints or len(placed) < len(joints):
            raise description.error("it has no joints" if not joints else "a joint's transform is out of range")
        if len(joints) > MOST_JOINTS:
            raise description.error(f"it has {len(joints)} joints, more than {MOST_JOINTS}")
        frame = np.eye(4)
        frame[:3, 3] = placed[0][:3, 3]
        posed = np.stack(placed)
        posed[:, :3, 3] -= frame[:3, 3]
        inverse_bind = np.tile(np.eye(4), (len(joints), 1, 1))
        if "inverseBindMatrices" in description:
            values = accessors.read(description.index("inverseBindMatrices", len(accessors), "accessors"))
            if values.shape[1] != 16 or len(values) < len(joints):
                raise description.error(f"inverseBindMatrices must hold {len(joints)} MAT4")
            if not (np.abs(values) <= MAX_COORDINATE).all():  # false for NaN, too
                raise description.error(f"inverseBindMatrices must be finite, at most {MAX_COORDINATE:g}")
            inverse_bind[:] = values[: len(joints)].astype(np.float64).reshape(-1, 4, 4).transpose(0, 2, 1)
            inverse_bind[:, 3] = 0.0, 0.0, 0.0, 1.0
    except Damage as error:
        raise SkinDamage(str(error)) from None
    return RestSkin(joints, inverse_bind, posed @ inverse_bind, frame)


def apply_skin(vertices: dict[str, NDArray[np.float32]], joints: NDArray[np.float64], influences: Influences) -> None:
    """Pose positions, normals and tangents of `vertices` in place by joint matrices (k, 4, 4).

    Directions are transformed by the linear part of the blended matrix (glTF 2.0, 3.7.3.3) and normalised.
    """
    matrices = np.zeros((len(influences[0]), 3, 4))
    for joint, weight in zip(influences[0].T, influences[1].T, strict=True):
        matrices += weight[:, None, None] * joints[joint, :3]
    # Transform positions and directions.
    posed = np.einsum("nij,nj->ni", matrices[:, :, :3], vertices["POSITION"]) + matrices[:, :, 3]
    vertices["POSITION"] = posed.astype(np.float32)
    for name in ("NORMAL", "TANGENT"):
        if name in vertices:
            turned = np.einsum("nij,nj->ni", matrices[:, :, :3], vertices[name][:, :3])
            vertices[name] = np.column_stack([unit_rows(turned), vertices[name][:, 3:]])


def read_influences(
    count: int, joint_count: int, primitive: JsonObject, read: Callable[[str], NDArray[Any] | None]
) -> Influences:
    """Return joints and weights of `count` vertices from all sets of four influences, the largest weights first.

    `read` returns attributes by name, or None. A vertex without weights follows its first joint. Raises Damage if there
    are no influences of the right type.
    """
    joints, weights = [], []
    number = 0
    while (bound := read(f"JOINTS_{number}")) is not None and (given := read(f"WEIGHTS_{number}")) is not None:
        if bound.dtype.kind != "u" or not bound.shape == given.shape == (count, 4):
            raise primitive.error(f"JOINTS_{number} and WEIGHTS_{number} must hold 4 values for each position")
        joint, weight = bound.astype(np.int64), given.astype(np.float64)
        if ((joint >= joint_count) & (weight != 0.0)).any():
            primitive.damage(f"JOINTS_{number} refers to joint {joint.max()} of {joint_count}; it was ignored")
        valid = (joint < joint_count) & (weight > 0.0) & np.isfinite(weight)
        joints.append(np.where(joint < joint_count, joint, 0))
        weights.append(np.where(valid, weight, 0.0))
        number += 1
    if not joints:
        raise primitive.error("its mesh has a skin, but it has no JOINTS_0 and WEIGHTS_0")
    # Normalise the weights.
    joint, weight = np.concatenate(joints, axis=1), np.concatenate(weights, axis=1)
    total = weight.sum(axis=1)
    free = total <= 0.0
    if free.any():
        primitive.damage(f"{np.count_nonzero(free)} vertices have no skin weights; they follow their first joint")
        weight[free, 0] = total[free] = 1.0
    weight /= total[:, None]
    # Leave out columns that no vertex needs.
    order = np.argsort(-weight, axis=1, kind="stable")
    joint, weight = np.take_along_axis(joint, order, axis=1), np.take_along_axis(weight, order, axis=1)
    needed = max(int(np.count_nonzero(weight.any(axis=0))), 1)
    return joint[:, :needed], weight[:, :needed]
