"""The lights that the deferred techniques loop over: all punctual ones, and sample lights that stand for emitters.

An emitter's samples have about equal power: a lattice is warped over it by cumulative sums, as pictured environments
are sampled (Pharr et al. 2023, "Physically Based Rendering", 4th ed., section A.4), here over points on the surface.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..pictures.color import REC709_LUMINANCE
from ..scene.scene import DirectionalLight, Light, Material, PointLight, Scene, SpotLight
from .emitters import EmittingPart, emitting_parts
from .light_table import join_records, light_direction, spot_falloff
from .surface_samples import GOLDEN, R2
from .texture_sampling import sample_texture
from .two_level_bvh import TwoLevelBvh

DIRECT_POINT, DIRECT_SPOT, DIRECT_SUN, DIRECT_AREA = range(4)  # as wgsl/deferred/shadow/views.wgsl
POINTS = 1 << 12  # on all emitters together, at least; chosen
POINTS_PER_SAMPLE = 256  # at least: places on a grid of 16 x 16 about each sample; chosen
TEXTURED = 8  # times as many points on pictured emitters, so that small bright spots are found; chosen
# The first of nearly equal lengths is chosen whatever rounding does to them.
PREFER_FIRST = np.array([1.0, 0.991, 0.983])
POINT = np.dtype(
    [
        ("position", "f8", 3),
        ("local", "f8", 3),  # the same in the mesh's space
        ("normal", "f8", 3),  # of the side that shines
        ("radiance", "f8", 3),
        ("area", "f8"),  # that it stands for
        ("power", "f8"),  # luminance of radiance times area: of one side, over pi
    ]
)


@dataclass
class _Patch:
    """Triangles of one emitting part that face about the same way, points on them, and how many samples they get."""

    part: EmittingPart
    local: NDArray[np.float64]  # corners in the mesh's space, (n, 3, 3)
    points: NDArray[np.void]
    power: float  # of all sides
    samples: int = 0
    power_per_sample: float = 0.0


def build_direct_lights(
    scene: Scene, hierarchy: TwoLevelBvh, dtype: np.dtype, samples: int, use_range: bool
) -> NDArray[np.void]:
    """Return records of a scene's lights, whose hierarchy is up to date: DirectLight of deferred/shadow/views.wgsl.

    The emitters share `samples` sample lights by their power, but each emissive material has at least one, also where
    that makes more. Radiance times area of a material's samples adds up to that of its surface. Lights that shine
    nowhere are left out. With `use_range` a punctual light ends at its range.
    """
    records = [_punctual(light, hierarchy.origin, dtype, use_range) for light in scene.lights]
    patches = _patches(scene, hierarchy, samples)
    powers = np.array([sum(patch.power for patch in group) for group in patches])
    counts = 1 + _apportion(powers, max(samples - len(patches), 0))
    for group, count in zip(patches, counts.tolist(), strict=True):
        _share_within(group, count)
        sampled = [_sample_patch(patch, dtype) for patch in group if patch.samples]
        records.append(_restore_power(join_records(sampled, dtype), group))
    return join_records(records, dtype)


def _punctual(light: Light, origin: NDArray[np.float64], dtype: np.dtype, use_range: bool) -> NDArray[np.void]:
    """Return a light's record, or none if it is black."""
    record = np.zeros(1, dtype)
    record["color"] = np.asarray(light.color, np.float64) * light.intensity
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
    """Return the patches of each emissive material that shines."""
    parts: dict[Material, list[EmittingPart]] = {}
    for part in emitting_parts(scene.instances, hierarchy):
        parts.setdefault(part.material, []).append(part)
    # No emitter's points depend on other emitters' place or light, so that its samples stay while those change.
    budget = max(POINTS, POINTS_PER_SAMPLE * samples) // max(len(parts), 1)
    patches = []
    for of_material in parts.values():
        areas = [np.linalg.norm(_normals(part.corners), axis=1) / 2 for part in of_material]
        total = sum(float(area.sum()) for area in areas)
        density = budget / total if total > 0 else 0.0
        density *= TEXTURED if of_material[0].material.emission_texture is not None else 1
        group = [p for part, area in zip(of_material, areas, strict=True) for p in _patches_of(part, area, density)]
        if group:
            patches.append(group)
    return patches


def _normals(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def _patches_of(part: EmittingPart, area: NDArray[np.float64], density: float) -> list[_Patch]:
    """Spread points over a part, `density` of them per m2, and sort its triangles by where they face."""
    counts = np.where(area > 0, np.ceil(area * density), 0).astype(np.int64)
    triangle = np.repeat(np.arange(len(area)), counts)
    number = np.arange(len(triangle)) - np.repeat(np.cumsum(counts) - counts, counts)
    weights = _triangle_weights((0.5 + number[:, None] * R2) % 1.0)
    normals = _normals(part.corners) * (-1 if part.sides == 2 else 1)
    points = np.zeros(len(triangle), POINT)
    points["position"] = np.einsum("nk,nkc->nc", weights, part.corners[triangle])
    # Where they lie on the mesh decides which become samples, so that those go with an instance wherever it moves.
    local = np.asarray(part.mesh.positions, np.float64)[part.vertices]
    points["local"] = np.einsum("nk,nkc->nc", weights, local[triangle])
    points["normal"] = normals[triangle] / (2 * area[triangle, None])
    points["radiance"] = _radiance(part, part.vertices[triangle], weights)
    points["area"] = (area / np.maximum(counts, 1))[triangle]
    points["power"] = points["radiance"] @ REC709_LUMINANCE * points["area"]

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
    """Return barycentric weights (n, 3), uniform over the area (Heitz 2019, "A Low-Distortion Map ...")."""
    x, y = u.T
    b = np.where(y > x, x / 2, x - y / 2)
    c = np.where(y > x, y - x / 2, y / 2)
    return np.stack([1 - b - c, b, c], 1)


def _radiance(part: EmittingPart, vertices: NDArray, weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what points shine, (n, 3); nothing where the surface is cut out."""
    material = part.material
    radiance = np.broadcast_to(np.asarray(material.emission, np.float64), (len(vertices), 3))
    if material.emission_texture is not None:
        radiance = radiance * sample_texture(material.emission_texture, part.mesh, vertices, weights)[:, :3]
    if material.alpha_mode == "mask":
        alpha = np.full(len(vertices), float(material.base_color[3]))
        if part.mesh.colors is not None:
            alpha *= np.einsum("nk,nk->n", weights, np.asarray(part.mesh.colors, np.float64)[vertices, 3])
        if material.base_color_texture is not None:
            alpha *= sample_texture(material.base_color_texture, part.mesh, vertices, weights)[:, 3]
        radiance = radiance * (alpha >= material.alpha_cutoff)[:, None]
    return radiance


def _apportion(powers: NDArray[np.float64], samples: int) -> NDArray[np.int64]:
    """Share samples out by power (Hamilton's method); of equal remainders the first one counts, whatever rounding does.

    No power, no samples.
    """
    quota = powers / max(float(powers.sum()), 1e-300) * samples
    counts = np.floor(quota + 1e-9).astype(np.int64)
    missing = round(float(quota.sum())) - int(counts.sum())
    counts[np.argsort(-np.round(quota - counts, 9), kind="stable")[:missing]] += 1
    return counts


def _share_within(patches: list[_Patch], samples: int) -> None:
    """Give a material's patches samples by power: large ones each for itself, small ones together.

    Of the small ones some stand for all, evenly along the scene's order (systematic sampling).
    """
    powers = np.array([patch.power for patch in patches])
    small = powers / powers.sum() * samples < 1 - 1e-9
    rest = float(powers[small].sum())
    *shares, of_small = _apportion(np.append(powers[~small], rest), samples).tolist()
    counts = np.zeros(len(patches), np.int64)
    counts[~small] = shares
    if of_small:
        # Just off the middle: the quarters of equal lamps must not depend on rounding.
        ends = np.floor(np.cumsum(powers[small]) / rest * of_small + 0.4999)
        ends[-1] = of_small
        counts[small] = np.diff(ends, prepend=0.0)
    each = np.where(small, rest / max(of_small, 1), powers / np.maximum(counts, 1))
    for patch, count, power in zip(patches, counts.tolist(), each.tolist(), strict=True):
        patch.samples, patch.power_per_sample = count, power


def _sample_patch(patch: _Patch, dtype: np.dtype) -> NDArray[np.void]:
    """Return a patch's samples: a lattice warped so that the columns, and then places within a column, go by power."""
    count, points = patch.samples, patch.points
    # Points of equal power end exactly where the lattice asks: rounding must not choose between two of them.
    at = lattice(count) - 1e-9
    places = points["local"] @ _plane(patch)
    # Samples are spread best along the first coordinate.
    along, across = places.T if np.ptp(places[:, 0]) > PREFER_FIRST[1] * np.ptp(places[:, 1]) else places.T[::-1]
    order = np.argsort(along, kind="stable")
    cumulative = np.cumsum(points["power"][order])
    middle = np.searchsorted(cumulative, at[:, 0] * cumulative[-1])
    # A column is as wide as it is fine.
    width = int(np.ceil(len(points) ** 0.5))
    first = np.clip(middle - width // 2, 0, len(points) - width)
    column = order[first[:, None] + np.arange(width)]
    column = np.take_along_axis(column, np.argsort(across[column], axis=1, kind="stable"), 1)
    cumulative = np.cumsum(points["power"][column], axis=1)
    row = (cumulative < at[:, 1:] * cumulative[:, -1:]).sum(1)
    chosen = points[column[np.arange(count), row]]
    records = np.zeros(count, dtype)
    records["kind"], records["both_sides"] = DIRECT_AREA, patch.part.sides == 3
    records["position"], records["direction"], records["color"] = (
        chosen[name] for name in ("position", "normal", "radiance")
    )
    # The power of double-sided emitters counts both sides; area counts once.
    sides = 2 if patch.part.sides == 3 else 1
    records["area"] = patch.power_per_sample / sides * chosen["area"] / chosen["power"]
    return records


def _plane(patch: _Patch) -> NDArray[np.float64]:
    """Return two axes (3, 2) of the plane of a patch's largest triangle in the mesh's space, one along a side of it.

    Of its corners that nearest to a right angle counts: so the axes of a rectangle are its sides.
    """
    local = patch.local[np.argmax(np.linalg.norm(_normals(patch.local), axis=1))]
    edges = np.roll(local, -1, axis=0) - local
    edges /= np.linalg.norm(edges, axis=1, keepdims=True)
    along = edges[np.argmin(np.abs((edges * np.roll(edges, 1, axis=0)).sum(1)))]
    across = np.cross(np.cross(edges[0], edges[1]), along)
    return np.stack([along, across / np.linalg.norm(across)], 1)


def lattice(count: int) -> NDArray[np.float64]:
    """Return `count` points of the unit square, (n, 2): each coordinate takes the centre of each n-th part once.

    The second one by the order of the multiples of the golden ratio, as a Fibonacci lattice has it for other counts,
    too.
    """
    index = np.arange(count)
    rank = np.argsort(np.argsort((index + 1) * GOLDEN % 1.0))
    return (np.stack([index, rank], 1) + 0.5) / max(count, 1)


def _restore_power(records: NDArray[np.void], patches: list[_Patch]) -> NDArray[np.void]:
    """Let a material's samples stand for its patches without one, too, and have its hue on average."""
    wanted = sum(patch.points["area"] @ patch.points["radiance"] for patch in patches)
    there = records["area"].astype(np.float64) @ records["color"]
    scale = float(wanted @ REC709_LUMINANCE / (there @ REC709_LUMINANCE))
    records["area"] *= scale
    records["color"] *= np.where(there > 0, wanted / np.where(there > 0, there * scale, 1.0), 1.0)
    return records
