"""Converts the lights of a stage (UsdLux, "LightAPI: Quantities and Units") to this package's, with their radiance.

A light emits L = intensity * 2^exposure * color * diffuse * blackbody(temperature), here in W/(m2 sr). With
`normalize`, L is divided by the light's area in the stage's units of length, or for a distant light by
pi sin^2(angle / 2). Hence
    distant light:  E = pi L sin^2(angle / 2) on a plane facing it;  E = L without an angle
    point or spot:  I = pi r^2 L of a sphere of radius r
and rectangles, discs, spheres and cylinders become emitters of radiance L.

Departures: a distant light has sharp shadows. Spheres with a cone become spot lights. The cones of other lights, IES
profiles, light filters and light linking are not used. The notes say so.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...float_limits import LARGEST_LIGHT, MAX_COORDINATE
from ..files.raw_mesh import RawMesh, scene_from_raw
from ..scene import DirectionalLight, Instance, Material, PointLight, Scene, SpotLight
from ..transforms import Matrix, invertible
from .dome import add_dome
from .gprims import revolved
from .prims import Placed
from .stage import Stage, number, triple
from .textures import Textures

Color = tuple[float, float, float]

_WIDE_SUN = math.radians(2.0)  # an angle whose soft shadows would be seen
_SIDES = 24  # of round emitters, which have the exact area


def add_lights(stage: Stage, placed: list[Placed], scene: Scene) -> None:
    """Add lights, emitters and the environment to a scene."""
    from pxr import UsdLux

    textures = Textures(stage)
    for prim, stage_from_prim in placed:
        matrix = stage.world_from_stage @ stage_from_prim
        radiance = radiance_of(prim, stage)
        if not max(radiance) > 0:
            continue
        light: Any = None
        if prim.IsA(UsdLux.DistantLight):
            light = _distant(prim, stage, matrix, radiance)
        elif prim.GetTypeName() in ("DomeLight", "DomeLight_1"):
            add_dome(prim, stage, matrix, radiance, textures, scene)
        elif prim.IsA(UsdLux.SphereLight):
            light = _sphere(prim, stage, matrix, stage_from_prim, radiance)
        else:
            light = _area(prim, stage, matrix, stage_from_prim, radiance)
        _note_unused(prim, stage)
        if isinstance(light, Instance):
            scene.instances.append(light)
        elif light is not None:
            scene.lights.append(light)


def radiance_of(prim: Any, stage: Stage) -> Color:
    """Return the radiance of a light before normalisation."""
    from pxr import UsdLux

    api, time = UsdLux.LightAPI(prim), stage.time
    level = number(api.GetIntensityAttr(), time, 1.0, low=0.0) * number(api.GetDiffuseAttr(), time, 1.0, low=0.0)
    exposure = number(api.GetExposureAttr(), time, 0.0, -1000.0, 1000.0)
    color = triple(api.GetColorAttr(), time, (1.0, 1.0, 1.0))
    if api.GetEnableColorTemperatureAttr().Get(time):
        kelvin = UsdLux.BlackbodyTemperatureAsRgb(number(api.GetColorTemperatureAttr(), time, 6500.0, 1000.0, 10000.0))
        color = color[0] * kelvin[0], color[1] * kelvin[1], color[2] * kelvin[2]
    return _scaled(color, level * 2.0**exposure)


def _scaled(color: Color, factor: float) -> Color:
    red, green, blue = (min(c * factor, LARGEST_LIGHT) for c in color)
    return red, green, blue


def _is_normalized(prim: Any, stage: Stage) -> bool:
    from pxr import UsdLux

    return bool(UsdLux.LightAPI(prim).GetNormalizeAttr().Get(stage.time))


def _distant(prim: Any, stage: Stage, matrix: Matrix, radiance: Color) -> DirectionalLight | None:
    """Return a distant light, which shines along its -Z."""
    half = math.radians(number(prim.GetAttribute("inputs:angle"), stage.time, 0.53, 0.0, 360.0)) / 2
    solid_angle = math.pi * math.sin(min(half, math.pi / 2)) ** 2
    direction = -matrix[:3, 2]
    if not np.linalg.norm(direction) > 0:
        stage.damage(f"the light {prim.GetPath()} was left out: its direction is scaled to zero")
        return None
    if 2 * half > _WIDE_SUN:
        stage.note(
            f"the light {prim.GetPath()} has an angle of {math.degrees(2 * half):.3g} degrees; it is shown sharp"
        )
    irradiance = radiance if half == 0 or _is_normalized(prim, stage) else _scaled(radiance, solid_angle)
    x, y, z = (direction / np.linalg.norm(direction)).tolist()
    return DirectionalLight((x, y, z), 1.0, irradiance, prim.GetName())


def _sphere(prim: Any, stage: Stage, matrix: Matrix, stage_from_prim: Matrix, radiance: Color) -> Any:
    """Return a sphere light as an emitter, or as a point or spot if it is to be treated so, has no radius or a cone."""
    radius = number(prim.GetAttribute("inputs:radius"), stage.time, 0.5, low=0.0)
    as_point = bool(prim.GetAttribute("treatAsPoint").Get(stage.time)) or radius == 0.0
    cone = number(prim.GetAttribute("inputs:shaping:cone:angle"), stage.time, 90.0, 0.0, 180.0)
    if not as_point and cone >= 90.0:
        return _area(prim, stage, matrix, stage_from_prim, radiance)
    # The intensity of a sphere is its radiance times its cross-section; a normalised one has L / (4 pi r^2).
    scale = float(np.cbrt(abs(np.linalg.det(matrix[:3, :3]))))
    if _is_normalized(prim, stage):
        unit = float(np.linalg.norm(stage.world_from_stage[:3, 0]))
        section = 0.25 * unit * unit
    else:
        section = math.pi * (radius * scale) ** 2
        if radius == 0.0:
            stage.note(f"the light {prim.GetPath()} has no radius and no normalize, so it emits nothing")
            return None
    color = _scaled(radiance, section)
    x, y, z = matrix[:3, 3].tolist()
    if max(map(abs, (x, y, z))) > MAX_COORDINATE:
        stage.damage(f"the light {prim.GetPath()} was left out: it is out of range")
        return None
    direction = -matrix[:3, 2]
    if cone >= 90.0 or not np.linalg.norm(direction) > 0:
        return PointLight((x, y, z), 1.0, color, None, prim.GetName())
    softness = number(prim.GetAttribute("inputs:shaping:cone:softness"), stage.time, 0.0, 0.0, 1.0)
    outer = max(math.radians(cone), 1e-3)
    dx, dy, dz = (direction / np.linalg.norm(direction)).tolist()
    stage.note(f"the light {prim.GetPath()} is shown as a spot light")
    return SpotLight((x, y, z), (dx, dy, dz), outer * (1 - softness), outer, 1.0, color, None, prim.GetName())


def _area(prim: Any, stage: Stage, matrix: Matrix, stage_from_prim: Matrix, radiance: Color) -> Instance | None:
    """Return an emitter of a light's shape; None, with a note, if it has none."""
    raw = _shape(prim, stage)
    if raw is None or not len(raw.triangles):
        stage.note(f"the light {prim.GetPath()} was left out: {prim.GetTypeName()} is not supported, or has no area")
        return None
    if _is_normalized(prim, stage):
        corners = raw.positions[raw.triangles] @ stage_from_prim[:3, :3].T
        crosses = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = float(np.linalg.norm(crosses, axis=1).sum()) / 2
        radiance = _scaled(radiance, 1.0 / area if area > 0 else 0.0)
    black = (0.0, 0.0, 0.0, 1.0)
    raw.materials = [Material(name=prim.GetName(), base_color=black, emission=radiance)]
    part = scene_from_raw(raw, prim.GetName(), f"{stage.source}: {prim.GetPath()}", stage.notes).instances[0]
    placed = invertible(matrix @ part.world_from_local)
    if placed is None or not (np.abs(placed) < MAX_COORDINATE).all():
        stage.note(f"the light {prim.GetPath()} was left out: it is scaled to zero, or out of range")
        return None
    if np.linalg.det(placed[:3, :3]) < 0:
        stage.note(f"the light {prim.GetPath()} is mirrored")
    placed[3] = 0.0, 0.0, 0.0, 1.0
    return Instance(part.mesh, placed, prim.GetName())


def _shape(prim: Any, stage: Stage) -> RawMesh | None:
    """Return the surface of an area light in its own frame; rectangles and discs face -Z."""

    def size(name: str, default: float) -> float:
        return number(prim.GetAttribute(f"inputs:{name}"), stage.time, default, low=0.0)

    kind = str(prim.GetTypeName())
    if kind == "RectLight":
        w, h = size("width", 1.0) / 2, size("height", 1.0) / 2
        corners = np.array([[-w, -h, 0], [-w, h, 0], [w, h, 0], [w, -h, 0]])
        return RawMesh(corners, np.array([[0, 1, 2], [0, 2, 3]]))
    # Round shapes are polygons with the area of the round one.
    widening = math.sqrt(2 * math.pi / (_SIDES * math.sin(2 * math.pi / _SIDES)))
    if kind == "DiskLight":
        angle = np.linspace(0, -2 * np.pi, _SIDES, endpoint=False)
        rim = np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1) * size("radius", 0.5) * widening
        fan = np.stack([np.zeros(_SIDES - 2), np.arange(1, _SIDES - 1), np.arange(2, _SIDES)], 1).astype(np.int64)
        return RawMesh(rim, fan)
    if kind == "CylinderLight":
        radius, length = size("radius", 0.5), size("length", 1.0)
        outline = math.pi / (_SIDES * math.sin(math.pi / _SIDES))  # of the round one to that of the polygon
        radius *= outline
        return revolved([(radius, -length / 2, 1, 0), (radius, length / 2, 1, 0)], "X", _SIDES)
    if kind == "SphereLight":
        latitudes = np.radians(np.linspace(-90, 90, _SIDES // 2 + 1))
        ball = revolved([(c, s, c, s) for c, s in zip(np.cos(latitudes), np.sin(latitudes), strict=True)], "Z", _SIDES)
        corners = ball.positions[ball.triangles]
        crosses = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        surface = float(np.linalg.norm(crosses, axis=1).sum()) / 2
        ball.positions *= size("radius", 0.5) * math.sqrt(4 * math.pi / surface)
        return ball
    return None


def _note_unused(prim: Any, stage: Stage) -> None:
    """Note what a light has and this package does not use."""
    from pxr import UsdLux

    cone = prim.GetAttribute("inputs:shaping:cone:angle")
    if cone and cone.HasAuthoredValue() and not prim.IsA(UsdLux.SphereLight):
        stage.note(f"the light {prim.GetPath()}: its cone is not used")
    for name in ("inputs:shaping:ies:file", "inputs:texture:file"):
        attribute = prim.GetAttribute(name)
        if attribute and attribute.HasAuthoredValue() and "Dome" not in str(prim.GetTypeName()):
            stage.note(f"the light {prim.GetPath()}: {name.removeprefix('inputs:')} is not used")
