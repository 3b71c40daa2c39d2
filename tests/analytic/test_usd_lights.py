"""Lights of OpenUSD stages on a floor: the irradiance that UsdLux's quantities give, in any unit, either axis up.

E of a matte floor of albedo 1/2 below the light shows as the radiance L = E / (2 pi).
"""

from __future__ import annotations

import math

import pytest
from helpers.pictures import assert_mean, shoot

import wgpu_gi as gi
from wgpu_gi.scene.load import load

pytest.importorskip("pxr")
from pxr import Sdf, Usd, UsdGeom, UsdLux, UsdShade

HEIGHT = 2.0  # of the light above the floor, in the stage's units
LEVEL = 5.0


def corner(x, y):
    """Return the form factor of a differential element to a parallel rectangle with a corner above it, Howell C-11."""
    a, b = math.hypot(1, x), math.hypot(1, y)
    return (x / a * math.atan(y / a) + y / b * math.atan(x / b)) / (2 * math.pi)


# Irradiance below the light, over the radiance that USD's inputs give.
CASES = {
    ("DistantLight", "angle=10"): math.pi * math.sin(math.radians(5)) ** 2,
    ("DistantLight", "angle=10 normalize=1"): 1.0,
    ("SphereLight", "radius=0.5"): math.pi * (0.5 / HEIGHT) ** 2,
    ("SphereLight", "radius=0.5 normalize=1"): math.pi * (0.5 / HEIGHT) ** 2 / (4 * math.pi * 0.5**2),
    ("SphereLight", "radius=0.5 point=1"): math.pi * (0.5 / HEIGHT) ** 2,
    ("SphereLight", "radius=0 point=1 normalize=1"): 0.25 / HEIGHT**2,
    ("DiskLight", "radius=1"): math.pi / (1 + HEIGHT**2),
    ("DiskLight", "radius=1 normalize=1"): 1 / (1 + HEIGHT**2),
    ("RectLight", "width=2 height=3"): 4 * math.pi * corner(1 / HEIGHT, 1.5 / HEIGHT),
    ("RectLight", "width=2 height=3 normalize=1"): 4 * math.pi * corner(1 / HEIGHT, 1.5 / HEIGHT) / 6,
    ("DomeLight", ""): math.pi,
}


def write(path, kind, options, unit, up):
    """Write a floor and a light above it that shines down."""
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, unit)
    UsdGeom.SetStageUpAxis(stage, up)
    floor = UsdGeom.Plane.Define(stage, "/floor")
    floor.CreateAxisAttr(up)
    floor.CreateWidthAttr(8)
    floor.CreateLengthAttr(8)
    material = UsdShade.Material.Define(stage, "/matte")
    shader = UsdShade.Shader.Define(stage, "/matte/surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set((0.5, 0.5, 0.5))
    shader.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(1.0)
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    UsdShade.MaterialBindingAPI.Apply(floor.GetPrim()).Bind(material)
    light = getattr(UsdLux, kind).Define(stage, "/light")
    light.CreateIntensityAttr(LEVEL / 4)
    light.CreateExposureAttr(2.0)
    for option in options.split():
        name, value = option.split("=")
        create = light.CreateTreatAsPointAttr if name == "point" else getattr(light, f"Create{name.capitalize()}Attr")
        create(bool(int(value)) if name in ("point", "normalize") else float(value))
    # Lights shine along -Z.
    light.AddTranslateOp().Set((0, HEIGHT, 0) if up == "Y" else (0, 0, HEIGHT))
    if up == "Y":
        light.AddRotateXOp().Set(-90.0)
    stage.GetRootLayer().Save()


@pytest.mark.parametrize(("kind", "options"), CASES)
@pytest.mark.parametrize(("unit", "up"), [(1.0, "Y"), (0.01, "Z")])
def test_irradiance_below_the_light(tmp_path, kind, options, unit, up):
    """1.5 %: three standard errors of the sphere light, half of whose samples fall on its far side."""
    write(tmp_path / "s.usda", kind, options, unit, up)
    scene = load(tmp_path / "s.usda")
    # A narrow view of the point below the light, from the side.
    camera = gi.Camera.look_at((3.0 * unit, 1.2 * unit, 0.0), (0.0, 0.0, 0.0), yfov_deg=0.5)
    buffers = shoot(scene, (8, 8), camera=camera, spp=2048 if kind == "SphereLight" else 256)
    assert_mean(buffers, 0.5 / math.pi * LEVEL * CASES[kind, options], bound=0.015)
