"""The cells of textured emitters: finer where the texture is bright and uneven, each with the mean of its light.

A triangle's cells divide the unit square, which `cell_weights` maps to the triangle by area. A binary tree halves the
square where halving lowers the variance of uniform samples of a cell, as Lafortune and Willems 1995 ("A 5D Tree to
Reduce the Variance of Monte Carlo Ray Tracing") divide by contribution. No lamp of few texels is missed: cells are
judged by sums over all their texels, not by points.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from ..pictures.color import REC709_LUMINANCE
from ..scene.mesh_check import are_same, arrays_of
from ..scene.scene import Mesh, Texture
from .emitters import EmittingPart, opacity_at, radiance_at
from .light_values import emission_key, emitted_radiance
from .surface_samples import R2
from .texture_sampling import texture_coordinates
from .texture_sums import TextureSums

MOST_CELLS = 1 << 14  # of a material in an instance, beyond one of each triangle: 1.3 MB of records
TEXELS_PER_CELL = 0.5  # cells of fewer texels stay whole: tools/README.md, "Constants"
LEAST_ERROR = 2.0**-13  # of all power: cells with a smaller standard deviation stay whole
MAX_BITS = 15  # halvings along each side
POINTS = 32  # at which the emission of small cells is measured, and the opacity of all
SMALL = 64  # texels; of larger cells, means over boxes are the more exact
SUBCELLS = 4  # along each side of a larger cell, whose boxes together fit it more closely
# Share of a cell's power that is the mean over its box or without its mask: where the points miss light, it is still
# sampled.
DEFENSIVE = 0.1

KEPT = 16  # divisions of a mesh that are kept, for its materials and instances

# The arrays of a mesh, without positions, and its divisions.
_KNOWN: WeakKeyDictionary[Mesh, tuple[tuple[Any, ...], dict[tuple[Hashable, ...], Cells]]] = WeakKeyDictionary()


@dataclass
class Cells:
    """Cells of the triangles of a part: number `x` of 2^`x_bits` columns and `y` of 2^`y_bits` rows of a unit square.

    `triangle`: its row in the part, ascending. `radiance` (n, 3): mean over a cell, W/(m2 sr). `importance`: luminance
    to sample the cell by; 0 only where nothing is emitted. `slots`: a binary tree over the cells of each triangle; its
    root is the slot with the triangle's row. A slot holds the number of a cell, or -1 - (2 c + axis) where cells c and
    c + 1 are its halves along an axis.
    """

    triangle: NDArray[np.int64]
    x: NDArray[np.int64]
    y: NDArray[np.int64]
    x_bits: NDArray[np.int64]
    y_bits: NDArray[np.int64]
    radiance: NDArray[np.float64]
    importance: NDArray[np.float64]
    slots: NDArray[np.int64]

    @property
    def share(self) -> NDArray[np.float64]:
        """The cells' shares of the areas of their triangles."""
        return np.ldexp(1.0, -(self.x_bits + self.y_bits))

    @property
    def box(self) -> NDArray[np.float64]:
        """The cells' low corners and sizes, (n, 4)."""
        return _boxes(np.stack([self.x, self.y, self.x_bits, self.y_bits], 1))


def divide_by_texture(
    part: EmittingPart, areas: NDArray[np.float64], wanted: NDArray[np.float64] | None = None
) -> Cells:
    """Divide the triangles of a part with an emission texture into cells.

    `areas`: of the triangles, m2; those without get no cells. `wanted`: cells of each triangle, at least, where it
    shines. Cells are kept while the mesh lives and has the same attributes, since an emitter that moves rigidly keeps
    them.
    """
    wanted = np.ones(len(areas)) if wanted is None else wanted
    relative = np.log2(np.maximum(areas, 1e-300) / max(float(areas.max(initial=0.0)), 1e-300))
    arrays = (part.vertices, part.turn, np.ceil(np.log2(np.maximum(wanted, 1.0))), np.round(relative * 64))
    key = (emission_key(part.material), *(array.tobytes() for array in arrays))
    attributes = arrays_of(part.mesh)[1:]
    if part.mesh not in _KNOWN or not are_same(_KNOWN[part.mesh][0], attributes):
        _KNOWN[part.mesh] = (attributes, {})
    known = _KNOWN[part.mesh][1]
    if key not in known:
        while len(known) >= KEPT:
            known.pop(next(iter(known)))
        known[key] = _divide(part, areas, wanted)
    return known[key]


def _divide(part: EmittingPart, areas: NDArray[np.float64], wanted: NDArray[np.float64]) -> Cells:
    """Return what `divide_by_texture` keeps."""
    texture = part.material.emission_texture
    assert texture is not None
    sums = TextureSums(texture)
    color = emitted_radiance(part.material)
    # Begin with one cell for each triangle: x, y and their bits.
    owner = np.flatnonzero(areas > 0)
    grid = np.zeros((len(owner), 4), np.int64)
    slot = owner
    slots = np.zeros(len(areas), np.int64)
    done = [(owner[:0], slot[:0], grid[:0])]  # without triangles that have an area, there are no cells
    count, total = 0, 0.0
    texels_of = texel_counts(part, texture)
    turned = part.turned_corners()
    sides = np.linalg.norm(turned[:, 1:] - turned[:, :1], axis=2)
    while len(owner):
        # Find their light, and the standard deviation of uniform samples.
        corners = _texel_corners(part, owner, _boxes(grid))
        means = sums.means(corners.min(1) / sums.size, corners.max(1) / sums.size)
        bits = grid[:, 2:].sum(1)
        power = areas[owner] * 0.5**bits * (means[:, :3] @ (color * REC709_LUMINANCE))
        deviation = np.sqrt(np.maximum(means[:, 3] / np.maximum((means[:, :3] @ REC709_LUMINANCE) ** 2, 1e-300) - 1, 0))
        total = total or float(power.sum())
        # Halve those where it matters most.
        error = np.where(texels_of[owner] * 0.5**bits > TEXELS_PER_CELL, power * deviation, 0.0)
        large = bits < np.log2(np.maximum(wanted[owner], 1.0))
        error = np.where(large, power, error)
        # Halve the longer side: in metres where the cell is large, else in texels.
        lengths = np.linalg.norm(np.diff(corners[:, [[0, 1], [2, 3], [0, 2], [1, 3]]], axis=2)[:, :, 0], axis=2)
        lengths = np.where(large[:, None], sides[owner] * 0.5 ** grid[:, 2:], lengths.reshape(-1, 2, 2).max(2))
        axis = np.where(lengths[:, 0] > lengths[:, 1], 0, 1)
        axis = np.where(grid[np.arange(len(grid)), 2 + axis] >= MAX_BITS, 1 - axis, axis)
        splits = (error > LEAST_ERROR * total) & (bits < 2 * MAX_BITS)
        most = MOST_CELLS - count
        if np.count_nonzero(splits) > most:
            splits &= np.argsort(np.argsort(-error, kind="stable"), kind="stable") < most
        count += int(np.count_nonzero(splits))
        done.append((owner[~splits], slot[~splits], grid[~splits]))
        # Make the halves.
        parents, axis = grid[splits], axis[splits]
        rows = np.arange(len(parents))
        parents[rows, 2 + axis] += 1
        parents[rows, axis] *= 2
        halves = np.stack([parents, parents], 1)
        halves[rows, 1, axis] += 1
        child = len(slots) + 2 * rows
        slots[slot[splits]] = -1 - (2 * child + axis)
        slots = np.concatenate([slots, np.zeros(2 * len(rows), np.int64)])
        owner, grid = np.repeat(owner[splits], 2), halves.reshape(-1, 4)
        slot = np.stack([child, child + 1], 1).ravel()
    # Order the cells by triangle, and enter them into the tree.
    owner, slot, grid = (np.concatenate([of[k] for of in done]) for k in range(3))
    order = np.argsort(owner, kind="stable")
    owner, grid = owner[order], grid[order]
    slots[slot[order]] = np.arange(len(order))
    radiance, importance = _measure(part, sums, owner, _boxes(grid), texels_of[owner] * 0.5 ** grid[:, 2:].sum(1))
    x, y, x_bits, y_bits = grid.T
    return Cells(owner, x, y, x_bits, y_bits, radiance, importance, slots)


def _measure(
    part: EmittingPart,
    sums: TextureSums,
    owner: NDArray[np.int64],
    boxes: NDArray[np.float64],
    texels: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the mean radiance (n, 3) of cells of `texels` each, and the luminance to sample them by."""
    color = emitted_radiance(part.material)
    # Means over the boxes of parts of each cell.
    at = np.stack(np.meshgrid(*[np.arange(SUBCELLS) / SUBCELLS] * 2), -1).reshape(-1, 2)
    parts = np.concatenate(
        [boxes[:, None, :2] + at * boxes[:, None, 2:], np.repeat(boxes[:, None, 2:] / SUBCELLS, len(at), 1)], 2
    )
    corners = _texel_corners(part, np.repeat(owner, len(at)), parts.reshape(-1, 4)) / sums.size
    radiance = sums.means(corners.min(1), corners.max(1))[:, :3].reshape(len(owner), len(at), 3).mean(1) * color
    importance = DEFENSIVE * (radiance @ REC709_LUMINANCE)
    # Means over points of small cells.
    points = (0.5 + np.arange(POINTS)[:, None] * R2) % 1.0
    small = np.flatnonzero((texels < SMALL) & radiance.any(1))
    where = (boxes[small, None, :2] + points * boxes[small, None, 2:]).reshape(-1, 2)
    weights, vertices = part.weights_at(np.repeat(owner[small], POINTS), cell_weights(where))
    radiance[small] = radiance_at(part, vertices, weights).reshape(-1, POINTS, 3).mean(1)
    # The share of points that the mask leaves.
    if part.material.alpha_mode != "opaque":
        where = (boxes[:, None, :2] + points * boxes[:, None, 2:]).reshape(-1, 2)
        weights, vertices = part.weights_at(np.repeat(owner, POINTS), cell_weights(where))
        radiance *= opacity_at(part, vertices, weights).reshape(-1, POINTS, 1).mean(1)
    return radiance, importance + (1 - DEFENSIVE) * (radiance @ REC709_LUMINANCE)


def texel_counts(part: EmittingPart, texture: Texture) -> NDArray[np.float64]:
    """Return the number of texels of a texture on each triangle."""
    uv = [texture_coordinates(texture, part.mesh, part.vertices, np.eye(3)[[k] * len(part.vertices)]) for k in range(3)]
    (a, b), (c, d) = (uv[1] - uv[0]).T, (uv[2] - uv[0]).T
    height, width = texture.image.pixels.shape[:2]
    return np.nan_to_num(np.abs(a * d - b * c) / 2 * height * width, posinf=1e18)


def _boxes(grid: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return low corners and sizes of cells (x, y, bits of x, bits of y)."""
    size = 0.5 ** grid[:, 2:]
    return np.concatenate([grid[:, :2] * size, size], 1)


def _texel_corners(part: EmittingPart, owner: NDArray[np.int64], boxes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the corners of cells in texels, (n, 4, 2): (0, 0), (1, 0), (0, 1), (1, 1) of each box."""
    texture = part.material.emission_texture
    assert texture is not None
    corners = np.stack([boxes[:, :2] + boxes[:, 2:] * np.array(at) for at in ((0, 0), (1, 0), (0, 1), (1, 1))], 1)
    weights, vertices = part.weights_at(np.repeat(owner, 4), cell_weights(corners.reshape(-1, 2)))
    height, width = texture.image.pixels.shape[:2]
    return (texture_coordinates(texture, part.mesh, vertices, weights) * (width, height)).reshape(-1, 4, 2)


def cell_weights(u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return barycentric weights (n, 3), uniform by area, as `emitter_weights` of scene/emission.wgsl."""
    along = 1 - np.sqrt(1 - u[:, 1])
    across = u[:, 0] * (1 - along)
    return np.stack([1 - across - along, across, along], 1)
