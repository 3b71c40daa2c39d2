"""The 16-bit grid on which the GPU has the boxes of a hierarchy's nodes, half the bytes of floats."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .bvh import LEAF_FLAG

LAST_STEP = 65535
# Grid steps that a box grows by before it is rounded outwards: above the rounding of q * inverse + offset, which is a
# few times 2^-24 of 65536 steps (counted, not measured).
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
        # A flat box gets a thickness, far below what can be seen of it; a single point, what float32 can tell apart.
        step = float(np.spacing(np.abs(bounds).max().astype(np.float32)))
        extent = np.maximum(high - low, max(float((high - low).max()) * 1e-6, step, 1e-30))
        margin = extent / (LAST_STEP - 2)
        rounded = (low - margin).astype(np.float32)
        # Far from zero, rounding may take more than the margin.
        rounded = np.where(rounded > low - margin / 2, np.nextafter(rounded, np.float32(-np.inf)), rounded)
        grid_low = rounded.astype(np.float64)
        scale = (LAST_STEP - 1) / (low + extent - grid_low)
        return cls(grid_low, scale.astype(np.float32).astype(np.float64))

    def spans(self, bounds: NDArray[np.float64]) -> bool:
        """Return whether `bounds` (2, 3) lie on the grid."""
        steps = (bounds - self.low) * self.scale
        return bool((steps >= PAD).all() and (steps <= LAST_STEP - PAD).all())

    def quantize(
        self, nodes: NDArray[np.void], dtype: np.dtype, first_node: int = 0, first_item: int = 0
    ) -> NDArray[np.void]:
        """Return `nodes` with boxes rounded outwards to the grid and references moved to where they will lie."""
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
