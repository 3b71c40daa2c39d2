"""Spots from 0.05 to 90 degrees: full intensity inside the inner cone, the fall-off of KHR_lights_punctual outside."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers.pictures import shoot

from wgpu_gi.camera import Camera
from wgpu_gi.scene.built_in.shapes import quad
from wgpu_gi.scene.scene import Instance, Material, Scene, SpotLight
from wgpu_gi.techniques.deferred.direct import DirectSettings

HEIGHT, INTENSITY, ALBEDO = 4.0, 50.0, 0.5
AXIS = np.array([0.3, -1.0, 0.2]) / np.linalg.norm([0.3, -1.0, 0.2])
SIZE = (64, 36)
ANGLES = [0.05, 0.5, 2.9, 3.0, 20.0, 59.0, 61.0, 89.9, 90.0]
SETTINGS = {
    "rays": {"gi": "none"},
    "maps": {"gi": "none", "direct": DirectSettings(edges=False)},
    "path": {"gi": "path", "spp": 2, "bounces": 0},
    "ssdo": {"gi": "ssdo", "bounces": 0},
    "ssil": {"gi": "ssil", "bounces": 0},
    "many-light": {"gi": "many-light", "bounces": 0},
}


def lamp(outer, inner, position=(0.0, HEIGHT, 0.0), axis=AXIS):
    return SpotLight(position, axis, math.radians(inner), math.radians(outer), INTENSITY)


def floor_below(outer, inner):
    """A floor under a slanted spot; the camera looks straight down on 1.5 times the lit disc, at most 12 m wide."""
    above = np.array([0.0, HEIGHT, 0.0])
    middle = above + AXIS * HEIGHT / -AXIS[1]
    camera = Camera.look_at(middle + above, middle, (0, 0, -1))
    camera.orthographic_height = min(3 * HEIGHT * math.tan(math.radians(min(outer, 80))), 12)
    floor = quad((-20, 0, 20), (40, 0, 0), (0, 0, -40), Material(base_color=(ALBEDO, ALBEDO, ALBEDO, 1.0)))
    return Scene([Instance(floor)], [lamp(outer, inner)], None, [camera])


def expected(scene, outer, inner):
    """Radiance of the floor at the pixels' centres, and the fall-off's argument there, not clamped."""
    camera = scene.cameras[0]
    height, width = camera.orthographic_height, camera.orthographic_height * SIZE[0] / SIZE[1]
    x = camera.position[0] + ((np.arange(SIZE[0]) + 0.5) / SIZE[0] - 0.5) * width
    z = camera.position[2] + ((np.arange(SIZE[1]) + 0.5) / SIZE[1] - 0.5) * height
    point = np.stack(np.broadcast_arrays(x[None], 0.0, z[:, None]), -1)
    offset = point - (0, HEIGHT, 0)
    distance = np.linalg.norm(offset, axis=-1)
    # 1 - cos, without the cancellation of cosines near 1.
    versine = ((offset / distance[..., None] - AXIS) ** 2).sum(-1) / 2
    v_inner, v_outer = (2 * math.sin(math.radians(a) / 2) ** 2 for a in (inner, outer))
    argument = (v_outer - versine) / max(v_outer - v_inner, 1e-4 * v_outer)
    irradiance = INTENSITY * np.clip(argument, 0, 1) ** 2 * HEIGHT / distance**3
    return ALBEDO / math.pi * irradiance, argument


@pytest.mark.parametrize("technique", SETTINGS)
@pytest.mark.parametrize("outer", ANGLES)
def test_spots_light_the_floor_by_their_fall_off(outer, technique):
    for inner in (0.0, 0.9 * outer, outer):
        scene = floor_below(outer, inner)
        got = shoot(scene, SIZE, show=("radiance",), **SETTINGS[technique])["radiance"][..., 0]
        wanted, argument = expected(scene, outer, inner)
        # Where a step of float32 in the direction, 1.2e-7, changes the fall-off little: not at a hard edge.
        smooth = np.abs(argument) > 0.1 if inner < outer else np.abs(argument) > 300
        assert smooth.mean() > 0.8 and (wanted[smooth] > 0).any()
        off = np.abs(got - wanted)[smooth]
        assert off.max() < 0.01 * wanted.max(), f"inner {inner}: {off.max() / wanted.max():.4f}"


@pytest.mark.parametrize("gi", ["path", "many-light"])
@pytest.mark.parametrize("outer", [0.05, 0.5, 3.0, 20.0])
def test_the_bounce_of_a_spot_has_its_flux(outer, gi):
    """A wall far from the lit disc of a floor: E = rho Phi cos cos / (pi r^2), Phi the light of the whole cone."""
    inner = 0.9 * outer
    floor = quad((-3, 0, 3), (6, 0, 0), (0, 0, -6), Material(base_color=(ALBEDO, ALBEDO, ALBEDO, 1.0)))
    wall = quad((-30, 20, -40), (60, 0, 0), (0, 60, 0), Material(base_color=(ALBEDO, ALBEDO, ALBEDO, 1.0)))
    camera = Camera.look_at((0, 45, 0), (0, 45, -40), yfov_deg=2)
    scene = Scene([Instance(floor), Instance(wall)], [lamp(outer, inner, axis=(0.0, -1.0, 0.0))], None, [camera])
    counts = {"spp": 256} if gi == "path" else {}
    shown = shoot(scene, (16, 9), show=("radiance",), gi=gi, bounces=1, **counts)
    v_inner, v_outer = (2 * math.sin(math.radians(a) / 2) ** 2 for a in (inner, outer))
    flux = INTENSITY * 2 * math.pi * (v_inner + (v_outer - v_inner) / 3)
    distance = math.hypot(45, 40)
    irradiance = ALBEDO * flux * (45 / distance) * (40 / distance) / (math.pi * distance**2)
    assert shown["radiance"].mean() == pytest.approx(ALBEDO / math.pi * irradiance, rel=0.03)
