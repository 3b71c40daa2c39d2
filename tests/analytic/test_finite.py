"""No NaN, infinity or negative radiance in any buffer, whatever the scene."""

from __future__ import annotations

import math

import numpy as np
import pytest

from wgpu_gi.camera import Camera
from wgpu_gi.renderer import Renderer, Settings
from wgpu_gi.scene import builtin
from wgpu_gi.scene.builtin import matte
from wgpu_gi.scene.scene import (
    DirectionalLight,
    Environment,
    Image,
    Instance,
    Material,
    Mesh,
    PointLight,
    Scene,
    SpotLight,
    Texture,
)
from wgpu_gi.scene.shapes import box, grid, quad, sphere

ABOVE = Camera.look_at((0.3, 1.5, 1.5), (0, 0, 0))


def with_floor(*meshes, lights=(), environment=None):
    return Scene([Instance(m) for m in (grid(4.0), *meshes)], list(lights), environment, [ABOVE])


def degenerate():
    """Points, needles, repeated corners and an emitter without area among ordinary triangles."""
    lamp = matte(0.5, "lamp", 1.0)
    points = np.array([(0, 0.5, 0), (1, 0.5, 0), (0, 0.5, 1), (2, 0.5, 0), (0, 0.5, 0), (1, 0.5, 1e-30)], np.float32)
    triangles = np.array([(0, 1, 2), (0, 1, 3), (0, 4, 0), (5, 5, 5), (0, 1, 5)], np.uint32)
    material = np.array([0, 0, 1, 1, 1], np.uint32)
    return with_floor(Mesh(points, triangles, [matte(0.5), lamp], material), lights=[PointLight((0, 1, 0))])


def bad_attributes():
    """Normals, tangents and texture coordinates that say nothing; a normal map without a direction."""
    grey = Texture(Image(np.full((2, 2, 4), 128, np.uint8)))
    mesh = quad(
        (-1, 0.2, 1), (2, 0, 0), (0, 0, -2), Material(normal_texture=grey, base_color_texture=grey, roughness=0.2)
    )
    mesh.normals = np.array([(0, 1, 0), (0, -1, 0), (0, 1, 0), (1e-30, 0, 0)], np.float32)
    mesh.tangents = np.array([(0, 1, 0, 1), (0, 0, 0, 1), (1e-30, 0, 0, -1), (0, -1, 0, 0)], np.float32)
    mesh.texcoords0 = np.array([(0, 0), (0, 0), (1e30, -1e30), (5e9, 3)], np.float32)
    return with_floor(mesh, lights=[PointLight((0, 1, 0))], environment=Environment())


def lights_on_surfaces():
    spot = SpotLight((0.5, 0, 0.5), (0, -1, 0), 0.3, 0.3, 5.0)
    lights = [PointLight((0, 0, 0)), PointLight((0.3, 1e-6, 0), 1e6), spot, DirectionalLight((1, 0, 0), 2.0)]
    return with_floor(box((-0.3, 0, -0.3), (0.3, 0.3, 0.3), matte(0.9, emission=1.0)), lights=lights)


def mirrors():
    """Smooth metal facing itself, with a light in its focus."""
    mirror = Material("mirror", metallic=1.0, roughness=0.0)
    plates = [quad((-1, y, 1), (2, 0, 0), (0, 0, -2), mirror) for y in (0.1, 0.2, 2.0)]
    ball = sphere((0, 1, 0), 0.3, 3, mirror)
    ball.normals = ball.positions - np.float32((0, 1, 0))
    return with_floor(*plates, ball, lights=[PointLight((0, 1.5, 0)), DirectionalLight((0.1, -1, 0))])


def extremes():
    """Bright and dark by many orders, white everywhere, a sky with a sun of one pixel."""
    image = np.full((8, 16, 3), 1e-6, np.float32)
    image[2, 3] = 1e7
    white = Material("white", roughness=0.0)
    lights = [PointLight((0, 1, 0), 1e9), PointLight((1, 1, 0), 1e-9), SpotLight((0, 2, 0), (0, -1, 0), 0.0, 1e-3, 1e8)]
    return with_floor(box((-0.3, 0, -0.3), (0.3, 0.3, 0.3), white), lights=lights, environment=Environment(image=image))


def inside():
    """The camera lies exactly on a wall of a glowing room."""
    scene = builtin.closed_box(albedo=1.0)
    scene.cameras = [Camera.look_at((2.0, 0, 0), (0, 0, 0.1))]
    return scene


SCENES = {
    "degenerate triangles": degenerate,
    "bad attributes": bad_attributes,
    "lights on surfaces": lights_on_surfaces,
    "mirrors": mirrors,
    "extremes": extremes,
    "camera on a wall": inside,
    "nothing": lambda: Scene(environment=Environment(image=np.zeros((2, 4, 3), np.float32))),
    "black lights": lambda: with_floor(lights=[PointLight((0, 1, 0), 0.0)], environment=Environment((0.0, 0.0, 0.0))),
}


@pytest.mark.parametrize("name", SCENES)
def test_buffers_are_finite(name):
    settings = Settings(spp=32)
    settings.path.samples_per_run = 16
    renderer = Renderer(SCENES[name](), size=(24, 16), settings=settings)
    renderer.run(check=True)
    for buffer in ("radiance", "direct", "indirect", "emission", "standard_error", "albedo", "depth"):
        values = renderer.read_back(buffer)
        assert np.isfinite(values).all() and (values >= 0).all(), buffer
    normal = np.linalg.norm(renderer.read_back("normal"), axis=-1)
    assert np.allclose(normal[renderer.read_back("depth") > 0], 1, atol=1e-5)
    assert math.isfinite(float(renderer.read_back("position").sum()))
