"""The motion of each instance since the last frame, for motion vectors."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..scene.scene import Instance


class InstanceMotion:
    """Remembers the transform of each instance at the last call."""

    def __init__(self) -> None:
        self._instances: list[Instance] = []
        self._matrices = np.zeros((0, 4, 4))

    def update(self, instances: list[Instance], origin: NDArray[np.float64]) -> NDArray[np.float32]:
        """Return for each instance the transform from current positions to those at the last call.

        The result (n, 4, 4) holds columns of 16 bytes, as WGSL's mat4x3f; points are relative to `origin`. A new
        instance has not moved. Without instances there is one identity.
        """
        now = np.array([i.world_from_local for i in instances], np.float64).reshape(-1, 4, 4)
        if instances == self._instances:
            before = self._matrices
        else:
            known = {id(i): matrix for i, matrix in zip(self._instances, self._matrices, strict=True)}
            before = np.array([known.get(id(i), m) for i, m in zip(instances, now, strict=True)]).reshape(-1, 4, 4)
        self._instances, self._matrices = list(instances), now
        change = np.tile(np.eye(4), (max(len(now), 1), 1, 1))
        # Instances at rest keep the exact identity: an inverse would add its rounding.
        moved = np.flatnonzero((before != now).any((1, 2)))
        if len(moved):
            to_origin, from_origin = np.eye(4), np.eye(4)
            to_origin[:3, 3], from_origin[:3, 3] = -origin, origin
            change[moved] = to_origin @ before[moved] @ np.linalg.inv(now[moved]) @ from_origin
        columns = np.zeros((len(change), 4, 4), np.float32)
        columns[..., :3] = change[:, :3].transpose(0, 2, 1)
        return columns
