"""The table of all light sources, from which shaders choose one in proportion to its power.

Power-proportional light selection as in Pharr et al. 2023, "Physically Based Rendering", 4th ed., section 12.6.2.
Departures: half of the probability goes by power and half equally over groups of sources (each punctual light, each
emissive material, the environment), so that a lamp keeps its samples where a much stronger sun is in shadow. Triangles
with an emission texture are divided into cells (`emitter_cells.py`), each a source of its own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..pictures.color import REC709_LUMINANCE
from ..scene.scene import DirectionalLight, Light, Material, PointLight, Scene, SpotLight
from .emitter_cells import divide_by_texture
from .emitters import EmittingPart, emitting_parts, exitance
from .environment_cdf import environment_power
from .light_values import emitted_radiance, punctual_light
from .two_level_bvh import TwoLevelBvh

KIND_POINT, KIND_SPOT, KIND_SUN, KIND_TRIANGLE, KIND_ENVIRONMENT = range(5)  # as wgsl/scene/lights.wgsl
HARDEST = 1e-4  # least difference of a spot's versines over the outer one: a hard edge, 5e-5 of the angle wide
NARROWEST = 5e-13  # least outer versine, of 1e-6 radians: below, float32 directions do not resolve a cone
POWER_SHARE = 0.5  # share of the probability that goes by power

Group = tuple[NDArray[np.void], NDArray[np.float64]]  # records and the power of each


@dataclass
class LightTable:
    """The packed lights, the pdf of points on each emissive material (1/m2), and the environment's.

    The pdf of a material with an emission texture is that of a white texel; others have their share of it.
    """

    lights: NDArray[np.void]
    count: int
    material_pdf: dict[int, float]  # by id(material)
    environment_pdf: float


def build_light_table(scene: Scene, hierarchy: TwoLevelBvh, cdf: NDArray | None, dtype: np.dtype) -> LightTable:
    """Tabulate the lights of a scene whose BVH is up to date; `cdf` is the environment map's, or None."""
    radius = max(hierarchy.radius, 1e-30)
    groups, group_of_material = _groups(scene, hierarchy, radius, dtype)
    if cdf is not None and scene.environment is not None:
        power = environment_power(scene.environment, radius)
        if power > 0:
            record = np.zeros(1, dtype)
            record["kind"] = KIND_ENVIRONMENT
            groups.append((record, np.array([power])))
    if not groups:
        return LightTable(np.zeros(1, dtype), 0, {}, 0.0)

    # Choose the probability of each group, then of each light within its group.
    totals = np.array([powers.sum() for _, powers in groups])
    chance = POWER_SHARE * totals / totals.sum() + (1 - POWER_SHARE) / len(groups)
    lights = join_records([records for records, _ in groups], dtype)
    probability = np.concatenate([c * p / p.sum() for c, (_, p) in zip(chance, groups, strict=True)])
    lights["probability"] = probability
    lights["of_triangle"] = _of_triangles(lights, probability)
    cumulative = np.cumsum(probability)
    # Divide by the last value: it is then exactly 1, so no light without area at the end of the list is chosen.
    lights["cumulative"] = cumulative / cumulative[-1]
    pdf = {id(m): float(chance[g] / totals[g] * exitance(m)) for m, g in group_of_material.items()}
    has_environment = lights["kind"][-1] == KIND_ENVIRONMENT
    return LightTable(lights, len(lights), pdf, float(chance[-1]) if has_environment else 0.0)


def _groups(
    scene: Scene, hierarchy: TwoLevelBvh, radius: float, dtype: np.dtype
) -> tuple[list[Group], dict[Material, int]]:
    """Return a group for each punctual light and each emissive material with any power, and the materials' groups."""
    groups: list[Group] = []
    for light in scene.lights:
        record, power = _punctual(light, hierarchy.origin, radius, dtype)
        if power > 0:
            groups.append((record, np.array([power])))
    group_of_material = {}
    triangles_of: dict[Material, list[tuple[NDArray[np.void], NDArray[np.float64]]]] = {}
    for part in emitting_parts(scene.instances, hierarchy):
        triangles_of.setdefault(part.material, []).append(_triangle_records(part, dtype))
    for material, parts in triangles_of.items():
        powers = np.concatenate([share for _, share in parts]) * exitance(material)
        if powers.sum() > 0:
            group_of_material[material] = len(groups)
            groups.append((join_records([records for records, _ in parts], dtype), powers))
    return groups, group_of_material


def join_records(parts: list[NDArray[np.void]], dtype: np.dtype) -> NDArray[np.void]:
    """Concatenate records; numpy's own function would drop the padding that WGSL has between fields."""
    joined = np.zeros(sum(map(len, parts)), dtype)
    first = 0
    for part in parts:
        joined[first : first + len(part)] = part
        first += len(part)
    return joined


def _punctual(light: Light, origin: NDArray, radius: float, dtype: np.dtype) -> tuple[NDArray[np.void], float]:
    """Return a light's record and its power in W; the power of a sun is that on a disc of the scene's `radius`."""
    record = np.zeros(1, dtype)
    record["color"] = punctual_light(light)
    luminance = float(punctual_light(light) @ REC709_LUMINANCE)
    if isinstance(light, DirectionalLight):
        record["kind"], record["edge1"] = KIND_SUN, light_direction(light)
        return record, luminance * np.pi * radius**2
    record["position"] = np.asarray(light.position, np.float64) - origin
    if isinstance(light, PointLight):
        record["kind"] = KIND_POINT
        return record, luminance * 4 * np.pi
    assert isinstance(light, SpotLight)
    record["kind"], record["edge1"] = KIND_SPOT, light_direction(light)
    record["edge2"] = (*spot_falloff(light), 0.0)
    inner, outer = versine(light.inner_cone_angle), versine(light.outer_cone_angle)
    # The squared fall-off has the mean 1/3 over the ring between the cones.
    return record, luminance * 2 * np.pi * (inner + (outer - inner) / 3)


def spot_falloff(light: SpotLight) -> tuple[float, float]:
    """Return scale and offset of the fall-off saturate(offset - versine * scale)^2 of KHR_lights_punctual."""
    inner, outer = versine(light.inner_cone_angle), max(versine(light.outer_cone_angle), NARROWEST)
    scale = 1.0 / max(HARDEST * outer, outer - inner)
    return scale, outer * scale


def versine(angle: float) -> float:
    """Return 1 - cos(angle), exact for small angles."""
    return 2 * float(np.sin(angle / 2)) ** 2


def light_direction(light: DirectionalLight | SpotLight) -> NDArray[np.float64]:
    """Return the unit direction in which the light travels."""
    v = np.asarray(light.direction, np.float64)
    v = v / np.abs(v).max()  # so that squares neither overflow nor vanish
    direction: NDArray[np.float64] = v / np.linalg.norm(v)
    return direction


def _triangle_records(part: EmittingPart, dtype: np.dtype) -> tuple[NDArray[np.void], NDArray[np.float64]]:
    """Return the light records of emitting triangles, or of their cells, and their power over `exitance`, in m2."""
    areas = part.areas()
    corners, color = part.corners, emitted_radiance(part.material)
    owner, shares = np.arange(len(areas)), areas
    cells = None
    if part.material.emission_texture is not None:
        cells = divide_by_texture(part, areas)
        bright = np.flatnonzero(cells.importance > 0)
        corners, owner = part.turned_corners(), cells.triangle[bright]
        shares = areas[owner] * (cells.share * cells.importance)[bright] / float(color @ REC709_LUMINANCE)
    records = np.zeros(len(owner), dtype)
    records["kind"], records["color"], records["triangle"] = KIND_TRIANGLE, color, part.triangles[owner]
    records["position"], records["sides"] = corners[owner, 0], part.sides
    records["edge1"], records["edge2"] = ((corners[:, k] - corners[:, 0])[owner] for k in (1, 2))
    if cells is not None:
        records["sides"] |= (part.turn[owner] << 2).astype(np.uint32)
        columns, rows = cells.x | 1 << cells.x_bits, cells.y | 1 << cells.y_bits
        records["cell"] = np.stack([columns, rows], 1)[bright]
    return records, shares


def _of_triangles(lights: NDArray[np.void], probability: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return for each light the probability of all cells of its triangle; for lights without cells their own."""
    # The cells of a triangle follow each other.
    same = (lights["cell"][1:, 0] > 0) & (lights["cell"][:-1, 0] > 0)
    same &= (lights["triangle"][1:] == lights["triangle"][:-1]) & (
        lights["position"][1:] == lights["position"][:-1]
    ).all(1)
    number = np.concatenate([[0], np.cumsum(~same)])
    return np.bincount(number, probability)[number]
