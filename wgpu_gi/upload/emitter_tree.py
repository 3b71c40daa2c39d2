"""A binary tree over all emitters, from which shaders draw a point of an emitter by the light that it may send.

Conty and Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree Splitting": nodes bound the positions, the
normals and the power of their emitters. Departures: a leaf is a triangle or a part of one, so that large and textured
emitters are sampled where they are near or bright; the tree halves the Morton order of the leaves instead of
minimising a cost, so it is an array without child references.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..scene.scene import Scene
from .emitter_leaves import cell_corners, divide
from .emitters import emitting_parts
from .two_level_bvh import TwoLevelBvh

CONE_SLACK = 2e-3  # radians; normals are stored with 16 bits a coordinate, 1e-4 radians
RADIUS_SLACK = 1.001  # relative; covers the rounding of float32
DIM_SHARE = 0.05  # of all power: emitters that are dimmer do not decide where the BRDF is sampled
HEADER = np.dtype(
    [
        ("width", "u4"),  # number of leaves, rounded up to a power of two
        ("radius", "f4"),  # of a leaf, metres: mean by power
        ("dimmest", "f4"),  # luminance of dim emitters over the sum of luminance times area, 1/m2
        ("triangles", "u4"),  # number of emitting triangles
        ("first_leaf", "u4"),  # texels at which the parts of the table begin
        ("first_triangle", "u4"),
        ("first_place", "u4"),
        ("pad", "u4"),
    ]
)
NODE = np.dtype(
    [
        ("centre", "f4", 3),  # of a sphere around the emitters, metres
        ("radius", "f4"),
        ("axis", "u4"),  # of a cone around their normals, octahedral, snorm 16
        ("cosine", "f4"),  # of the cone's half angle
        ("power", "f4"),  # share of the sum of luminance times area; 0: no emitter
        ("pad", "f4"),
    ]
)
NONE = 0xFFFFFFFF
HALVED = 0x80000000  # a place that is a pair of places, not a leaf: as deferred/emitters/table.wgsl
NO_EMITTERS = np.zeros((2, 4), np.uint32)  # the table without leaves


@dataclass
class _Bounds:
    """Bounds of nodes: boxes in metres, cones around normals with their half angle, shares of power."""

    low: NDArray[np.float64]
    high: NDArray[np.float64]
    axis: NDArray[np.float64]
    angle: NDArray[np.float64]
    power: NDArray[np.float64]


def build_emitter_tree(scene: Scene, hierarchy: TwoLevelBvh) -> tuple[NDArray[np.uint32], int]:
    """Return the table of `wgsl/deferred/emitters/table.wgsl`, texels (n, 4), and its number of leaves.

    `hierarchy` must be up to date with the scene. Without any power there are no leaves.
    """
    found = divide(list(emitting_parts(scene.instances, hierarchy)))
    bright = found.power > 0
    if not bright.any() or not np.isfinite(found.power.sum()):
        return NO_EMITTERS, 0
    # Order the bright leaves by the Morton code of their middle.
    leaves, power = found.leaves[bright], found.power[bright] / found.power.sum()
    corners = cell_corners(leaves)
    low, high = corners.min(1), corners.max(1)
    order = np.argsort(_morton((low + high) / 2), kind="stable")
    of_leaf = np.full(len(bright), NONE, np.uint32)
    of_leaf[np.flatnonzero(bright)[order]] = np.arange(len(order))
    place = np.full(-(-len(found.slots) // 4) * 4, NONE, np.uint32)
    split = found.slots < 0
    place[: len(split)][~split] = of_leaf[found.slots[~split]]
    place[: len(split)][split] = HALVED - 1 - found.slots[split]
    leaves, power, low, high = leaves[order], power[order], low[order], high[order]
    nodes = _nodes(_Bounds(low, high, _normals(leaves), np.where(leaves["sides"] == 3, np.pi, 0.0), power))
    # Join the parts of the table.
    parts = [part.view(np.uint32).reshape(-1, 4) for part in (nodes, leaves, found.triangles, place)]
    ends = np.cumsum([len(NO_EMITTERS), *map(len, parts)])
    header = np.zeros(1, HEADER)
    header["width"], header["triangles"] = len(nodes) // 2, len(found.triangles)
    header["first_leaf"], header["first_triangle"], header["first_place"] = ends[1:4]
    header["radius"] = np.linalg.norm(high - low, axis=1) @ power / 2
    luminance = power / leaves["area"].astype(np.float64)
    dim_first = np.argsort(luminance)
    header["dimmest"] = luminance[dim_first[np.searchsorted(np.cumsum(power[dim_first]), DIM_SHARE)]]
    return np.concatenate([header.view(np.uint32).reshape(-1, 4), *parts]), len(leaves)


def _normals(leaves: NDArray[np.void]) -> NDArray[np.float64]:
    """Return the unit normals of the emitting sides."""
    normal = np.cross(leaves["edge1"].astype(np.float64), leaves["edge2"].astype(np.float64))
    normal *= np.where(leaves["sides"] == 2, -1.0, 1.0)[:, None]
    return normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)


def _nodes(leaves: _Bounds) -> NDArray[np.void]:
    """Return the nodes of a tree over leaves, in the order of a binary heap; the first is unused."""
    # Fill the last level up with dark leaves.
    count = len(leaves.power)
    width = 1 << (count - 1).bit_length()
    pad = np.minimum(np.arange(width), count - 1)
    bounds = _Bounds(*(values[pad] for values in vars(leaves).values()))
    bounds.power = np.where(np.arange(width) < count, bounds.power, 0.0)
    nodes = np.zeros(2 * width, NODE)
    while True:
        width = len(bounds.power)
        level = nodes[width : 2 * width]
        level["centre"] = (bounds.low + bounds.high) / 2
        level["radius"] = np.linalg.norm(bounds.high - bounds.low, axis=1) / 2 * RADIUS_SLACK
        level["axis"], level["power"] = _octahedral(bounds.axis), bounds.power
        level["cosine"] = np.cos(np.minimum(bounds.angle + CONE_SLACK, np.pi))
        if width == 1:
            return nodes
        bounds = _merged(bounds)


def _merged(of: _Bounds) -> _Bounds:
    """Return the bounds of pairs of neighbouring nodes; dark nodes bound nothing."""
    a, b = (_Bounds(*(values[k::2] for values in vars(of).values())) for k in (0, 1))
    alone = b.power <= 0
    # The cone around two cones (Conty and Kulla 2018, algorithm 1), or the wider one where it holds the other.
    swap = (b.angle > a.angle) & ~alone
    wide, narrow = (np.where(s[:, None], b.axis, a.axis) for s in (swap, ~swap))
    most, least = np.where(swap, b.angle, a.angle), np.where(swap, a.angle, b.angle)
    apart = np.arctan2(np.linalg.norm(np.cross(wide, narrow), axis=1), (wide * narrow).sum(1))
    inside = alone | (np.minimum(apart + least, np.pi) <= most)
    both = np.minimum((most + apart + least) / 2, np.pi)
    side = narrow - wide * (wide * narrow).sum(1, keepdims=True)
    side /= np.maximum(np.linalg.norm(side, axis=1, keepdims=True), 1e-12)
    turned = wide * np.cos(both - most)[:, None] + side * np.sin(both - most)[:, None]
    # Opposite axes have no side to turn to: take all directions.
    both = np.where(apart > np.pi - 1e-3, np.pi, both)
    return _Bounds(
        np.where(alone[:, None], a.low, np.minimum(a.low, b.low)),
        np.where(alone[:, None], a.high, np.maximum(a.high, b.high)),
        np.where(inside[:, None], wide, turned),
        np.where(inside, most, both),
        a.power + b.power,
    )


def _octahedral(v: NDArray[np.float64]) -> NDArray[np.uint32]:
    """Return the octahedral codes of unit vectors (n, 3), snorm 16, as `octahedral_encode` of common/math.wgsl."""
    p = v[:, :2] / np.maximum(np.abs(v).sum(1, keepdims=True), 1e-300)
    folded = (1 - np.abs(p[:, ::-1])) * np.where(p >= 0, 1.0, -1.0)
    code = np.where(v[:, 2:] < 0, folded, p)
    words = np.round(code * 32767).astype(np.int16).view(np.uint16).astype(np.uint32)
    return words[:, 0] | (words[:, 1] << np.uint32(16))


def _morton(points: NDArray[np.float64]) -> NDArray[np.uint64]:
    """Return the Morton codes of points (n, 3) on a grid of 2^20 cells a side of their bounding cube."""
    low = points.min(0)
    span = max(float((points.max(0) - low).max()), 1e-300)
    cells = np.minimum((points - low) / span * (1 << 20), (1 << 20) - 1).astype(np.uint64)
    code = np.zeros(len(points), np.uint64)
    for bit in range(20):
        for axis in range(3):
            code |= ((cells[:, axis] >> np.uint64(bit)) & np.uint64(1)) << np.uint64(3 * bit + axis)
    return code
