"""The leaves of the tree of emitters: triangles, or parts of large and textured ones, and the power of each.

A triangle's parts are the cells of a grid over the unit square, or of a binary tree over it where the emission has a
texture (`emitter_cells.py`): v runs along the longer edge of the triangle, u across, and the map from (u, v) preserves
area. So long triangles are cut across, and a shader finds the cell of a hit by the inverse of the map.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .emitter_cells import DEFENSIVE, cell_weights, divide_by_texture, texel_counts
from .emitters import EmittingPart, exitance, opacity_at
from .light_values import emitted_radiance
from .surface_samples import R2

LEAVES = 256  # about as many if nothing is textured and triangles are large: tools/README.md, "Constants"
TEXELS_PER_LEAF = 4  # of an alpha mask
MASKED_LEAVES = 1 << 14  # at most, for the masked triangles of a material in an instance
MAX_HALVINGS = 12  # of a triangle without an emission texture
POINTS = 16  # at which the alpha mask of a leaf is looked up

LEAF = np.dtype(
    [
        ("corner", "f4", 3),  # of the whole triangle, metres relative to the scene's origin
        ("triangle", "u4"),
        ("edge1", "f4", 3),
        ("sides", "u4"),  # as `EmittingPart.sides`
        ("edge2", "f4", 3),
        ("area", "f4"),  # of the leaf, m2
        ("radiance", "f4", 3),  # before textures, W/(m2 sr)
        ("turn", "u4"),  # number of the triangle's corner that `corner` is
        ("cell", "f4", 4),  # low corner and size in the unit square
    ]
)
# An emitting triangle: its slots are `first` + x + y << x_bits for the cells (x, y) of its grid.
TRIANGLE = np.dtype([("triangle", "u4"), ("instance", "u4"), ("first", "u4"), ("grid", "u4")])


@dataclass
class EmitterLeaves:
    """The leaves of all emitters; `power`: luminance times area of each; `triangles`: sorted.

    `slots`: for each cell the number of its leaf, or of a tree over cells as in `Cells`.
    """

    leaves: NDArray[np.void]
    power: NDArray[np.float64]
    triangles: NDArray[np.void]
    slots: NDArray[np.int64]


def divide(parts: list[EmittingPart]) -> EmitterLeaves:
    """Divide emitting triangles into leaves of similar extent, and finer ones where they are textured."""
    extents = [_extents(part) for part in parts]
    # Find the mean luminance of each triangle.
    luminances = []
    for part in parts:
        light = np.full(len(part.triangles), exitance(part.material) / np.pi / (2 if part.sides == 3 else 1))
        if part.material.emission_texture is not None:
            cells = divide_by_texture(part, part.areas())
            light = np.bincount(cells.triangle, cells.importance * cells.share, len(light))
        luminances.append(light)
    whole = sum(float(extent @ light) for extent, light in zip(extents, luminances, strict=True))
    size = sum(float(extent.sum()) for extent in extents)
    made = [EmitterLeaves(np.zeros(0, LEAF), np.zeros(0), np.zeros(0, TRIANGLE), np.zeros(0, np.int64))]
    leaves = slots = 0
    if 0 < whole < np.inf and size < np.inf:
        for part, extent, light in zip(parts, extents, luminances, strict=True):
            # By power and by size alike: bright emitters, and dim ones that are near to something.
            wanted = (0.5 * extent * (light / whole) + 0.5 * extent / size) * LEAVES
            textured = part.material.emission_texture is not None
            made.append((_divide_textured if textured else _divide_part)(part, wanted, light))
            made[-1].triangles["first"] += slots
            of_tree = made[-1].slots < 0
            made[-1].slots = made[-1].slots + np.where(of_tree, -2 * slots, leaves)
            leaves, slots = leaves + len(made[-1].leaves), slots + len(made[-1].slots)
    together = (
        np.concatenate([getattr(of, name) for of in made]) for name in ("leaves", "power", "triangles", "slots")
    )
    found = EmitterLeaves(*together)
    found.triangles = found.triangles[np.lexsort((found.triangles["instance"], found.triangles["triangle"]))]
    return found


def _extents(part: EmittingPart) -> NDArray[np.float64]:
    """Return the areas of triangles; long ones count as squares half as long as they are. 0: degenerate."""
    sides = np.linalg.norm(np.roll(part.corners, -1, 1) - part.corners, axis=2)
    area = part.areas()
    return np.where(area > 0, np.maximum(area, sides.max(1) ** 2 / 4), 0.0)


def _divide_textured(part: EmittingPart, wanted: NDArray[np.float64], light: NDArray[np.float64]) -> EmitterLeaves:
    """Divide the triangles of a part by its emission texture, and into at least about `wanted` leaves each."""
    cells = divide_by_texture(part, part.areas(), wanted)
    leaves = _leaves(part, cells.triangle, cells.box)
    kept = np.flatnonzero(part.areas() > 0)
    triangles = _triangles(part, kept)
    triangles["first"], triangles["grid"] = kept, part.turn[kept] << 16
    return EmitterLeaves(leaves, cells.importance * leaves["area"].astype(np.float64), triangles, cells.slots)


def _divide_part(part: EmittingPart, wanted: NDArray[np.float64], light: NDArray[np.float64]) -> EmitterLeaves:
    """Divide the triangles of a part without emission texture, of luminances `light`, into `wanted` leaves each."""
    # Choose how often to halve each triangle.
    area, masked = part.areas(), part.material.alpha_mode != "opaque"
    halvings = np.ceil(np.log2(np.maximum(wanted, 1.0)))
    if masked and part.material.base_color_texture is not None:
        texels = texel_counts(part, part.material.base_color_texture)
        by_texels = np.ceil(np.log2(np.maximum(texels / TEXELS_PER_LEAF, 1.0)))
        most = np.log2(max(MASKED_LEAVES / max(len(area), 1), 1))
        halvings = np.maximum(halvings, np.minimum(by_texels, np.floor(most)))
    halvings = np.minimum(halvings, MAX_HALVINGS).astype(np.int64)
    # Halve the longer one of the sides at the first corner.
    corners = part.turned_corners()
    lengths = np.maximum(np.linalg.norm(corners[:, 1:] - corners[:, :1], axis=2), 1e-300)
    longer = np.round(np.log2(lengths[:, 1] / lengths[:, 0])).astype(np.int64)
    y_bits = np.clip((halvings + longer + 1) // 2, 0, halvings)
    # Make the leaves.
    kept = np.flatnonzero(area > 0)
    counts = 1 << halvings[kept]
    owner = np.repeat(kept, counts)
    number = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    x_bits = halvings - y_bits
    x, y = number & ((1 << x_bits[owner]) - 1), number >> x_bits[owner]
    scale = np.stack([0.5 ** x_bits[owner], 0.5 ** y_bits[owner]], 1)
    leaves = _leaves(part, owner, np.concatenate([np.stack([x, y], 1) * scale, scale], 1))
    triangles = _triangles(part, kept)
    triangles["first"] = np.cumsum(counts) - counts
    triangles["grid"] = x_bits[kept] | (y_bits[kept] << 8) | (part.turn[kept] << 16)
    # Find their power.
    luminance = light[owner]
    if masked:
        luminance = luminance * _opacities(part, owner, leaves)
        mean = np.bincount(owner, luminance, len(area)) / (1 << halvings)
        luminance = (1 - DEFENSIVE) * luminance + DEFENSIVE * np.maximum(mean, DEFENSIVE * light)[owner]
    power = luminance * leaves["area"].astype(np.float64)
    return EmitterLeaves(leaves, power, triangles, np.arange(len(leaves)))


def _leaves(part: EmittingPart, owner: NDArray[np.int64], box: NDArray[np.float64]) -> NDArray[np.void]:
    """Return the records of leaves: boxes of the unit squares of triangles `owner`."""
    corners = part.turned_corners()
    leaves = np.zeros(len(owner), LEAF)
    leaves["corner"], leaves["cell"] = corners[owner, 0], box
    leaves["edge1"], leaves["edge2"] = ((corners[:, k] - corners[:, 0])[owner] for k in (1, 2))
    leaves["triangle"], leaves["sides"], leaves["turn"] = part.triangles[owner], part.sides, part.turn[owner]
    leaves["radiance"] = emitted_radiance(part.material)
    leaves["area"] = part.areas()[owner] * (box[:, 2] * box[:, 3])
    return leaves


def _triangles(part: EmittingPart, kept: NDArray[np.int64]) -> NDArray[np.void]:
    """Return the records of triangles, still without their cells."""
    triangles = np.zeros(len(kept), TRIANGLE)
    triangles["triangle"], triangles["instance"] = part.triangles[kept], part.instance
    return triangles


def _opacities(part: EmittingPart, owner: NDArray[np.int64], leaves: NDArray[np.void]) -> NDArray[np.float64]:
    """Return the share of POINTS points of each leaf that the alpha mask leaves."""
    cell = leaves["cell"].astype(np.float64)
    points = (0.5 + np.arange(POINTS)[:, None] * R2) % 1.0
    u = (cell[:, None, :2] + points * cell[:, None, 2:]).reshape(-1, 2)
    weights, vertices = part.weights_at(np.repeat(owner, POINTS), cell_weights(u))
    return opacity_at(part, vertices, weights).reshape(-1, POINTS).mean(1)


def cell_corners(leaves: NDArray[np.void]) -> NDArray[np.float64]:
    """Return the corners of leaves, (n, 4, 3) metres."""
    low, size = leaves["cell"][:, :2].astype(np.float64), leaves["cell"][:, 2:].astype(np.float64)
    corners = np.stack([low + size * np.array(at) for at in ((0, 0), (1, 0), (0, 1), (1, 1))], 1)
    weights = cell_weights(np.minimum(corners.reshape(-1, 2), 1.0)).reshape(-1, 4, 3)
    edges = np.stack([leaves["edge1"], leaves["edge2"]], 1).astype(np.float64)
    return leaves["corner"].astype(np.float64)[:, None] + weights[..., 1:] @ edges
