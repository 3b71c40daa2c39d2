"""Normal-mapped floors at grazing views: no pixel is black because its normal faces away from the viewer."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.pictures import shoot

from wgpu_gi.camera import Camera
from wgpu_gi.scene.scene import DirectionalLight, Environment, Image, Instance, Material, Mesh, Scene, Texture

SIDE = 128  # texels
SUN = np.array([-0.3, 0.5, -0.6]) / np.linalg.norm([-0.3, 0.5, -0.6])  # behind the floor, as the viewer sees it


def bumps(name):
    """Heights of a map (SIDE, SIDE) over its width."""
    y, x = np.mgrid[:SIDE, :SIDE] / SIDE
    if name == "waves":
        return 0.04 * np.sin(8 * np.pi * x) * np.sin(8 * np.pi * y)
    if name == "ripples":
        return 0.03 * np.sin(12 * np.pi * x)
    # Bricks with sloped joints.
    along, up = (4 * x + 0.5 * (np.floor(8 * y) % 2)) % 1, (8 * y) % 1
    joint = np.minimum(2 * np.minimum(along, 1 - along), np.minimum(up, 1 - up))
    return 0.04 * np.clip(joint / 0.12, 0, 1)


def normals_of(heights):
    """Unit normals (SIDE, SIDE, 3) as the map stores them: +Y up in the picture."""
    right, down = (np.roll(heights, -1, axis) - np.roll(heights, 1, axis) for axis in (1, 0))
    v = np.stack([-right * SIDE / 2, down * SIDE / 2, np.ones_like(right)], -1)
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def floor(name, degrees, *, metallic=0.0, environment=None, below=False):
    """A floor of 4 x 4 m with 4 x 4 maps, seen from `degrees` above it; the picture shows nothing else."""
    code = np.round((normals_of(bumps(name)) * 0.5 + 0.5) * 255).astype(np.uint8)
    pixels = np.dstack([code, np.full((SIDE, SIDE, 1), 255, np.uint8)])
    texture = Texture(Image(pixels))
    material = Material(base_color=(1, 1, 1, 1), metallic=metallic, roughness=0.6, normal_texture=texture)
    corners = np.array([(-2, 0, 2), (2, 0, 2), (2, 0, -2), (-2, 0, -2)], np.float32)
    mesh = Mesh(
        positions=corners,
        triangles=np.array([(0, 1, 2), (0, 2, 3)], np.uint32),
        normals=np.tile(np.array([0, 1, 0], np.float32), (4, 1)),
        texcoords0=np.array([(0, 4), (4, 4), (4, 0), (0, 0)], np.float32),
        materials=[material],
    )
    slope = np.radians(degrees) * (-1 if below else 1)
    camera = Camera.look_at(6 * np.array([0.05, np.sin(slope), np.cos(slope)]), (0, 0, 0))
    camera.yfov = 2 * np.arctan(1.2 * np.sin(abs(slope)) / 6)
    lights = [] if environment else [DirectionalLight(-SUN * (1, -1 if below else 1, 1), np.pi)]
    return Scene([Instance(mesh)], lights, environment, [camera])


def facing_away(name):
    """The share of a map's normals that the sun does not reach."""
    n = normals_of(bumps(name))
    return float((np.stack([n[..., 0], n[..., 2], -n[..., 1]], -1) @ SUN < 0.03).mean())


@pytest.mark.parametrize("gi", ["none", "path"])
@pytest.mark.parametrize("degrees", [0.5, 3.0, 15.0])
@pytest.mark.parametrize("name", ["waves", "ripples", "bricks"])
def test_only_pixels_that_face_away_from_the_sun_are_black(gi, name, degrees):
    counts = {"spp": 4, "bounces": 0} if gi == "path" else {}
    for metallic in (0.0, 1.0):
        scene = floor(name, degrees, metallic=metallic)
        radiance = shoot(scene, (64, 36), show=("radiance",), gi=gi, diffuse=False, **counts)["radiance"].mean(-1)
        black = float((radiance < 0.02 * np.median(radiance)).mean())
        assert black < facing_away(name) + 0.01


def test_bumps_seen_from_below_are_not_black():
    radiance = shoot(floor("ripples", 3.0, below=True), (64, 36), show=("radiance",), spp=4, bounces=0, diffuse=False)
    assert (radiance["radiance"] > 0).all()


@pytest.mark.parametrize("metallic", [0.0, 1.0])
@pytest.mark.parametrize("degrees", [1.0, 10.0])
def test_white_bumps_under_a_white_sky_vanish(metallic, degrees):
    """White furnace: turned normals keep the energy."""
    scene = floor("waves", degrees, metallic=metallic, environment=Environment(color=(1, 1, 1)))
    shown = shoot(scene, (64, 36), spp=64, bounces=2, diffuse=False)
    assert abs(shown["radiance"].mean() - 1) < 0.01
