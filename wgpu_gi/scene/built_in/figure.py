"""A human figure with a skeleton: one smooth skin around round cones, and its weights. It stands on y = 0, facing +Z.

The skin is the smooth union (the exponential one of Quilez, "smooth minimum") of round cones, spheres that change their
radius while swept, meshed by surface nets. A vertex follows the joints whose cones are nearest, at most four.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .surface_nets import surface_net

Array = NDArray[np.float64]
Point = tuple[float, float, float]

# Joints from the root to the tips, in metres, at rest: parent, place, and end of the bone. The axes of all joints are
# those of the world. Names that begin with "left" (+X) stand for a right one as well.
JOINTS: dict[str, tuple[str | None, Point, Point]] = {
    "hips": (None, (0.0, 0.95, 0.0), (0.0, 1.08, 0.0)),
    "spine": ("hips", (0.0, 1.08, 0.0), (0.0, 1.26, -0.01)),
    "chest": ("spine", (0.0, 1.26, -0.01), (0.0, 1.47, -0.02)),
    "neck": ("chest", (0.0, 1.47, -0.02), (0.0, 1.56, 0.0)),
    "head": ("neck", (0.0, 1.56, 0.0), (0.0, 1.77, 0.01)),
    "left shoulder": ("chest", (0.03, 1.42, -0.01), (0.17, 1.41, -0.02)),
    "left arm": ("left shoulder", (0.17, 1.41, -0.02), (0.29, 1.16, -0.02)),
    "left forearm": ("left arm", (0.29, 1.16, -0.02), (0.39, 0.94, 0.01)),
    "left hand": ("left forearm", (0.39, 0.94, 0.01), (0.44, 0.8, 0.03)),
    "left thigh": ("hips", (0.095, 0.92, 0.0), (0.1, 0.49, 0.01)),
    "left shin": ("left thigh", (0.1, 0.49, 0.01), (0.1, 0.085, -0.02)),
    "left foot": ("left shin", (0.1, 0.085, -0.02), (0.11, 0.03, 0.12)),
    "left toes": ("left foot", (0.11, 0.03, 0.12), (0.115, 0.025, 0.19)),
}
SKIN, SHIRT, TROUSERS, SHOES, HAIR = (
    (0.55, 0.33, 0.24),
    (0.45, 0.1, 0.07),
    (0.08, 0.12, 0.22),
    (0.05, 0.04, 0.04),
    (0.07, 0.045, 0.03),
)
# Round cones: joint, both ends, radius at each, linear colour. "left" as above.
CONES: list[tuple[str, Point, Point, float, float, Point]] = [
    ("hips", (-0.06, 0.96, -0.01), (0.06, 0.96, -0.01), 0.11, 0.11, TROUSERS),
    ("spine", (-0.04, 1.1, 0.0), (0.04, 1.1, 0.0), 0.1, 0.1, SHIRT),
    ("spine", (-0.05, 1.2, 0.0), (0.05, 1.2, 0.0), 0.1, 0.1, SHIRT),
    ("chest", (-0.07, 1.33, -0.01), (0.07, 1.33, -0.01), 0.11, 0.11, SHIRT),
    ("chest", (-0.09, 1.41, -0.02), (0.09, 1.41, -0.02), 0.065, 0.065, SHIRT),
    ("neck", (0.0, 1.47, -0.02), (0.0, 1.57, 0.0), 0.055, 0.05, SKIN),
    ("head", (0.0, 1.6, 0.025), (0.0, 1.67, 0.01), 0.07, 0.085, SKIN),
    ("head", (0.0, 1.615, 0.095), (0.0, 1.645, 0.085), 0.013, 0.009, SKIN),  # the nose
    ("head", (0.0, 1.63, -0.025), (0.0, 1.69, -0.01), 0.075, 0.085, HAIR),
    ("left shoulder", (0.1, 1.42, -0.02), (0.16, 1.41, -0.02), 0.06, 0.06, SHIRT),
    ("left arm", (0.17, 1.41, -0.02), (0.29, 1.16, -0.02), 0.056, 0.045, SHIRT),
    ("left forearm", (0.29, 1.16, -0.02), (0.385, 0.95, 0.01), 0.042, 0.028, SKIN),
    ("left hand", (0.395, 0.92, 0.015), (0.43, 0.82, 0.03), 0.028, 0.022, SKIN),
    ("left hand", (0.395, 0.91, 0.03), (0.405, 0.865, 0.06), 0.016, 0.012, SKIN),  # the thumb
    ("left thigh", (0.095, 0.9, 0.0), (0.1, 0.49, 0.01), 0.088, 0.058, TROUSERS),
    ("left shin", (0.1, 0.49, 0.01), (0.1, 0.12, -0.02), 0.056, 0.045, TROUSERS),
    ("left foot", (0.1, 0.06, -0.045), (0.108, 0.045, 0.1), 0.046, 0.042, SHOES),
    ("left toes", (0.108, 0.038, 0.12), (0.112, 0.036, 0.165), 0.036, 0.034, SHOES),
]
BLEND = 0.012  # metres: width of the smooth union
WEIGHT_BLEND = 0.02  # metres: a joint this much farther than the nearest has 1 / e of its weight
LEAST_WEIGHT = 0.02  # smaller ones are left out
MOST_INFLUENCES = 4
SKIN_AREA = 2.47  # vertices times the area of a cell: measured, within 4 % for 1,000 to 50,000 vertices


@dataclass(frozen=True)
class Figure:
    """A figure at rest. Joints stand after their parents.

    positions, normals (n, 3), colors (n, 3) linear; triangles (m, 3); joints, weights (n, 4). names (j,); parents (j,),
    -1 for the root; places (j, 3) of the joints at rest, where all have the axes of the world.
    """

    positions: Array
    normals: Array
    colors: Array
    triangles: NDArray[np.int64]
    joints: NDArray[np.int64]
    weights: Array
    names: list[str]
    parents: NDArray[np.int64]
    places: Array


def make_figure(vertices: int = 4000, joints: int = 21) -> Figure:
    """Return a figure with about `vertices` vertices and exactly `joints` joints, at least one for each of its bones.

    Further joints divide the bones.
    """
    bones, cones = _mirrored_joints(), _mirrored_cones()
    ends = np.array([[a, b] for _, a, b, *_ in cones])
    radii = np.array([[ra, rb] for *_, ra, rb, _ in cones])

    def distances(points: Array) -> Array:
        return np.stack([_cone_distance(points, *e, *r) for e, r in zip(ends, radii, strict=True)], axis=1)

    def union(points: Array) -> Array:
        found = distances(points)
        least = found.min(1)
        return least - BLEND * np.log(np.exp((least[:, None] - found) / BLEND).sum(1))

    # Mesh the skin.
    reach = radii.max() + BLEND
    low, high = ends.min((0, 1)) - reach, ends.max((0, 1)) + reach
    positions, normals, triangles = surface_net(union, low, high, (SKIN_AREA / vertices) ** 0.5)
    # Colour each vertex as its nearest cone; weigh the joints by the distances of their nearest cones.
    found = distances(positions)
    colors = np.array([cone[-1] for cone in cones])[found.argmin(1)]
    order = list(bones)
    near = np.full((len(positions), len(order)), np.inf)
    for k, cone in enumerate(cones):
        near[:, order.index(cone[0])] = np.minimum(near[:, order.index(cone[0])], found[:, k])
    weights = np.exp((near.min(1, keepdims=True) - near) / WEIGHT_BLEND)
    # Divide the bones.
    names, parents, places, shares = _divided(bones, joints, positions)
    fine = np.concatenate([weights[:, [k]] * share for k, share in enumerate(shares)], axis=1)
    chosen = np.argsort(-fine, axis=1, kind="stable")[:, :MOST_INFLUENCES]
    kept = np.take_along_axis(fine, chosen, 1)
    kept[kept < LEAST_WEIGHT * kept[:, :1]] = 0.0
    return Figure(
        positions, normals, colors, triangles, chosen, kept / kept.sum(1, keepdims=True), names, parents, places
    )


def _cone_distance(points: Array, a: Array, b: Array, ra: float, rb: float) -> Array:
    """Return the distance to a round cone, (n,), negative inside; exact where the radius is constant."""
    t = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
    off = points - a - t[:, None] * (b - a)
    return np.asarray(np.sqrt(np.einsum("ij,ij->i", off, off)) - (ra + t * (rb - ra)))


def _right(name: str | None) -> str | None:
    return name and name.replace("left", "right")


def _mirrored(point: Point) -> Point:
    return -point[0], point[1], point[2]


def _mirrored_joints() -> dict[str, tuple[str | None, Point, Point]]:
    right = {
        str(_right(name)): (_right(parent), _mirrored(place), _mirrored(end))
        for name, (parent, place, end) in JOINTS.items()
        if name.startswith("left")
    }
    return JOINTS | right


def _mirrored_cones() -> list[tuple[str, Point, Point, float, float, Point]]:
    right = [
        (str(_right(name)), _mirrored(a), _mirrored(b), ra, rb, color)
        for name, a, b, ra, rb, color in CONES
        if name.startswith("left")
    ]
    return CONES + right


def _divided(
    bones: dict[str, tuple[str | None, Point, Point]], count: int, positions: Array
) -> tuple[list[str], NDArray[np.int64], Array, list[Array]]:
    """Divide the bones into `count` joints in all.

    Return names, parents and places of the joints, and for each bone the shares (n, pieces) that its joints have in
    its weight: the middles of the two nearest pieces share it linearly.
    """
    pieces = [count // len(bones) + (k < count % len(bones)) for k in range(len(bones))]
    names: list[str] = []
    parents: list[int] = []
    places: list[Array] = []
    shares: list[Array] = []
    last: dict[str | None, int] = {None: -1}  # the last joint of each bone
    for (name, (parent, place, end)), number in zip(bones.items(), pieces, strict=True):
        start, along = np.array(place), np.array(end) - np.array(place)
        for k in range(number):
            parents.append(len(names) - 1 if k else last[parent])
            names.append(name if k == 0 else f"{name} {k}")
            places.append(start + along * k / number)
        last[name] = len(names) - 1
        middle = np.clip((positions - start) @ along / (along @ along) * number - 0.5, 0.0, number - 1.0)
        shares.append(np.maximum(1.0 - np.abs(middle[:, None] - np.arange(number)), 0.0))
    return names, np.array(parents), np.stack(places), shares
