"""Means of a texture over boxes of texels, in a time that does not depend on their size.

A summed-area table (Crow 1984, "Summed-Area Tables for Texture Mapping") of linear colours and squared luminances.
Departure: sums are integers, so the mean of a black box is exactly zero; tables of large textures hold blocks of
texels, and boxes grow to whole blocks.
"""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from ..pictures.color import LINEAR_OF_CODE, REC709_LUMINANCE
from ..scene.scene import Image, Texture, Wrap
from ..webgpu_limits import MAX_TEXTURE_SIDE
from .texture_sampling import FARTHEST

MAX_BLOCKS = 1024  # on a side: the table of a picture has at most 32 MiB
UNIT = 1 << 24  # of linear colour; the darkest code, 1 / 255 / 12.92, is 5,093 of them
SLACK = 1e-3  # texels, and SLACK_RELATIVE of the coordinate: cover the rounding of float32 coordinates in shaders
SLACK_RELATIVE = 4e-7

_TABLES: WeakKeyDictionary[Image, tuple[NDArray[np.float64], int]] = WeakKeyDictionary()  # images are immutable


class TextureSums:
    """Means of a texture over boxes in its own coordinates, after its transform."""

    def __init__(self, texture: Texture) -> None:
        if texture.image not in _TABLES:
            _TABLES[texture.image] = _summed_area_table(texture.image.eight_bit)
        self._table, self._block = _TABLES[texture.image]
        self._texture = texture
        height, width = texture.image.pixels.shape[:2]
        self.size = np.array([width, height])

    def means(self, low: NDArray[np.float64], high: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the means (n, 4) of the linear colour and of its squared luminance over boxes from `low` to `high`.

        Corners (n, 2) are texture coordinates. A box holds all texels that its points are sampled from.
        """
        # Find the texels of the boxes: bilinear sampling reads half a texel further.
        nearest = self._texture.filter == "nearest"
        reach = 0.0 if nearest else 0.5
        if self.size.max() > MAX_TEXTURE_SIDE:
            # Of a picture that was scaled down: half a texel of averages, and half of interpolation.
            reach = float(self.size.max()) / MAX_TEXTURE_SIDE
        ends = []
        for corner, sign in ((low, -1.0), (high, 1.0)):
            texel = np.clip(corner * self.size, -FARTHEST, FARTHEST)
            ends.append(np.floor(texel + sign * (reach + SLACK + SLACK_RELATIVE * np.abs(texel))).astype(np.int64))
        # Combine the prefix sums of both axes.
        terms, lengths = [], []
        for axis, wrap in enumerate((self._texture.wrap_u, self._texture.wrap_v)):
            size = int(self.size[axis])
            first, start = self._prefix(ends[0][:, axis], size, wrap, up=False)
            last, end = self._prefix(ends[1][:, axis] + 1, size, wrap, up=True)
            terms.append(last + [(-factor, index) for factor, index in first])
            lengths.append(end - start)
        total = np.zeros((len(low), 4))
        for across, column in terms[0]:
            for down, row in terms[1]:
                total += (across * down)[:, None] * self._table[row, column]
        return np.maximum(total / (lengths[0] * lengths[1] * np.array([[UNIT], [UNIT], [UNIT], [1]])).T, 0.0)

    def _prefix(
        self, at: NDArray[np.int64], size: int, wrap: Wrap, up: bool
    ) -> tuple[list[tuple[NDArray[np.float64], NDArray[np.int64]]], NDArray[np.int64]]:
        """Return the sum of all texels before `at` along an axis, and `at` rounded to the end of a block.

        The sum is given as factors of columns or rows of the table; `up` rounds away from the origin.
        """
        count = -(-size // self._block)
        whole = np.full(len(at), count)

        def blocks(texel: NDArray[np.int64], up: NDArray[np.bool_]) -> NDArray[np.int64]:
            return np.where(up, -(-texel // self._block), texel // self._block)

        if wrap == "clamp":
            inside = np.clip(at, 0, size)
            index = blocks(inside, np.full(len(at), up))
            over = (at - inside).astype(np.float64)
            edge = np.where(over < 0, 0, count - 1)
            # Beyond the edge its block repeats.
            wide = np.minimum((edge + 1) * self._block, size) - edge * self._block
            terms = [(np.ones(len(at)), index), (over / wide, edge + 1), (-over / wide, edge)]
            return terms, np.minimum(index * self._block, size) + (at - inside)
        period = size if wrap == "repeat" else 2 * size
        turns, rest = at // period, at % period
        # The second half of a mirrored period runs backwards.
        back = rest > size
        index = blocks(np.where(back, period - rest, rest), back ^ up)
        place = np.minimum(index * self._block, size)
        wholes = turns if wrap == "repeat" else 2 * turns + 2 * back
        terms = [(wholes.astype(np.float64), whole), (np.where(back, -1.0, 1.0), index)]
        return terms, wholes * size + np.where(back, -place, place)


def _summed_area_table(pixels: NDArray[np.uint8]) -> tuple[NDArray[np.float64], int]:
    """Return the sums (rows + 1, columns + 1, 4) of all blocks above and to the left, and texels on a block's side."""
    height, width = pixels.shape[:2]
    block = -(-max(height, width) // MAX_BLOCKS)
    linear = np.round(LINEAR_OF_CODE * UNIT)
    of_squares = REC709_LUMINANCE / UNIT
    columns = np.arange(0, width, block)
    sums = np.zeros((-(-height // block) + 1, len(columns) + 1, 4))
    for row in range(1, len(sums)):
        colors = linear[pixels[(row - 1) * block : row * block, :, :3]]
        squares = (colors @ of_squares) ** 2
        of_block = np.concatenate([colors.sum(0), squares.sum(0)[:, None]], 1)
        sums[row, 1:] = of_block if block == 1 else np.add.reduceat(of_block, columns, axis=0)
    return sums.cumsum(0).cumsum(1), block
