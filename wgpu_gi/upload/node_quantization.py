"""Quantises the boxes of BVH nodes to 16 bits per coordinate: 32 bytes a node instead of 56, boxes rounded outwards.

Mahovsky and Wyvill 2006, "Memory-Conserving Bounding Volume Hierarchies with Coherent Raytracing". Departure: the grid
spans the whole tree, not the parent's box, so that no traversal state is needed to decode a node.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .bvh import LEAF_FLAG

LAST_STEP = 65535
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

    def quantize(
        self, nodes: NDArray[np.void], dtype: np.dtype, first_node: int = 0, first_item: int = 0
    ) -> NDArray[np.void]:
        """Return `nodes` as records of `dtype`, with boxes rounded outwards and references relative to the buffers.

        `first_node` and `first_item` are where the nodes and the leaves' items will lie.
        """
        packed = np.zeros(len(nodes), dtype)
        lows = [np.floor((nodes[k] - self.low) * self.scale - PAD) for k in ("low0", "low1")]
        highs = [np.ceil((nodes[k] - self.low) * self.scale + PAD) for k in ("high0", "high1")]
        for name, (child0, child1) in (("low", lows), ("high", highs)):
            steps = [np.clip(c, 0, LAST_STEP).astype(np.uint32) for c in (child0, child1)]
            packed[name] = steps[0] | steps[1] << 16
        for name in ("child0", "child1"):
            child = nodes[name]
            packed[name] = (child + np.where(child >= LEAF_FLAG, first_item, first_node)).astype(np.uint32)
        return packed
