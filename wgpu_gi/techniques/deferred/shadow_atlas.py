"""Layout of one square depth texture shared by all shadow maps: the size and place of each.

Sides are powers of two, so maps placed along a Z-order curve, the largest first, fill the square without gaps or
overlaps (Morton 1966). A map of half height takes half of a square.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...errors import GiError
from ...webgpu_limits import MAX_TEXTURE_SIDE

SMALLEST = 16  # least side of a map, texels; maps of half height have half as many rows


def fit_sides(
    sides: NDArray[np.int64], weights: NDArray[np.float64], shares: NDArray[np.float64], atlas: int
) -> NDArray[np.int64]:
    """Return the sides of the lights' maps, (n,), halved until all of them fit into `atlas` x `atlas` texels.

    A light's maps take `weights` times its side squared. The light with the most texels per share of importance is
    halved first, down to SMALLEST at least; if that does not suffice, the atlas grows. Raises GiError if it cannot.
    """
    least = float(weights.sum()) * SMALLEST**2
    if least > MAX_TEXTURE_SIDE**2:
        raise GiError(
            f"the shadow maps of {len(sides)} lights do not fit into {MAX_TEXTURE_SIDE} x {MAX_TEXTURE_SIDE} texels;"
            " use fewer lights or samples of emitters"
        )
    excess = float((weights * sides**2.0).sum()) - max(float(atlas) ** 2, least)
    if excess <= 0:
        return sides
    # List all possible halvings, and the texels that each frees.
    possible = np.log2(sides / SMALLEST).round().astype(np.int64)
    light = np.repeat(np.arange(len(sides)), possible)
    step = np.arange(len(light)) - np.repeat(np.cumsum(possible) - possible, possible)
    texels = weights[light] * (sides[light] / 2.0**step) ** 2
    order = np.argsort(-texels / shares[light], kind="stable")
    freed = np.cumsum(0.75 * texels[order])
    taken = order[: int(np.searchsorted(freed, excess)) + 1]
    return sides >> np.bincount(light[taken], minlength=len(sides))


def place(widths: NDArray[np.int64], heights: NDArray[np.int64]) -> tuple[NDArray[np.int64], int]:
    """Return the corners (n, 2) of maps, and the side of the square that holds them.

    Widths are powers of two; a height equals the width or half of it.
    """
    area = widths * heights
    order = np.argsort(-area, kind="stable")
    end = np.cumsum(area[order])
    # Every area is a multiple of the next, so each map begins at a multiple of its own area.
    code = np.empty_like(area)
    code[order] = end - area[order]
    corners = np.zeros((len(area), 2), np.int64)
    for bit in range(MAX_TEXTURE_SIDE.bit_length()):
        corners[:, 0] |= (code >> (2 * bit) & 1) << bit
        corners[:, 1] |= (code >> (2 * bit + 1) & 1) << bit
    side = SMALLEST
    while len(area) and side**2 < end[-1]:
        side *= 2
    return corners, side
