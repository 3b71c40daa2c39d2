"""The lights that deferred techniques loop over: all punctual lights, and sample lights that represent emitters.

An emitter's sample lights have about equal power. Points are spread over its surface; their cumulative power warps a
rank-1 lattice, first by the marginal, then by the conditional distribution, as Pharr et al. 2023, "Physically Based
Rendering", 4th ed., appendix A, sample 2-D tables. Departure: points on the surface replace the table.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..pictures.color import REC709_LUMINANCE
from ..scene.scene import DirectionalLight, Light, Material, PointLight, Scene, SpotLight
from .emitter_cells import cell_weights, divide_by_texture
from .emitters import EmittingPart, emitting_parts, opacity_at, radiance_at
from .light_table import join_records, light_direction, spot_falloff
from .light_values import punctual_light
from .surface_samples import GOLDEN, R2
from .two_level_bvh import TwoLevelBvh

DIRECT_POINT, DIRECT_SPOT, DIRECT_SUN, DIRECT_AREA = range(4)  # as wgsl/deferred/shadow/views.wgsl
MIN_POINTS = 1 << 12  # on all emitters together; tools/README.md, "Constants"
POINTS_PER_SAMPLE = 256  # at least: 16 x 16 positions for each sample light; tools/README.md, "Constants"
# Weights that make the first of nearly equal lengths the largest, so that rounding does not choose.
PREFER_FIRST = np.array([1.0, 0.991, 0.983])
POINT = np.dtype(
    [
        ("position", "f8", 3),
        ("local", "f8", 3),  # position in the mesh's space
        ("normal", "f8", 3),  # normal of the emitting side
        ("radiance", "f8", 3),
        ("area", "f8"),  # area that the point represents, m2
        ("power", "f8"),  # luminance of radiance times area: the power of one side over pi
    ]
)


@dataclass
class _Patch:
    """Triangles of one emitting part that face about the same way, points on them, and how many samples they get.

    "Same way" means the same axis and sign of the largest component of the local normal.
    """

    part: EmittingPart
    local: NDArray[np.float64]  # corners in the mesh's space, (n, 3, 3)
    points: NDArray[np.void]
    power: float  # sum over the points, and over both sides of double-sided emitters
    samples: int = 0
    power_per_sample: float = 0.0


def build_direct_lights(
    scene: Scene, hierarchy: TwoLevelBvh, dtype: np.dtype, samples: int, use_range: bool
) -> NDArray[np.void]:
    """Return records DirectLight of deferred/shadow/views.wgsl for a scene whose hierarchy is up to date.

    The emitters share `samples` sample lights by power, but each emissive material gets at least one, even if the total
    then exceeds `samples`; with 0 samples, emitters are left out. Radiance times area, summed over a material's
    samples, equals that of its surface. Lights without power are left out. With `use_range` a punctual light ends at
    its range.
    """
    records = [_punctual(light, hierarchy.origin, dtype, use_range) for light in scene.lights]
    patches = _patches(scene, hierarchy, samples) if samples else []
    powers = np.array([sum(patch.power for patch in group) for group in patches])
    counts = 1 + _apportion(powers, max(samples - len(patches), 0))
    for group, count in zip(patches, counts.tolist(), strict=True):
        _share_within(group, count)
        sampled = [_sample_patch(patch, dtype) for patch in group if patch.samples]
        records.append(_restore_power(join_records(sampled, dtype), group))
    return join_records(records, dtype)


def _punctual(light: Light, origin: NDArray[np.float64], dtype: np.dtype, use_range: bool) -> NDArray[np.void]:
    """Return the record of a punctual light, or none if it has no power."""
    record = np.zeros(1, dtype)
    record["color"] = punctual_light(light)
    dark = isinstance(light, SpotLight) and light.outer_cone_angle == 0
    if dark or not record["color"].any():
        return record[:0]
    if isinstance(light, DirectionalLight):
        record["kind"], record["direction"] = DIRECT_SUN, light_direction(light)
        return record
    record["position"] = np.asarray(light.position, np.float64) - origin
    record["inverse_range"] = 1 / light.range if use_range and light.range is not None and light.range > 0 else 0.0
    if isinstance(light, PointLight):
        record["kind"] = DIRECT_POINT
        return record
    record["kind"], record["direction"] = DIRECT_SPOT, light_direction(light)
    record["cone_scale"], record["cone_offset"] = spot_falloff(light)
    return record


def _patches(scene: Scene, hierarchy: TwoLevelBvh, samples: int) -> list[list[_Patch]]:
    """Return the patches of each emissive material that has any power."""
    parts: dict[Material, list[EmittingPart]] = {}
    for part in emitting_parts(scene.instances, hierarchy):
        parts.setdefault(part.material, []).append(part)
    # The budget depends only on the number of emitters: an emitter's samples stay in place while others move or change.
    budget = max(MIN_POINTS, POINTS_PER_SAMPLE * samples) // max(len(parts), 1)
    patches = []
    for of_material in parts.values():
        areas = [np.linalg.norm(_normals(part.corners), axis=1) / 2 for part in of_material]
        total = sum(float(area.sum()) for area in areas)
        density = budget / total if total > 0 else 0.0
        group = [p for part, area in zip(of_material, areas, strict=True) for p in _patches_of(part, area, density)]
        if group:
            patches.append(group)
    return patches


def _normals(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the normals of triangles (n, 3, 3); their length is twice the area."""
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def _patches_of(part: EmittingPart, area: NDArray[np.float64], density: float) -> list[_Patch]:
    """Spread `density` points per m2 over a part and group them by the direction that their triangles face."""
    counts = np.where(area > 0, np.ceil(area * density), 0).astype(np.int64)
    if part.material.emission_texture is not None:
        # Place a point in each cell; it stands for the light of all of it.
        cells = divide_by_texture(part, area, counts.astype(np.float64))
        triangle, box = cells.triangle, cells.box
        weights, _ = part.weights_at(triangle, cell_weights(box[:, :2] + 0.5 * box[:, 2:]))
        radiance, areas = cells.radiance, area[triangle] * cells.share
    else:
        # Place points in each triangle by the R2 sequence.
        triangle = np.repeat(np.arange(len(area)), counts)
        number = np.arange(len(triangle)) - np.repeat(np.cumsum(counts) - counts, counts)
        weights = _triangle_weights((0.5 + number[:, None] * R2) % 1.0)
        vertices = part.vertices[triangle]
        radiance = radiance_at(part, vertices, weights) * opacity_at(part, vertices, weights)
        areas = (area / np.maximum(counts, 1))[triangle]
    # Fill in the points' records.
    normals = _normals(part.corners) * (-1 if part.sides == 2 else 1)
    points = np.zeros(len(triangle), POINT)
    points["position"] = np.einsum("nk,nkc->nc", weights, part.corners[triangle])
    # Samples are chosen by their local positions, so that they stay in place on an instance that moves.
    local = np.asarray(part.mesh.positions, np.float64)[part.vertices]
    points["local"] = np.einsum("nk,nkc->nc", weights, local[triangle])
    points["normal"] = normals[triangle] / (2 * area[triangle, None])
    points["radiance"], points["area"] = radiance, areas
    points["power"] = points["radiance"] @ REC709_LUMINANCE * points["area"]

    # Group them by the axis that the local normal is closest to.
    facing = _normals(local)
    axis = np.argmax(np.abs(facing) * PREFER_FIRST, axis=1)
    side = 2 * axis + (facing[np.arange(len(axis)), axis] < 0)
    patches = []
    for which in np.unique(side):
        mine = points[(side[triangle] == which) & (points["power"] > 0)]
        if len(mine):
            power = float(mine["power"].sum()) * (2 if part.sides == 3 else 1)
            patches.append(_Patch(part, local[side == which], mine, power))
    return patches


def _triangle_weights(u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return barycentric weights (n, 3), uniform by area.

    Heitz 2019, "A Low-Distortion Map Between Triangle and Square".
    """
    x, y = u.T
    b = np.where(y > x, x / 2, x - y / 2)
    c = np.where(y > x, y - x / 2, y / 2)
    return np.stack([1 - b - c, b, c], 1)


def _apportion(powers: NDArray[np.float64], samples: int) -> NDArray[np.int64]:
    """Divide `samples` in proportion to `powers` by the largest remainders (Hamilton's method); zero power gets none.

    The first of equal remainders wins; they are rounded so that floating-point noise does not decide.
    """
    quota = powers / max(float(powers.sum()), 1e-300) * samples
    counts = np.floor(quota + 1e-9).astype(np.int64)
    missing = round(float(quota.sum())) - int(counts.sum())
    counts[np.argsort(-np.round(quota - counts, 9), kind="stable")[:missing]] += 1
    return counts


def _share_within(patches: list[_Patch], samples: int) -> None:
    """Divide a material's samples among its patches by power: each large patch gets its share, small ones form a group.

    A small patch has a share of less than one sample. Systematic sampling in the scene's order chooses the small
    patches that represent their group.
    """
    # Divide the samples among the large patches and the group of small ones.
    powers = np.array([patch.power for patch in patches])
    small = powers / powers.sum() * samples < 1 - 1e-9
    rest = float(powers[small].sum())
    *shares, of_small = _apportion(np.append(powers[~small], rest), samples).tolist()
    counts = np.zeros(len(patches), np.int64)
    counts[~small] = shares
    if of_small:
        # 0.4999 instead of 0.5, so that rounding does not decide between equal patches.
        ends = np.floor(np.cumsum(powers[small]) / rest * of_small + 0.4999)
        ends[-1] = of_small
        counts[small] = np.diff(ends, prepend=0.0)
    # Each sample represents an equal share of its patch's, or the group's, power.
    each = np.where(small, rest / max(of_small, 1), powers / np.maximum(counts, 1))
    for patch, count, power in zip(patches, counts.tolist(), each.tolist(), strict=True):
        patch.samples, patch.power_per_sample = count, power


def _sample_patch(patch: _Patch, dtype: np.dtype) -> NDArray[np.void]:
    """Return a patch's samples: a lattice warped by the points' power, first along one axis, then across it."""
    count, points = patch.samples, patch.points
    # Step back a little, since with points of equal power the lattice falls exactly between two of them.
    at = lattice(count) - 1e-9
    places = points["local"] @ _plane(patch)
    # Warp the first coordinate, which the lattice stratifies best, along the longer axis.
    along, across = places.T if np.ptp(places[:, 0]) > PREFER_FIRST[1] * np.ptp(places[:, 1]) else places.T[::-1]
    order = np.argsort(along, kind="stable")
    cumulative = np.cumsum(points["power"][order])
    middle = np.searchsorted(cumulative, at[:, 0] * cumulative[-1])
    # Warp the second coordinate within a column of sqrt(n) neighbouring points.
    width = int(np.ceil(len(points) ** 0.5))
    first = np.clip(middle - width // 2, 0, len(points) - width)
    column = order[first[:, None] + np.arange(width)]
    column = np.take_along_axis(column, np.argsort(across[column], axis=1, kind="stable"), 1)
    cumulative = np.cumsum(points["power"][column], axis=1)
    row = (cumulative < at[:, 1:] * cumulative[:, -1:]).sum(1)
    chosen = points[column[np.arange(count), row]]
    # Make a light of each chosen point; `area` gives it its share of the power.
    records = np.zeros(count, dtype)
    records["kind"], records["both_sides"] = DIRECT_AREA, patch.part.sides == 3
    records["position"], records["direction"], records["color"] = (
        chosen[name] for name in ("position", "normal", "radiance")
    )
    sides = 2 if patch.part.sides == 3 else 1
    records["area"] = patch.power_per_sample / sides * chosen["area"] / chosen["power"]
    return records


def _plane(patch: _Patch) -> NDArray[np.float64]:
    """Return two axes (3, 2) of the plane of a patch's largest triangle, in the mesh's space; one lies along an edge.

    The edge is at the corner closest to a right angle, so the axes of a rectangle are its sides.
    """
    local = patch.local[np.argmax(np.linalg.norm(_normals(patch.local), axis=1))]
    edges = np.roll(local, -1, axis=0) - local
    edges /= np.linalg.norm(edges, axis=1, keepdims=True)
    along = edges[np.argmin(np.abs((edges * np.roll(edges, 1, axis=0)).sum(1)))]
    across = np.cross(np.cross(edges[0], edges[1]), along)
    return np.stack([along, across / np.linalg.norm(across)], 1)


def lattice(count: int) -> NDArray[np.float64]:
    """Return `count` points of the unit square, (n, 2), stratified in both coordinates like a Latin hypercube.

    The second coordinate is ordered like multiples of the golden ratio modulo 1: a Fibonacci lattice of any count.
    """
    index = np.arange(count)
    rank = np.argsort(np.argsort((index + 1) * GOLDEN % 1.0))
    return (np.stack([index, rank], 1) + 0.5) / max(count, 1)


def _restore_power(records: NDArray[np.void], patches: list[_Patch]) -> NDArray[np.void]:
    """Scale a material's samples so that their radiance times area adds up, per channel, to that of all its patches."""
    wanted = sum(patch.points["area"] @ patch.points["radiance"] for patch in patches)
    there = records["area"].astype(np.float64) @ records["color"]
    if not there.any():
        return records[:0]  # the areas vanish in float32
    scale = float(wanted @ REC709_LUMINANCE / (there @ REC709_LUMINANCE))
    records["area"] *= scale
    records["color"] *= np.where(there > 0, wanted / np.where(there > 0, there * scale, 1.0), 1.0)
    return records
