"""The exact pose of skinned and morphed meshes on the CPU, in float64 (glTF 2.0, 3.7.2.2 and 3.7.3.3).

    position = sum_i weights_i joint_matrices[joints_i] (position + sum_t morph_weights[t] displacement_t)

Normals and tangents are morphed alike, transformed by the linear part of the blended matrix, and normalised.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .parts import Instance, Mesh

Array = NDArray[np.float64]


def is_skinned(instance: Instance) -> bool:
    """Tell whether joints pose the mesh of an instance."""
    return instance.mesh.skin is not None and instance.joint_matrices is not None


def is_morphed(instance: Instance) -> bool:
    """Tell whether morph targets move the mesh of an instance, also if all of its weights are 0 now."""
    return bool(instance.mesh.morph_targets) and len(instance.morph_weights) > 0


def is_deformed(instance: Instance) -> bool:
    """Tell whether an instance has another shape than the arrays of its mesh."""
    return is_skinned(instance) or is_morphed(instance)


def posed_mesh(instance: Instance) -> Mesh:
    """Return the mesh of an instance in its pose, in the instance's local space: the mesh itself if nothing deforms it.

    The new mesh shares all arrays but positions, normals and tangents, which are float64, and has no skin and no
    targets. Directions that the pose makes zero are zero.
    """
    if not is_deformed(instance):
        return instance.mesh
    mesh, matrices = instance.mesh, _blended_matrices(instance)
    normals, tangents = _morphed(instance, "normals"), _morphed(instance, "tangents")
    if tangents is not None:
        tangents = np.column_stack([_turned(tangents[:, :3], matrices), tangents[:, 3:]])
    arrays: dict[str, Any] = {
        "positions": _moved(_morphed(instance, "positions"), matrices),
        "normals": None if normals is None else _turned(normals, matrices),
        "tangents": tangents,
    }
    return replace(mesh, **arrays, skin=None, morph_targets=[])


def posed_positions(instance: Instance) -> Array:
    """Return the positions (n, 3) of an instance in its pose, in its local space."""
    if not is_deformed(instance):
        return np.asarray(instance.mesh.positions, np.float64)
    return _moved(_morphed(instance, "positions"), _blended_matrices(instance))


def _morphed(instance: Instance, name: str) -> Any:
    """Return positions, normals or tangents with the weighted displacements of the morph targets; None without."""
    base = getattr(instance.mesh, name)
    if base is None:
        return None
    values = np.array(base, np.float64)
    for target, weight in zip(instance.mesh.morph_targets, instance.morph_weights, strict=False):
        moves = getattr(target, name)
        if moves is not None and weight:
            values[:, :3] += weight * np.asarray(moves, np.float64)
    return values


def _blended_matrices(instance: Instance) -> Array | None:
    """Return the joint matrices of each vertex, (n, 3, 4), blended by its weights; None without joints."""
    skin, joints = instance.mesh.skin, instance.joint_matrices
    if skin is None or joints is None:
        return None
    rows = np.asarray(joints, np.float64)[:, :3]
    matrices = np.zeros((len(skin.joints), 3, 4))
    for column in range(skin.joints.shape[1]):
        weights = np.asarray(skin.weights[:, column], np.float64)
        matrices += weights[:, None, None] * rows[skin.joints[:, column]]
    return matrices


def _moved(positions: Array, matrices: Array | None) -> Array:
    """Return positions (n, 3) transformed by a matrix each."""
    if matrices is None:
        return positions
    moved: Array = np.einsum("nij,nj->ni", matrices[:, :, :3], positions) + matrices[:, :, 3]
    return moved


def _turned(directions: Array, matrices: Array | None) -> Array:
    """Return directions (n, 3) transformed by the linear part of a matrix each, with unit length."""
    turned = directions if matrices is None else np.einsum("nij,nj->ni", matrices[:, :, :3], directions)
    # Dividing by the largest entry first keeps the squares of tiny directions from vanishing.
    turned = turned / np.maximum(np.abs(turned).max(1, initial=0.0, keepdims=True), 1e-300)
    unit: Array = turned / np.maximum(np.linalg.norm(turned, axis=1, keepdims=True), 1e-300)
    return unit
