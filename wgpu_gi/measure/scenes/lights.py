"""Lights and skies for generated scenes: punctual lights, emitters of all sizes, constant and image environments."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ...scene.scene import (
    DirectionalLight,
    Environment,
    Instance,
    Light,
    Material,
    Mesh,
    PointLight,
    Scene,
    SpotLight,
    values_of,
)
from .draws import Draws, Rgb, place, unit
from .solids import ball, box, plane, torus
from .surfaces import screen
from .textures import grey, rgba

Point = Sequence[float]


def lamp(draws: Draws, flux: float, area: float, double_sided: bool = False) -> Material:
    """Return an emitter that sends out `flux` watts per channel and side from `area` square metres."""
    radiance = flux / (math.pi * area)
    red, green, blue = (float(np.float32(radiance * channel)) for channel in draws.tint())
    return Material("lamp", rgba(grey(draws.uniform(0.0, 0.8))), emission=(red, green, blue), double_sided=double_sided)


def point_light(draws: Draws, position: Point, flux: float, name: str = "point") -> PointLight:
    """Return a point light of `flux` watts."""
    x, y, z = (float(np.float32(value)) for value in position)
    reach = draws.uniform(1.0, 8.0) if draws.chance(0.2) else None
    return PointLight((x, y, z), float(np.float32(flux / (4 * math.pi))), draws.tint(), reach, name)


def spot_light(draws: Draws, position: Point, target: Point, flux: float, name: str = "spot") -> SpotLight:
    """Return a spot light that sends about `flux` watts towards `target`."""
    outer = draws.uniform(0.15, 1.4)
    inner = draws.choice((0.0, outer, draws.uniform(0.0, outer)))
    intensity = flux / (2 * math.pi * (1 - math.cos(outer)))
    x, y, z = (float(np.float32(value)) for value in position)
    direction = unit(np.asarray(target, np.float64) - np.asarray((x, y, z)))
    return SpotLight((x, y, z), direction, inner, outer, float(np.float32(intensity)), draws.tint(), None, name)


def sun(draws: Draws, irradiance: float, lowest: float = 0.15) -> DirectionalLight:
    """Return a sun whose height above the horizon has a sine of at least `lowest`."""
    angle, height = draws.uniform(-math.pi, math.pi), draws.uniform(lowest, 1.0)
    across = math.sqrt(max(1 - height * height, 0.0))
    direction = unit((across * math.cos(angle), -height, across * math.sin(angle)))
    return DirectionalLight(direction, irradiance, draws.tint(), "sun")


def sky(draws: Draws, radiance: float) -> Environment:
    """Return a constant sky, or an image: ground, gradient, clouds and, often, a bright disc; turned by whole columns.

    The image's mean is about `radiance`.
    """
    if draws.chance(0.3):
        red, green, blue = draws.color(0.4 * radiance, 1.6 * radiance)
        return Environment((red, green, blue), name="constant")
    height = draws.choice((4, 16, 32))
    width = 2 * height
    y = np.arange(height)[:, None]
    up = np.cos((y + 0.5) / height * np.pi)[..., None]
    zenith, horizon, ground = (np.array(draws.color(low, high)) for low, high in ((0.2, 1), (0.7, 1.6), (0.05, 0.5)))
    pixels = np.where(up > 0, horizon + (zenith - horizon) * np.clip(up, 0, 1), ground)
    pixels = pixels * (0.7 + 0.6 * draws.array(height, width, 1))
    if draws.chance(0.7):
        row, column = draws.integer(0, height // 2 - 1), draws.integer(0, width - 1)
        pixels[row, column] += draws.log_uniform(3.0, 3000.0) * np.array(draws.tint())
    turn = draws.integer(0, width - 1) * 2 * math.pi / width if draws.chance(0.4) else 0.0
    return Environment(image=(pixels * radiance).astype(np.float32), rotation=turn, name="image")


# ------------------------------------------------------------------------------------------------ lights in a room

LAMPS = ("point", "spot", "panel", "bulb", "near surface", "large and tiny", "ring", "screen", "double-sided")


def add_lamp(draws: Draws, scene: Scene, size: Point, flux: float, kind: str) -> None:
    """Add a light of a kind of LAMPS to a room of `size` (x, y, z) whose floor is at y = 0, centred on x = z = 0."""
    # Find a place under the ceiling or anywhere in the upper half.
    half_x, height, half_z = size[0] / 2, size[1], size[2] / 2
    x, z = draws.uniform(-0.7, 0.7) * half_x, draws.uniform(-0.7, 0.7) * half_z
    y = draws.uniform(0.6, 0.9) * height
    gap = draws.log_uniform(1e-3, 0.1)
    # Build the light.
    if kind == "point":
        scene.lights.append(point_light(draws, (x, y, z), flux))
    elif kind == "near surface":
        near = draws.choice(((x, height - gap, z), (x, gap, z), (half_x - gap, y, z), (x, y, gap - half_z)))
        scene.lights.append(point_light(draws, near, 0.3 * flux, "near surface"))
    elif kind == "spot":
        target = (draws.uniform(-1, 1) * half_x, draws.uniform(0, 0.5) * height, draws.uniform(-1, 1) * half_z)
        scene.lights.append(spot_light(draws, (x, y, z), target, flux))
    elif kind == "screen":
        width = draws.uniform(0.5, 1.5)
        material = screen(draws, flux / (math.pi * width * width) * 4)
        upright = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
        wall = draws.turn(draws.integer(0, 3) * math.pi / 2) @ upright
        position = (0.0, 0.6 * height, 0.0) + (0.05 - np.abs(wall[:, 1]) @ np.array(size) / 2) * wall[:, 1]
        scene.instances.append(Instance(plane(material, name="screen"), place(position, width, wall), "screen"))
    else:
        _add_emitter(draws, scene, (x, y, z), height - gap, flux, kind)


def _add_emitter(draws: Draws, scene: Scene, position: Point, ceiling: float, flux: float, kind: str) -> None:
    """Add an emitting mesh near `position`, or just below the ceiling."""
    x, y, z = position
    down = np.diag([1.0, -1.0, -1.0])
    if kind in ("panel", "large and tiny"):
        width, depth = draws.uniform(0.3, 1.5), draws.uniform(0.3, 1.5)
        panel = plane(lamp(draws, flux, width * depth), draws.choice((1, 1, 4)), name="panel")
        scene.instances.append(Instance(panel, place((x, ceiling, z), (width, 1, depth), down), "panel"))
    if kind == "large and tiny":
        tiny = draws.log_uniform(2e-3, 2e-2)
        bulb = box(lamp(draws, flux, 6 * tiny * tiny), name="tiny")
        scene.instances.append(Instance(bulb, place((-x, 0.8 * y, -z), tiny), "tiny"))
    elif kind == "bulb":
        radius = draws.log_uniform(0.02, 0.3)
        mesh = ball(lamp(draws, flux, 4 * math.pi * radius * radius), draws.integer(1, 2), name="bulb")
        scene.instances.append(Instance(mesh, place((x, min(y, ceiling - radius), z), 2 * radius), "bulb"))
    elif kind == "ring":
        width, tube = draws.uniform(0.3, 1.0), 0.06
        area = 4 * math.pi**2 * (0.5 - tube) * tube * width * width
        mesh = torus(lamp(draws, flux, area), draws.integer(8, 20), tube, True, "ring")
        scene.instances.append(Instance(mesh, place((x, y, z), width, draws.rotation()), "ring"))
    elif kind == "double-sided":
        width = draws.uniform(0.2, 0.8)
        mesh = plane(lamp(draws, flux / 2, width * width, double_sided=True), name="double-sided")
        scene.instances.append(Instance(mesh, place((x, y, z), width, draws.rotation()), "double-sided"))


def light_room(draws: Draws, scene: Scene, size: Point, kinds: Sequence[str], count: int) -> None:
    """Add `count` lights of `kinds` to a room; together they give its surfaces an irradiance near 10 W/m2."""
    area = 2 * (size[0] * size[1] + size[1] * size[2] + size[0] * size[2])
    flux = 10.0 * area / count
    for _ in range(count):
        add_lamp(draws, scene, size, flux * draws.log_uniform(0.3, 3.0), draws.choice(kinds))


def scaled_light(light: Light, factor: float) -> Light:
    """Return the light with its intensity times `factor`."""
    fields = values_of(light)
    fields["intensity"] = light.intensity * factor
    return type(light)(**fields)


def emitters(meshes: Sequence[Mesh]) -> list[Material]:
    """Return the materials of meshes that emit."""
    return list({id(m): m for mesh in meshes for m in mesh.materials if max(m.emission) > 0}.values())


def scaled_color(color: Rgb, factor: float) -> Rgb:
    """Return a colour times a factor."""
    return color[0] * factor, color[1] * factor, color[2] * factor
