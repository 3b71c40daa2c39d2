"""Rotations from quaternions, and repairs of transforms: flat ones become invertible, those of cameras rigid."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]

_FLAT = 1e-7  # ratio of a matrix's singular values below which float32 cannot invert it
_RIGID = 1e-14  # error of the products of a rotation's axes: some roundings of float64
_NOTHING = 1e-18  # scale at which anything is invisible
_TINY = 1e-9  # scale of what an animation hides by a scale of zero: float32 inverts it


def invertible(matrix: Matrix) -> Matrix | None:
    """Return `matrix`, or one that is invertible and looks the same; None if it projects everything to a line.

    Exporters write flat objects with a scale of zero along one axis. Those get a thickness below float32's resolution.
    """
    left, scales, right = np.linalg.svd(matrix[:3, :3])
    if scales[1] <= max(_FLAT * scales[0], _NOTHING):
        return None
    if scales[2] > _FLAT * scales[0]:
        return matrix
    thick = matrix.copy()
    thick[:3, :3] = left @ np.diag([scales[0], scales[1], 10 * _FLAT * scales[0]]) @ right
    return thick


def visible(matrix: Matrix) -> Matrix:
    """Return `matrix`, or one that is invertible and as thin or small as nobody sees, where it scales to zero."""
    thick = invertible(matrix)
    if thick is not None:
        return thick
    left, scales, right = np.linalg.svd(matrix[:3, :3])
    thick = matrix.copy()
    thick[:3, :3] = left @ np.diag(np.maximum(scales, max(10 * _FLAT * scales[0], _TINY))) @ right
    return thick


def rotation_matrices(quaternions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the matrices (n, 3, 3) of finite quaternions (n, 4), x y z w, made unit length; zeros turn nothing."""
    # Dividing by the largest entry first keeps the squares from overflowing.
    largest = np.abs(quaternions).max(axis=1, keepdims=True)
    unit = np.where(largest > 0.0, quaternions / np.where(largest > 0.0, largest, 1.0), (0.0, 0.0, 0.0, 1.0))
    x, y, z, w = (unit / np.linalg.norm(unit, axis=1, keepdims=True)).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.array(rows).transpose(2, 0, 1)


def rigid(matrix: Matrix) -> Matrix | None:
    """Return `matrix` with orthonormal axes of the same view direction and up; None if those have no length.

    A rotation stays as it is, to the last bit, so that a saved camera gives the same picture.
    """
    axes = matrix[:3, :3]
    if np.abs(axes.T @ axes - np.eye(3)).max() < _RIGID and np.linalg.det(axes) > 0:
        return matrix
    back = matrix[:3, 2]
    right = np.cross(matrix[:3, 1], back)
    if not np.linalg.norm(right) > _FLAT * np.linalg.norm(matrix[:3, 1]) * np.linalg.norm(back):
        return None
    pose = np.eye(4)
    pose[:3, 2] = back / np.linalg.norm(back)
    pose[:3, 0] = right / np.linalg.norm(right)
    pose[:3, 1] = np.cross(pose[:3, 2], pose[:3, 0])
    pose[:3, 3] = matrix[:3, 3]
    return pose
