"""Rough walls and solid glass in every technique, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.pictures import looking
from helpers.techniques import picture

from wgpu_gi.scene.built_in.scenes import matte
from wgpu_gi.scene.built_in.shapes import box, grid, quad, sphere
from wgpu_gi.scene.scene import DirectionalLight, Environment, Instance, Material, PointLight, Scene

# All deferred techniques share the pass; compiling the rest of them takes seconds.
TECHNIQUES = ("none", *(pytest.param(name, marks=pytest.mark.slow) for name in ("many-light", "ssdo", "ssil", "ssao")))
SIZE = (8, 8)
# Without reflections, as glass whose index of refraction is 1.
CLEAR = {"roughness": 0.0, "specular": 0.0, "transmission": 1.0}
RADIANCE = np.array((3.0, 2.0, 1.0))


def lit_wall(depth=-2.0):
    """A wall at z = `depth` that emits RADIANCE and reflects nothing."""
    material = Material("wall", (0.0, 0.0, 0.0, 1.0), emission=tuple(RADIANCE), specular=0.0)
    return Instance(quad((-3, -3, depth), (6, 0, 0), (0, 6, 0), material))


def seen_along_z(instances, technique, **fields):
    """The picture of the 2 m about the origin, from the front."""
    camera = looking((0, 0, -1), (0, 0, 5), 2.0)
    return picture(technique, Scene(instances), SIZE, camera=camera, **fields)["radiance"]


@pytest.mark.parametrize("technique", TECHNIQUES)
def test_a_slab_absorbs_by_beers_law(technique):
    """L = L_wall exp(-d ln(1 / c) / d_c)."""
    volume = {"thickness": 1.0, "attenuation_color": (0.5, 0.25, 0.8), "attenuation_distance": 0.4}
    slab = Instance(box((-2, -2, -0.5), (2, 2, 0.5), Material("slab", **CLEAR, **volume, ior=1.7)))
    got = seen_along_z([slab, lit_wall()], technique)
    assert got == pytest.approx(np.broadcast_to(RADIANCE * np.array((0.5, 0.25, 0.8)) ** 2.5, got.shape), rel=2e-3)


@pytest.mark.parametrize("technique", TECHNIQUES)
def test_an_eye_inside_a_solid_sees_its_absorption(technique):
    """The eye is 0.4 m behind the surface: L = L_wall exp(-0.4 ln(1 / c) / d_c)."""
    volume = {"thickness": 1.0, "attenuation_color": (0.5, 0.25, 0.8), "attenuation_distance": 0.4}
    slab = Instance(box((-2, -2, -0.5), (2, 2, 9.0), Material("slab", **CLEAR, **volume, ior=1.0)))
    got = picture(technique, Scene([slab, lit_wall()]), SIZE, camera=looking((0, 0, -1), (0, 0, -0.1), 2.0))["radiance"]
    assert got == pytest.approx(np.broadcast_to(RADIANCE * np.array((0.5, 0.25, 0.8)), got.shape), rel=2e-3)


@pytest.mark.parametrize("technique", TECHNIQUES)
def test_a_ball_of_the_index_of_air_is_invisible(technique):
    ball = sphere((0, 0, 0), 0.8, 3, Material("ball", **CLEAR, thickness=1.0, ior=1.0))
    ball.normals = ball.positions / np.linalg.norm(ball.positions, axis=1, keepdims=True)
    got = seen_along_z([Instance(ball), lit_wall()], technique)
    assert got == pytest.approx(np.broadcast_to(RADIANCE, got.shape), rel=1e-3)


@pytest.mark.parametrize("pictured", [False, True])
@pytest.mark.parametrize("technique", TECHNIQUES)
def test_a_rough_wall_in_a_furnace_shows_its_color(technique, pictured):
    """Without reflections a wall passes or scatters all light, by its colour: L = c L_sky."""
    color = (0.9, 0.6, 0.3)
    material = Material("wall", (*color, 1.0), roughness=0.6, specular=0.0, transmission=0.7)
    wall = quad((-3, -3, 0), (6, 0, 0), (0, 6, 0), material)
    sky = Environment(image=np.ones((4, 8, 3), np.float32)) if pictured else Environment()
    camera = looking((0, 0, -1), (0, 0, 5), 2.0)
    got = picture(technique, Scene([Instance(wall)], environment=sky), SIZE, camera=camera, frames=32)
    assert got["radiance"].mean((0, 1)) == pytest.approx(np.array(color), rel=0.02)


@pytest.mark.parametrize("technique", TECHNIQUES)
@pytest.mark.parametrize("light", [DirectionalLight((0, -1, 0), 3.0), PointLight((0, 3, 0), intensity=9.0)])
def test_a_slab_casts_a_tinted_shadow(technique, light):
    """E = E_0 exp(-d ln(1 / c) / d_c): shadow rays pass a solid straight on, and absorb by the way inside it."""
    volume = {"thickness": 1.0, "attenuation_color": (0.5, 0.25, 0.8), "attenuation_distance": 0.4}
    slab = Instance(box((-2, 1, -2), (2, 1.5, 2), Material("slab", **CLEAR, **volume, ior=1.7)))
    floor = Instance(grid(6.0, material=matte(0.5)))
    camera = looking((0, -1, 0), (0, 0.5, 0), 0.05)
    lit, shadowed = (
        picture(technique, Scene(instances, lights=[light]), (4, 4), camera=camera, bounces=0)["direct"].mean((0, 1))
        for instances in ([floor], [slab, floor])
    )
    assert shadowed / lit == pytest.approx(np.array((0.5, 0.25, 0.8)) ** 1.25, rel=5e-3)
