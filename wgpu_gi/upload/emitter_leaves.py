"""The leaves of the tree of emitters: triangles, or parts of large and textured ones, and the power of each.

A triangle's parts are the cells of a grid over the unit square: v runs along the longer edge of the triangle, u across,
and the map from (u, v) preserves area. So long triangles are cut across, and a shader finds the cell of a hit by the
inverse of the map.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..pictures.color import REC709_LUMINANCE
from .emitters import EmittingPart, exitance, radiance_at
from .light_values import emitted_radiance
from .surface_samples import R2

LEAVES = 256  # about as many if nothing is textured and triangles are large: tools/README.md, "Constants"
TEXELS_PER_LEAF = 4  # of an emission texture or an alpha mask: tools/README.md, "Constants"
TEXTURED_LEAVES = 1 << 14  # at most, for the textured triangles of a material in an instance
MAX_HALVINGS = 12  # of a triangle
POINTS = 16  # at which the emission of a textured leaf is measured
# Share of a textured leaf's power that is its triangle's mean: where the points miss a bright texel, its light is still
# sampled.
DEFENSIVE = 0.1

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
# An emitting triangle: its leaves are `first` + x + y << x_bits for the cells (x, y) of its grid.
TRIANGLE = np.dtype([("triangle", "u4"), ("instance", "u4"), ("first", "u4"), ("grid", "u4")])


@dataclass
class EmitterLeaves:
    """The leaves of all emitters; `power`: luminance times area of each; `triangles`: sorted."""

    leaves: NDArray[np.void]
    power: NDArray[np.float64]
    triangles: NDArray[np.void]


def divide(parts: list[EmittingPart]) -> EmitterLeaves:
    """Divide emitting triangles into leaves of similar extent, and finer ones where they are textured."""
    extents = [_extents(part) for part in parts]
    luminances = [exitance(part.material) / np.pi / (2 if part.sides == 3 else 1) for part in parts]
    whole = sum(float(extent.sum()) * light for extent, light in zip(extents, luminances, strict=True))
    size = sum(float(extent.sum()) for extent in extents)
    found = EmitterLeaves(np.zeros(0, LEAF), np.zeros(0), np.zeros(0, TRIANGLE))
    made = [found]
    first = 0
    if 0 < whole < np.inf and size < np.inf:
        for part, extent, light in zip(parts, extents, luminances, strict=True):
            # By power and by size alike: bright emitters, and dim ones that are near to something.
            share = 0.5 * extent * (light / whole) + 0.5 * extent / size
            made.append(_divide_part(part, share * LEAVES, light, first))
            first += len(made[-1].leaves)
    leaves, power, triangles = (
        np.concatenate([getattr(of, name) for of in made]) for name in ("leaves", "power", "triangles")
    )
    return EmitterLeaves(leaves, power, triangles[np.lexsort((triangles["instance"], triangles["triangle"]))])


def _areas(part: EmittingPart) -> NDArray[np.float64]:
    edges = part.corners[:, 1:] - part.corners[:, :1]
    return np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1) / 2


def _extents(part: EmittingPart) -> NDArray[np.float64]:
    """Return the areas of triangles; long ones count as squares half as long as they are. 0: degenerate."""
    sides = np.linalg.norm(np.roll(part.corners, -1, 1) - part.corners, axis=2)
    area = _areas(part)
    return np.where(area > 0, np.maximum(area, sides.max(1) ** 2 / 4), 0.0)


def _divide_part(part: EmittingPart, wanted: NDArray[np.float64], light: float, first: int) -> EmitterLeaves:
    """Divide the triangles of a part into about `wanted` leaves each.

    `light`: mean luminance. `first`: number of the part's first leaf.
    """
    # Choose how often to halve each triangle.
    area, material = _areas(part), part.material
    textured = material.emission_texture is not None or material.alpha_mode == "mask"
    halvings = np.ceil(np.log2(np.maximum(wanted, 1.0)))
    if textured:
        by_texels = np.ceil(np.log2(np.maximum(_texel_counts(part) / TEXELS_PER_LEAF, 1.0)))
        most = np.log2(max(TEXTURED_LEAVES / max(len(area), 1), 1))
        halvings = np.maximum(halvings, np.minimum(by_texels, np.floor(most)))
    halvings = np.minimum(halvings, MAX_HALVINGS).astype(np.int64)
    # Turn each triangle so that its shortest side begins at the first corner; halve the longer one of both sides.
    sides = np.linalg.norm(np.roll(part.corners, -1, 1) - part.corners, axis=2)
    turn = np.argmin(np.round(sides / np.maximum(sides.max(1, keepdims=True), 1e-300), 6), axis=1)
    rows = np.arange(len(turn))
    corner, second, third = (part.corners[rows, (turn + k) % 3] for k in range(3))
    edges = np.stack([second - corner, third - corner], 1)
    lengths = np.maximum(np.linalg.norm(edges, axis=2), 1e-300)
    longer = np.round(np.log2(lengths[:, 1] / lengths[:, 0])).astype(np.int64)
    y_bits = np.clip((halvings + longer + 1) // 2, 0, halvings)
    # Make the leaves.
    kept = np.flatnonzero(area > 0)
    counts = 1 << halvings[kept]
    owner = np.repeat(kept, counts)
    number = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    x_bits = halvings - y_bits
    x, y = number & ((1 << x_bits[owner]) - 1), number >> x_bits[owner]
    leaves = np.zeros(len(owner), LEAF)
    leaves["corner"], leaves["edge1"], leaves["edge2"] = corner[owner], edges[owner, 0], edges[owner, 1]
    leaves["triangle"], leaves["sides"], leaves["turn"] = part.triangles[owner], part.sides, turn[owner]
    leaves["radiance"], leaves["area"] = emitted_radiance(material), area[owner] / (1 << halvings[owner])
    scale = np.stack([0.5 ** x_bits[owner], 0.5 ** y_bits[owner]], 1)
    leaves["cell"] = np.concatenate([np.stack([x, y], 1) * scale, scale], 1)
    triangles = np.zeros(len(kept), TRIANGLE)
    triangles["triangle"], triangles["instance"] = part.triangles[kept], part.instance
    triangles["first"] = first + np.cumsum(counts) - counts
    triangles["grid"] = x_bits[kept] | (y_bits[kept] << 8) | (turn[kept] << 16)
    # Find their power.
    luminance = np.full(len(owner), light)
    if textured:
        luminance = _luminances(part, owner, leaves)
        mean = np.bincount(owner, luminance, len(area)) / (1 << halvings)
        luminance = (1 - DEFENSIVE) * luminance + DEFENSIVE * np.maximum(mean, DEFENSIVE * light)[owner]
    return EmitterLeaves(leaves, luminance * leaves["area"].astype(np.float64), triangles)


def _texel_counts(part: EmittingPart) -> NDArray[np.float64]:
    """Return the number of texels on each triangle, of its emission texture or its mask's."""
    counts = np.zeros(len(part.triangles))
    masks = [part.material.base_color_texture] if part.material.alpha_mode == "mask" else []
    for texture in (part.material.emission_texture, *masks):
        if texture is None:
            continue
        texcoords = part.mesh.texcoords1 if texture.texcoord else part.mesh.texcoords0
        if texcoords is None:
            continue
        height, width = texture.image.pixels.shape[:2]
        corners = np.asarray(texcoords, np.float64)[part.vertices]
        (a, b), (c, d) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
        scale = abs(float(texture.scale[0]) * float(texture.scale[1]))
        counts = np.maximum(counts, np.abs(a * d - b * c) / 2 * scale * height * width)
    return np.nan_to_num(counts, posinf=1e18)


def _luminances(part: EmittingPart, owner: NDArray[np.int64], leaves: NDArray[np.void]) -> NDArray[np.float64]:
    """Return the mean luminance of leaves over POINTS points of each."""
    cell = leaves["cell"].astype(np.float64)
    points = (0.5 + np.arange(POINTS)[:, None] * R2) % 1.0
    u = (cell[:, None, :2] + points * cell[:, None, 2:]).reshape(-1, 2)
    # Weights of the triangle's own corners.
    turn = np.repeat(leaves["turn"].astype(np.int64), POINTS)
    turned = cell_weights(u)
    weights = np.stack([turned[np.arange(len(turn)), (k - turn) % 3] for k in range(3)], 1)
    vertices = part.vertices[np.repeat(owner, POINTS)]
    return (radiance_at(part, vertices, weights) @ REC709_LUMINANCE).reshape(-1, POINTS).mean(1)


def cell_weights(u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return barycentric weights (n, 3), uniform by area, as `emitter_weights` of deferred/emitters/table.wgsl."""
    along = 1 - np.sqrt(1 - u[:, 1])
    across = u[:, 0] * (1 - along)
    return np.stack([1 - across - along, across, along], 1)


def cell_corners(leaves: NDArray[np.void]) -> NDArray[np.float64]:
    """Return the corners of leaves, (n, 4, 3) metres."""
    low, size = leaves["cell"][:, :2].astype(np.float64), leaves["cell"][:, 2:].astype(np.float64)
    corners = np.stack([low + size * np.array(at) for at in ((0, 0), (1, 0), (0, 1), (1, 1))], 1)
    weights = cell_weights(np.minimum(corners.reshape(-1, 2), 1.0)).reshape(-1, 4, 3)
    edges = np.stack([leaves["edge1"], leaves["edge2"]], 1).astype(np.float64)
    return leaves["corner"].astype(np.float64)[:, None] + weights[..., 1:] @ edges
