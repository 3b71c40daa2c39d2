"""The table of all light sources that light sampling draws from, in proportion to their power.

Half of the probability goes by power, half equally over groups of sources (each punctual light, each emissive material,
the environment), so that a lamp beside a sun that does not reach it still gets its samples.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .atlas import mean_linear_color
from .hierarchy import Hierarchy, relative_matrix
from .scene import DirectionalLight, Environment, Instance, Light, Material, PointLight, Scene, SpotLight

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


def build_light_table(scene: Scene, hierarchy: Hierarchy, cdf: NDArray | None, dtype: np.dtype) -> LightTable:
    """Tabulate the lights of a scene whose hierarchy is up to date; `cdf` is the environment's, or None."""
    groups: list[tuple[NDArray[np.void], NDArray[np.float64]]] = []  # records and their powers
    radius = max(hierarchy.radius, 1e-30)
    for light in scene.lights:
        record, power = _punctual(light, hierarchy.origin, radius, dtype)
        if power > 0:
            groups.append((record, np.array([power])))
    emitters: dict[int, list[tuple[NDArray[np.void], NDArray[np.float64]]]] = {}
    for instance in scene.instances:
        for material, records, area in _emitting_triangles(instance, hierarchy, dtype):
            emitters.setdefault(id(material), []).append((records, area * _emitted_luminance(material) * np.pi))
    material_groups = {}
    for key, parts in emitters.items():
        power = np.concatenate([p for _, p in parts])
        if power.sum() > 0:
            material_groups[key] = len(groups)
            groups.append((_join([r for r, _ in parts], dtype), power))
    if cdf is not None and scene.environment is not None:
        record = np.zeros(1, dtype)
        record["kind"] = KIND_ENVIRONMENT
        groups.append((record, np.array([_environment_power(scene.environment, radius)])))
    if not groups:
        return LightTable(np.zeros(1, dtype), 0, {}, 0.0)

    # Every group's probability, then every light's within its group.
    powers = np.array([p.sum() for _, p in groups])
    chance = POWER_SHARE * powers / powers.sum() + (1 - POWER_SHARE) / len(groups)
    lights = _join([r for r, _ in groups], dtype)
    probability = np.concatenate([c * p / p.sum() for c, (_, p) in zip(chance, groups, strict=True)])
    lights["probability"] = probability
    cumulative = np.cumsum(probability)
    lights["cumulative"] = cumulative / cumulative[-1]
    lights["cumulative"][-1] = 1.0
    materials = {id(m): m for m in scene.materials}
    pdf = {
        key: float(chance[g] / powers[g] * _emitted_luminance(materials[key]) * np.pi)
        for key, g in material_groups.items()
    }
    return LightTable(lights, len(lights), pdf, float(chance[-1]) if cdf is not None else 0.0)


def _join(parts: list[NDArray[np.void]], dtype: np.dtype) -> NDArray[np.void]:
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
        record["kind"], record["edge1"] = KIND_SUN, _unit(light.direction)
        return record, strength * np.pi * radius**2
    record["position"] = np.asarray(light.position, np.float64) - origin
    if isinstance(light, PointLight):
        record["kind"] = KIND_POINT
        return record, strength * 4 * np.pi
    assert isinstance(light, SpotLight)
    inner, outer = np.cos(light.inner_cone_angle), np.cos(light.outer_cone_angle)
    # KHR_lights_punctual: scale = 1 / max(0.001, cos inner - cos outer), offset = -cos outer * scale
    scale = 1.0 / max(0.001, inner - outer)
    record["kind"], record["edge1"] = KIND_SPOT, _unit(light.direction)
    record["edge2"] = (scale, -outer * scale, 0.0)
    # The fall-off squared over the ring between the cones has the mean 1/3.
    return record, strength * 2 * np.pi * ((1 - inner) + (inner - outer) / 3)


def _unit(direction: object) -> NDArray[np.float64]:
    v = np.asarray(direction, np.float64)
    return v / np.linalg.norm(v)


def _emitted_luminance(material: Material) -> float:
    """Return the mean emitted luminance over the material's texture."""
    color = np.asarray(material.emission, np.float64)
    if material.emission_texture is not None:
        color = color * mean_linear_color(material.emission_texture.image)
    return float(color @ LUMINANCE)


def _emitting_triangles(
    instance: Instance, hierarchy: Hierarchy, dtype: np.dtype
) -> Iterator[tuple[Material, NDArray[np.void], NDArray[np.float64]]]:
    """Yield material, light records and areas in m2 for each emissive material of an instance."""
    place = hierarchy.placement(instance.mesh)
    for m, material in enumerate(instance.mesh.materials):
        if max(material.emission) <= 0 or material.unlit:
            continue
        chosen = np.flatnonzero(place.data.material == m)
        matrix = relative_matrix(instance, hierarchy.origin)
        corners = place.data.corners[chosen].astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
        front = 1
        if np.linalg.det(matrix[:3, :3]) < 0:
            # Barycentric weights must agree with how the hierarchy stores a mirrored triangle.
            if place.baked is not None:
                corners = corners[:, [0, 2, 1]]
            else:
                front = 2
        edge1, edge2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        records = np.zeros(len(chosen), dtype)
        records["kind"] = KIND_TRIANGLE
        records["position"], records["edge1"], records["edge2"] = corners[:, 0], edge1, edge2
        records["triangle"], records["color"] = chosen + place.triangles.start, material.emission
        records["sides"] = 3 if material.double_sided else front
        yield material, records, np.linalg.norm(np.cross(edge1, edge2), axis=1) / 2


def environment_cdf(environment: Environment) -> NDArray[np.float32] | None:
    """Return the sampling table of a pictured environment, (rows, columns + 1) float32, or None for a constant one.

    Each row holds the cumulative distribution of its columns; the last column holds that of the rows. Entries are
    proportional to luminance times solid angle, but for 1 % spread evenly, which bilinear edges need.
    """
    if environment.image is None:
        return None
    luminance = np.asarray(environment.image, np.float64) @ (LUMINANCE * np.asarray(environment.color))
    step = -(-luminance.shape[1] // CDF_WIDTH)
    rows, columns = -(-luminance.shape[0] // step), -(-luminance.shape[1] // step)
    padded = np.zeros((rows * step, columns * step))
    padded[: luminance.shape[0], : luminance.shape[1]] = luminance
    weight = padded.reshape(rows, step, columns, step).mean((1, 3))
    theta = (np.arange(rows) + 0.5) / rows * np.pi
    weight *= np.sin(theta)[:, None]
    even = np.sin(theta)[:, None] * np.ones(columns)
    total = weight.sum()
    weight = 0.99 * weight / total + 0.01 * even / even.sum() if total > 0 else even / even.sum()
    table = np.zeros((rows, columns + 1), np.float32)
    table[:, :-1] = np.cumsum(weight, 1) / weight.sum(1, keepdims=True)
    table[:, -2] = 1.0
    table[:, -1] = np.cumsum(weight.sum(1)) / weight.sum()
    table[-1, -1] = 1.0
    return table


def _environment_power(environment: Environment, radius: float) -> float:
    assert environment.image is not None
    luminance = np.asarray(environment.image, np.float64) @ (LUMINANCE * np.asarray(environment.color))
    theta = (np.arange(len(luminance)) + 0.5) / len(luminance) * np.pi
    mean = float((luminance.mean(1) * np.sin(theta)).sum() / np.sin(theta).sum())
    return mean * 4 * np.pi * np.pi * radius**2
