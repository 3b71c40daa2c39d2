"""The box of a whole object in the picture, by its projected vertices, in float64."""

from __future__ import annotations

import numpy as np

from ..camera import Camera
from ..scene.deformation import posed_positions
from ..scene.scene import Instance
from .frame_data import Box
from .rays import project


def projected_box(instance: Instance, camera: Camera, size: tuple[int, int]) -> Box | None:
    """Return the box of an instance in its pose, which may reach beyond the picture; cut-out parts count.

    None if the instance reaches the camera's plane or behind it: the box then has no bounds.
    """
    triangles = instance.mesh.triangles
    used = np.zeros(len(instance.mesh.positions), bool)
    used[triangles.ravel()] = True
    matrix = np.asarray(instance.world_from_local, np.float64)
    places, depth = project(camera, size, posed_positions(instance)[used] @ matrix[:3, :3].T + matrix[:3, 3])
    if not len(depth) or depth.min() <= 0:
        return None
    x, y = places.min(0).tolist()
    right, bottom = places.max(0).tolist()
    return x, y, right - x, bottom - y
