"""The frames in which trees are built, and how finely Morton codes resolve them.

A tree's frame is its mesh's space scaled by a power of two, so that the largest coordinate is about 1: areas neither
overflow nor vanish, and the tree of a scaled mesh is the same.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..gpu.wgsl.load import load

CELL_BITS = 20  # of a Morton code, per axis


@dataclass
class Frames:
    """The frames of trees: lower corners in their units (t, 3), units in a metre (t,), and extents in units (t,)."""

    low: NDArray[np.float64]
    scale: NDArray[np.float64]
    extent: NDArray[np.float64]

    def records(self) -> NDArray[np.void]:
        """Return them as `Frame` of triangles.wgsl."""
        records = np.zeros(len(self.scale), load("scene/hierarchy/triangles.wgsl").struct_dtype("Frame"))
        records["low"], records["scale"] = self.low, self.scale
        records["cells"] = np.minimum(2.0**CELL_BITS / np.maximum(self.extent, 1e-30), 1e30)
        return records


def frames_of(positions: NDArray[np.float32], starts: NDArray[np.int64]) -> Frames:
    """Return the frames of meshes whose vertices begin at `starts`."""
    low = np.minimum.reduceat(positions, starts).astype(np.float64)
    high = np.maximum.reduceat(positions, starts).astype(np.float64)
    largest = np.maximum(np.abs(low), np.abs(high)).max(1)
    scale = np.exp2(-np.clip(np.frexp(largest)[1], -100, 100).astype(np.float64))
    return Frames(low * scale[:, None], scale, (high - low).max(1) * scale)


def needed_bits(
    positions: NDArray[np.float32], triangles: NDArray[np.uint32], trees: NDArray[np.int64], frames: Frames
) -> int:
    """Return how many bits per axis tell triangles apart: cells of a quarter of the small ones' size."""
    chosen = slice(None, None, max(len(triangles) // 4096, 1))
    corners = positions[triangles[chosen]].astype(np.float64)
    # The middle one of a box's three sides: needles lie close together, and the box of a triangle may be flat.
    size = np.sort(np.ptp(corners, axis=1), axis=1)[:, 1] * frames.scale[trees[chosen]]
    ratio = frames.extent[trees[chosen]][size > 0] / size[size > 0]
    if not len(ratio):
        return 1
    return int(np.clip(np.ceil(np.log2(np.quantile(ratio, 0.9))) + 2, 1, CELL_BITS))
