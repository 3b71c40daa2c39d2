"""The table of all light sources that light sampling draws from, in proportion to their power.

Half of the probability goes by power, half equally over groups of sources (each punctual light, each emissive material,
the environment), so that a lamp beside a sun that does not reach it still gets its samples.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import GiError
from ..scene.scene import DirectionalLight, Environment, Instance, Light, Material, Mesh, PointLight, Scene, SpotLight
from .atlas import mean_linear_color
from .hierarchy import Hierarchy

KIND_POINT, KIND_SPOT, KIND_SUN, KIND_TRIANGLE, KIND_ENVIRONMENT = range(5)
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
POWER_SHARE = 0.5
CDF_WIDTH = 512  # columns of the environment's table at most; bright pixels are spread over one entry


@dataclass
class LightTable:
    """The packed lights, the density 1/m2 on each material's emitting triangles, and that of the environment."""

    lights: NDArray[np.void]
    count: int
    material_pdf: dict[int, float]  # by id(material)
    environment_pdf: float


@dataclass
class EmittingPart:
    """The triangles of one emissive material in one instance of a mesh, in metres relative to the scene's origin.

    Corners come in the order of the hierarchy's barycentric weights: `corners` (n, 3, 3), `vertices` (n, 3) into the
    mesh. `sides` as in wgsl/scene/lights.wgsl: 1 shines from the side of edge1 x edge2, 2 from the other, 3 from both.
    """

    material: Material
    mesh: Mesh
    triangles: NDArray[np.int64]  # into the hierarchy's
    corners: NDArray[np.float64]
    vertices: NDArray[np.uint32]
    sides: int


def build_light_table(scene: Scene, hierarchy: Hierarchy, cdf: NDArray | None, dtype: np.dtype) -> LightTable:
    """Tabulate the lights of a scene whose hierarchy is up to date; `cdf` is the environment's, or None."""
    groups: list[tuple[NDArray[np.void], NDArray[np.float64]]] = []  # records and their powers
    radius = max(hierarchy.radius, 1e-30)
    for light in scene.lights:
        record, power = _punctual(light, hierarchy.origin, radius, dtype)
        if power > 0:
            groups.append((record, np.array([power])))
    group_of_material = {}
    records_of: dict[Material, list[tuple[NDArray[np.void], NDArray[np.float64]]]] = {}
    for part in emitting_parts(scene.instances, hierarchy):
        records_of.setdefault(part.material, []).append(_triangle_records(part, dtype))
    for material, parts in records_of.items():
        powers = np.concatenate([area for _, area in parts]) * _exitance(material)
        if powers.sum() > 0:
            group_of_material[material] = len(groups)
            groups.append((join_records([records for records, _ in parts], dtype), powers))
    environment_power = 0.0 if cdf is None else _environment_power(scene.environment, radius)
    if environment_power > 0:
        record = np.zeros(1, dtype)
        record["kind"] = KIND_ENVIRONMENT
        groups.append((record, np.array([environment_power])))
    if not groups:
        return LightTable(np.zeros(1, dtype), 0, {}, 0.0)

    # Every group's probability, then every light's within its group.
    totals = np.array([powers.sum() for _, powers in groups])
    chance = POWER_SHARE * totals / totals.sum() + (1 - POWER_SHARE) / len(groups)
    lights = join_records([records for records, _ in groups], dtype)
    probability = np.concatenate([c * p / p.sum() for c, (_, p) in zip(chance, groups, strict=True)])
    lights["probability"] = probability
    cumulative = np.cumsum(probability)
    # Exactly one at the end, also where the last lights have no area: those must never be drawn.
    lights["cumulative"] = cumulative / cumulative[-1]
    pdf = {id(m): float(chance[g] / totals[g] * _exitance(m)) for m, g in group_of_material.items()}
    return LightTable(lights, len(lights), pdf, float(chance[-1]) if environment_power > 0 else 0.0)


def join_records(parts: list[NDArray[np.void]], dtype: np.dtype) -> NDArray[np.void]:
    """Concatenate records; numpy's own function would drop the padding that WGSL has between fields."""
    joined = np.zeros(sum(map(len, parts)), dtype)
    first = 0
    for part in parts:
        joined[first : first + len(part)] = part
        first += len(part)
    return joined


def _punctual(light: Light, origin: NDArray, radius: float, dtype: np.dtype) -> tuple[NDArray[np.void], float]:
    """Return a light's record and its power in W, as far as it can reach the scene."""
    record = np.zeros(1, dtype)
    record["color"] = np.asarray(light.color, np.float64) * light.intensity
    strength = float(np.asarray(light.color, np.float64) @ LUMINANCE * light.intensity)
    if isinstance(light, DirectionalLight):
        record["kind"], record["edge1"] = KIND_SUN, light_direction(light)
        return record, strength * np.pi * radius**2
    record["position"] = np.asarray(light.position, np.float64) - origin
    if isinstance(light, PointLight):
        record["kind"] = KIND_POINT
        return record, strength * 4 * np.pi
    assert isinstance(light, SpotLight)
    record["kind"], record["edge1"] = KIND_SPOT, light_direction(light)
    record["edge2"] = (*spot_falloff(light), 0.0)
    inner, outer = np.cos(light.inner_cone_angle), np.cos(light.outer_cone_angle)
    # The fall-off squared over the ring between the cones has the mean 1/3.
    return record, strength * 2 * np.pi * ((1 - inner) + (inner - outer) / 3)


def spot_falloff(light: SpotLight) -> tuple[float, float]:
    """Return scale and offset of the fall-off saturate(cosine * scale + offset)^2, as KHR_lights_punctual has them."""
    inner, outer = float(np.cos(light.inner_cone_angle)), float(np.cos(light.outer_cone_angle))
    scale = 1.0 / max(0.001, inner - outer)
    return scale, -outer * scale


def light_direction(light: DirectionalLight | SpotLight) -> NDArray[np.float64]:
    """Return the unit direction of travel. Raises GiError if the light has none."""
    v = np.asarray(light.direction, np.float64)
    length = np.linalg.norm(v)
    if v.shape != (3,) or not 0 < length < np.inf:
        raise GiError(f"light {light.name!r}: its direction must be three finite numbers, not all of them zero")
    return v / length


def _exitance(material: Material) -> float:
    """Return the power that leaves an emitter per area, W/m2, as luminance and averaged over its texture."""
    color = np.asarray(material.emission, np.float64)
    if material.emission_texture is not None:
        color = color * mean_linear_color(material.emission_texture.image)
    return float(color @ LUMINANCE) * np.pi * (2 if material.double_sided else 1)


def emitting_parts(instances: list[Instance], hierarchy: Hierarchy) -> Iterator[EmittingPart]:
    """Yield all triangles that may shine, instance by instance."""
    for instance in instances:
        place = hierarchy.placement(instance.mesh)
        for m, material in enumerate(instance.mesh.materials):
            if max(material.emission) <= 0 or material.unlit:
                continue
            chosen = np.flatnonzero(place.data.material == m)
            matrix = np.asarray(instance.world_from_local, np.float64)
            translation = matrix[:3, 3] - hierarchy.origin
            corners = place.data.corners[chosen].astype(np.float64) @ matrix[:3, :3].T + translation
            mirrored = np.linalg.det(matrix[:3, :3]) < 0
            # Barycentric weights must agree with how the hierarchy stores a mirrored triangle.
            turn = [0, 2, 1] if mirrored and place.baked is not None else [0, 1, 2]
            sides = 3 if material.double_sided else 2 if mirrored and place.baked is None else 1
            vertices = place.data.indices[chosen][:, turn]
            triangles = chosen + place.triangles.start
            yield EmittingPart(material, instance.mesh, triangles, corners[:, turn], vertices, sides)


def _triangle_records(part: EmittingPart, dtype: np.dtype) -> tuple[NDArray[np.void], NDArray[np.float64]]:
    """Return the light records and areas in m2 of emitting triangles."""
    edge1, edge2 = part.corners[:, 1] - part.corners[:, 0], part.corners[:, 2] - part.corners[:, 0]
    records = np.zeros(len(part.triangles), dtype)
    records["kind"] = KIND_TRIANGLE
    records["position"], records["edge1"], records["edge2"] = part.corners[:, 0], edge1, edge2
    records["triangle"], records["color"], records["sides"] = part.triangles, part.material.emission, part.sides
    return records, np.linalg.norm(np.cross(edge1, edge2), axis=1) / 2


def environment_cdf(environment: Environment) -> NDArray[np.float32] | None:
    """Return the sampling table of a pictured environment, (rows, columns + 1) float32, or None for a constant one.

    Each row holds the cumulative distribution of its columns; the last column holds that of the rows. Entries are
    proportional to luminance times solid angle, but for 1 % spread evenly, for what one entry averages away.
    Raises GiError for pixels that are negative or not finite.
    """
    if environment.image is None:
        return None
    image = np.asarray(environment.image)
    if not (np.isfinite(image).all() and (image >= 0).all()):
        raise GiError(f"environment {environment.name!r}: its pixels must be finite and not negative")
    luminance = image @ (LUMINANCE * np.asarray(environment.color))
    rows, columns = (min(n, CDF_WIDTH) for n in luminance.shape)
    # As it is looked up: round in u, clamped in v.
    mean = _range_means(np.pad(luminance, ((1, 1), (0, 0)), "edge"), rows)
    mean = _range_means(np.pad(mean, ((0, 0), (1, 1)), "wrap").T, columns).T
    sine = np.sin((np.arange(rows) + 0.5) / rows * np.pi)[:, None] * np.ones(columns)
    weight, even = mean * sine, sine / sine.sum()
    total = weight.sum()
    weight = 0.99 * weight / total + 0.01 * even if total > 0 else even
    of_rows = np.cumsum(weight.sum(1))
    table = np.zeros((rows, columns + 1), np.float32)
    table[:, :-1] = np.cumsum(weight, 1) / weight.sum(1, keepdims=True)
    table[:, -2] = 1.0
    table[:, -1] = of_rows / of_rows[-1]
    return table


def _range_means(values: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return the means over `count` equal ranges of what runs linearly from row to row of `values` (n + 2, m).

    The ranges part the n rows between the outermost ones, each from half a row before its centre to half a row behind.
    """
    inner = len(values) - 2
    edge = np.linspace(0.5, inner + 0.5, count + 1)
    row = np.minimum(edge.astype(np.int64), inner)
    f = (edge - row)[:, None]
    integral = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum((values[:-1] + values[1:]) / 2, 0)])
    at_edge = integral[row] + f * values[row] + f * f / 2 * (values[row + 1] - values[row])
    # Rounding of the sums must not make a range negative.
    return np.maximum(np.diff(at_edge, axis=0), 0) * (count / inner)


def _environment_power(environment: Environment | None, radius: float) -> float:
    assert environment is not None and environment.image is not None
    luminance = np.asarray(environment.image, np.float64) @ (LUMINANCE * np.asarray(environment.color))
    sine = np.sin((np.arange(len(luminance)) + 0.5) / len(luminance) * np.pi)
    mean = float(luminance.mean(1) @ sine / sine.sum())
    return mean * 4 * np.pi * np.pi * radius**2
