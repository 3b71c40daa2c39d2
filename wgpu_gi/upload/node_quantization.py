"""Quantises the boxes of wide nodes to 8 bits per coordinate: 48 bytes a node instead of 112, boxes rounded outwards.

Ylitie et al. 2017, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs", section 3: a node stores
a frame, and its children's boxes in it. Departures: four children; the frame lies on a grid of 16 bits that spans the
whole tree, so that a ray is transformed to it once (Mahovsky and Wyvill 2006, "Memory-Conserving Bounding Volume
Hierarchies with Coherent Raytracing"), and a frame takes 8 bytes: its origin, and a shift per axis. Codes are exact
integers on the grid: coordinate = origin + (code << shift).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .bvh import LEAF_FLAG
from .wide_bvh import EMPTY, WideBvh

LAST_STEP = 65280  # 255 << 8: fits into 8 bits after the largest shift
LAST_CODE = 255
MAX_SHIFT = 8
# Grid steps added to a box before it is rounded outwards. Shaders decode q * inverse + offset in float32, which errs
# by a few units of 65536 x 2^-24 = 2^-8 steps. 16 units are a safe bound.
PAD = 1 / 16


@dataclass
class QuantizationGrid:
    """Integer coordinates of node boxes, q = (x - low) * scale, 0..65535; `low` and `scale` have 32-bit values."""

    low: NDArray[np.float64]
    scale: NDArray[np.float64]

    @classmethod
    def around(cls, bounds: NDArray) -> QuantizationGrid:
        """Return a grid that spans `bounds` (2, 3) with a margin of about a step on either side."""
        low, high = np.asarray(bounds, np.float64)
        # Give a flat box a thickness of a millionth of its width, and a single point one of float32's resolution.
        step = float(np.spacing(np.abs(bounds).max().astype(np.float32)))
        extent = np.maximum(high - low, max(float((high - low).max()) * 1e-6, step, 1e-30))
        margin = extent / (LAST_STEP - 2)
        rounded = (low - margin).astype(np.float32)
        # Far from zero, rounding to float32 may take more than the margin.
        rounded = np.where(rounded > low - margin / 2, np.nextafter(rounded, np.float32(-np.inf)), rounded)
        grid_low = rounded.astype(np.float64)
        scale = (LAST_STEP - 1) / (low + extent - grid_low)
        return cls(grid_low, scale.astype(np.float32).astype(np.float64))

    def spans(self, bounds: NDArray[np.float64]) -> bool:
        """Tell whether the grid covers `bounds` (2, 3)."""
        steps = (bounds - self.low) * self.scale
        return bool((steps >= PAD).all() and (steps <= LAST_STEP - PAD).all())

    def grown(self, bounds: NDArray[np.float64], growth: float) -> QuantizationGrid:
        """Return the least of the grids around the same centre, each `growth` times as large, that covers `bounds`."""
        extent = LAST_STEP / self.scale
        centre = self.low + extent / 2
        half = np.maximum(extent, extent.max() * 2.0**-8) / 2  # a flat one grows in its thickness, too
        grid = self
        while not grid.spans(bounds):
            half = half * growth
            grid = QuantizationGrid.around(np.stack([centre - half, centre + half]))
        return grid

    def quantize(self, bvh: WideBvh, dtype: np.dtype, first_node: int = 0, first_item: int = 0) -> NDArray[np.void]:
        """Return the nodes of `bvh` as records of `dtype`, with references relative to the buffers.

        `first_node` and `first_item` are where the nodes and the leaves' items will lie.
        """
        exists = bvh.child != EMPTY
        # Absent children have infinite boxes, which give the last step as the lower corner and 0 as the upper one.
        low, high = self._steps(bvh.low, np.floor, -PAD), self._steps(bvh.high, np.ceil, PAD)
        # The node's frame: the lowest corner, and the least shift with which the highest fits into 8 bits.
        origin = np.minimum(np.minimum(low[:, 0], low[:, 1]), np.minimum(low[:, 2], low[:, 3]))
        extent = np.maximum(np.maximum(high[:, 0], high[:, 1]), np.maximum(high[:, 2], high[:, 3])) - origin
        shift = np.zeros_like(extent)
        for s in range(MAX_SHIFT):
            shift += extent + (1 << s) - 1 >> s > LAST_CODE
        low = low - origin[:, None] >> shift[:, None]
        high = high - origin[:, None] + (1 << shift[:, None]) - 1 >> shift[:, None]
        low[~exists], high[~exists] = LAST_CODE, 0
        packed = np.zeros(len(bvh.child), dtype)
        packed["frame"][:, 0] = origin[:, 0] | origin[:, 1] << 16
        packed["frame"][:, 1] = origin[:, 2] | shift[:, 0] << 16 | shift[:, 1] << 20 | shift[:, 2] << 24
        for side, codes in enumerate((low, high)):
            # A byte for each child, axis by axis.
            words = np.ascontiguousarray(codes.transpose(0, 2, 1), np.uint8).view("<u4")[..., 0]
            for axis, name in enumerate("xyz"):
                packed[name][:, side] = words[:, axis]
        moved = np.where(bvh.child >= LEAF_FLAG, np.uint32(first_item), np.uint32(first_node))
        packed["children"] = np.where(exists, bvh.child + moved, EMPTY)
        return packed

    def _steps(self, corners: NDArray[np.float32], rounding: np.ufunc, pad: float) -> NDArray[np.int32]:
        """Return corners (n, 4, 3) in steps of the grid, shifted by `pad` and rounded."""
        steps = corners - self.low
        steps *= self.scale
        steps += pad
        np.clip(rounding(steps, out=steps), 0, LAST_STEP, out=steps)
        return steps.astype(np.int32)
