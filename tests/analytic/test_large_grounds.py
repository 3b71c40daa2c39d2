"""Shadows of small boxes on large ground quads, by closed form: rays start within the error of their point."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.pictures import shoot, translation

from wgpu_gi.camera import Camera
from wgpu_gi.scene.built_in.shapes import box, quad, sphere
from wgpu_gi.scene.scene import DirectionalLight, Instance, Scene

# Turns that leave no edge along an axis, or a plane close to one.
TILTS = {"level": (0.0, 0.0), "tilted": (0.7, 0.4), "almost level": (0.3, 1e-3)}


def turned(name):
    heading, slope = TILTS[name]
    about_y, about_x = np.eye(4), np.eye(4)
    about_y[[0, 0, 2, 2], [0, 2, 0, 2]] = np.cos(heading), np.sin(heading), -np.sin(heading), np.cos(heading)
    about_x[[1, 1, 2, 2], [1, 2, 1, 2]] = np.cos(slope), -np.sin(slope), np.sin(slope), np.cos(slope)
    return about_x @ about_y


def box_on_ground(ground, side, tilt="level", at=(0.0, 0.0), shift=(0.0, 0.0, 0.0)):
    """A box of `side` on a quad of `ground` metres, lit along +X from 45 degrees; the camera above sees its shadow.

    Of the picture's width, two sides, the box takes the first quarter, its shadow the next half.
    """
    pose = translation(*shift) @ turned(tilt)
    here = pose @ translation(at[0], 0, at[1])
    floor = quad((-ground / 2, 0, ground / 2), (ground, 0, 0), (0, 0, -ground))
    lump = box((-side / 2, 0, -side / 2), (side / 2, side, side / 2))
    place = here[:3] @ [[side, side], [8 * side, 0], [0, 0], [1, 1]]
    camera = Camera.look_at(place[:, 0], place[:, 1], here[:3, :3] @ (0, 0, -1.0))
    camera.orthographic_height = 2 * side * 8 / 200
    sun = DirectionalLight(here[:3, :3] @ (1.0, -1.0, 0.0), np.pi)
    return Scene([Instance(floor, pose), Instance(lump, here)], [sun], None, [camera])


def assert_shadow(scene, gi):
    counts = {"spp": 1, "bounces": 0} if gi == "path" else {}
    radiance = shoot(scene, (200, 8), show=("radiance",), gi=gi, **counts)["radiance"][..., 0]
    dark = radiance < 1e-3
    assert not dark[:, :49].any() and dark[:, 51:149].all() and not dark[:, 151:].any(), dark.mean(0)


@pytest.mark.parametrize("gi", ["none", "path"])
@pytest.mark.parametrize("tilt", TILTS)
@pytest.mark.parametrize(("ground", "side"), [(1.0, 1e-4), (1e2, 1e-2), (1e4, 1.0), (1e6, 1.0), (1e6, 1e3)])
def test_a_box_keeps_its_shadow_on_any_ground(gi, tilt, ground, side):
    """The shadow is right within half a percent of its length, and neither box nor ground shadows itself."""
    assert_shadow(box_on_ground(ground, side, tilt), gi)


@pytest.mark.parametrize("gi", ["none", "path"])
@pytest.mark.parametrize("shift", [(0.0, 0.0, 0.0), (1e7, -2e6, 3e6)])
def test_a_box_far_from_the_middle_of_the_ground(gi, shift):
    assert_shadow(box_on_ground(1e6, 1.0, "tilted", (3.1e5, 1.7e5), shift), gi)


@pytest.mark.parametrize("tilt", ["level", "tilted"])
@pytest.mark.parametrize("ground", [1e5, 1e6])
def test_rasterised_pictures_of_large_grounds_have_no_holes(ground, tilt):
    """A wide picture, whose edges cut through the ground's triangles, agrees with camera rays."""
    scene = box_on_ground(ground, 1.0, tilt, at=(0.4, 0.1))
    pose = turned(tilt)[:3, :3]
    camera = Camera.look_at(pose @ (0.2, 2.4, 4.0), pose @ (-0.3, 0.3, 0.2), pose @ (0, 1.0, 0), yfov_deg=45)
    raster, rays = (
        shoot(scene, (640, 36), show=("radiance",), camera=camera, gi=gi, **counts)["radiance"][..., 0]
        for gi, counts in (("none", {}), ("path", {"spp": 1, "bounces": 0}))
    )
    assert (rays > 0).mean() > 0.5
    assert (np.abs(raster - rays) > 0.01 * rays.max()).mean() < 1e-3


@pytest.mark.parametrize("gi", ["none", "path"])
@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_balls_under_grazing_light_do_not_shadow_themselves(gi, size):
    """Flat facets lit down to half a degree: all that face the sun are lit, as by the cosine law."""
    ball = sphere(radius=size, subdivisions=4)
    ball.normals = None
    towards = np.array([0.2, 0.9, 0.4]) / np.linalg.norm([0.2, 0.9, 0.4])
    camera = Camera.look_at(size * np.array([4.0, 0.5, -1.0]), (0, 0, 0), yfov_deg=30)
    scene = Scene([Instance(ball)], [DirectionalLight(-towards, np.pi)], None, [camera])
    counts = {"spp": 1, "bounces": 0} if gi == "path" else {}
    shown = shoot(scene, (96, 96), show=("radiance", "normal"), gi=gi, **counts)
    cosine = shown["normal"][..., :3] @ towards
    lit = cosine > 0.01
    assert lit.sum() > 1500
    radiance = shown["radiance"][lit][:, 0]
    # A pixel on an edge may show one facet's normal and the other's light.
    assert (radiance > 0.9 * cosine[lit]).all() and abs(radiance.mean() / cosine[lit].mean() - 1) < 1e-3
    assert (shown["radiance"][cosine < -0.01] == 0).all()
