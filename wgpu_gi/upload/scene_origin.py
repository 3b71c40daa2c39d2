"""The origin that positions on the GPU are relative to: where the scene has its details.

Float32 coordinates are finest at the origin. The centre of the bounding box is right for most scenes, but a town beside
the middle of a ground of 1e6 m would get coordinates in steps of 0.03 m. There, the origin is the median of the
triangles' corners.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .mesh_data import MeshData

SAMPLES = 4096  # corners that stand for all
# Half of the corners lie within this share of the scene's radius of their median: then float32 steps at the details are
# at least 64 times as fine as at the edges of the scene.
DETAIL = 1 / 64


def scene_origin(
    meshes: list[MeshData], matrices: NDArray[np.float64], bounds: NDArray[np.float64]
) -> tuple[NDArray[np.float64], bool]:
    """Return the origin (3,) of instances of `meshes` at `matrices` (n, 4, 4), and whether details lie around it.

    `bounds` (2, 3) are those of all instances in the world.
    """
    centre: NDArray[np.float64] = bounds.mean(0)
    if not meshes:
        return centre, False
    # Take some corners of each instance, weighted by the number of its triangles.
    each = -(-SAMPLES // len(meshes))
    points, weights = [], []
    for data, matrix in zip(meshes, matrices, strict=True):
        corners = data.corners.reshape(-1, 3)
        chosen = corners[:: -(-len(corners) // each)].astype(np.float64)
        points.append(chosen @ matrix[:3, :3].T + matrix[:3, 3])
        weights.append(np.full(len(chosen), len(corners) / len(chosen)))
    all_points, all_weights = np.concatenate(points), np.concatenate(weights)
    median = np.array([_median(all_points[:, axis], all_weights) for axis in range(3)])
    spread = _median(np.abs(all_points - median).max(1), all_weights)
    has_details = bool(spread < DETAIL * np.linalg.norm(bounds[1] - bounds[0]) / 2)
    return (median if has_details else centre), has_details


def _median(values: NDArray[np.float64], weights: NDArray[np.float64]) -> float:
    order = np.argsort(values, kind="stable")
    sums = np.cumsum(weights[order])
    return float(values[order[np.searchsorted(sums, sums[-1] / 2)]])
