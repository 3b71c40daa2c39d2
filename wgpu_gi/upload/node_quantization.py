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

    def quantize(self, bvh: WideBvh, dtype: np.dtype, first_node: int = 0, first_item: int = 0) -> NDArray[np.void]:
        """Return the nodes of `bvh` as records of `dtype`, with references relative to the buffers.

        `first_node` and `first_item` are where the nodes and the leaves' items will lie.
        """
        exists = (bvh.child != EMPTY)[..., None]
        steps = [np.floor((bvh.low - self.low) * self.scale - PAD), np.ceil((bvh.high - self.low) * self.scale + PAD)]
        low, high = (np.clip(c, 0, LAST_STEP).astype(np.int64) for c in steps)
        # The node's frame: the lowest corner, and the least shift with which the highest fits into 8 bits.
        origin = np.where(exists, low, LAST_STEP).min(1)
        extent = np.where(exists, high, 0).max(1) - origin
        shift = sum(((extent + (1 << s) - 1 >> s) > LAST_CODE).astype(np.int64) for s in range(MAX_SHIFT))
        low = np.where(exists, low - origin[:, None] >> shift[:, None], LAST_CODE)
        high = np.where(exists, high - origin[:, None] + (1 << shift[:, None]) - 1 >> shift[:, None], 0)
        packed = np.zeros(len(bvh.child), dtype)
        packed["frame"][:, 0] = origin[:, 0] | origin[:, 1] << 16
        packed["frame"][:, 1] = origin[:, 2] | (shift << [16, 20, 24]).sum(1)
        for axis, name in enumerate("xyz"):
            for side, codes in enumerate((low, high)):
                packed[name][:, side] = (codes[:, :, axis] << [0, 8, 16, 24]).sum(1)
        moved = np.where(bvh.child >= LEAF_FLAG, np.uint32(first_item), np.uint32(first_node))
        packed["children"] = np.where(exists[..., 0], bvh.child + moved, EMPTY)
        return packed
