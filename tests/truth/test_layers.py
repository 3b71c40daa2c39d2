"""Layered materials and glass in deferred techniques, against the path tracer: a ball under a sky and a lamp."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.pictures import shoot

from wgpu_gi.camera import Camera
from wgpu_gi.measure.metrics import bias, relmse
from wgpu_gi.renderer import CameraSettings, Renderer, Settings
from wgpu_gi.scene.built_in.shapes import grid, quad, sphere
from wgpu_gi.scene.scene import Environment, Instance, Material, Scene

METAL = {"metallic": 1.0}
SOLID = {"transmission": 1.0, "thickness": 1.0, "attenuation_distance": 0.5, "attenuation_color": (0.4, 0.8, 0.6)}
COAT = {"clearcoat": 1.0, "clearcoat_roughness": 0.1}
CLOTH = {"sheen_color": (0.8, 0.8, 0.9), "sheen_roughness": 0.4}
MATERIALS = {
    "coat": Material("coat", (0.7, 0.1, 0.1, 1.0), roughness=0.6, **COAT),
    "cloth": Material("cloth", (0.1, 0.1, 0.3, 1.0), roughness=0.9, **CLOTH),
    "brushed": Material("brushed", (0.9, 0.8, 0.7, 1.0), roughness=0.4, anisotropy=0.8, **METAL),
    "diamond": Material("diamond", (0.2, 0.4, 0.6, 1.0), roughness=0.3, ior=2.4),
    "dull": Material("dull", (0.5, 0.5, 0.5, 1.0), roughness=0.4, specular=0.0),
    "layered": Material("layered", (0.6, 0.4, 0.2, 1.0), roughness=0.5, ior=1.8, anisotropy=0.6, **COAT, **CLOTH),
    "frosted": Material("frosted", (0.9, 0.95, 1.0, 1.0), roughness=0.4, transmission=1.0),
    "solid": Material("solid", (1.0, 1.0, 1.0, 1.0), roughness=0.0, **SOLID),
    "rough_solid": Material("rough_solid", (1.0, 1.0, 1.0, 1.0), roughness=0.3, **SOLID),
}
# Bias and relMSE of many-light, just above the measured values.
BOUNDS = {
    "coat": (0.02, 0.012),  # the mean over 8 seeds of 64 frames is +0.7 %, with a standard deviation of 0.6 %
    "cloth": (0.01, 0.005),
    "brushed": (0.018, 0.013),
    "diamond": (0.01, 0.006),
    "dull": (0.015, 0.005),
    "layered": (0.015, 0.012),
    "frosted": (0.025, 0.015),
    "solid": (0.015, 0.02),
    "rough_solid": (0.045, 0.035),
}
# Relative error of the mean under a constant sky: what layers leave each other is averaged.
SKY_BOUNDS = {"coat": 0.012, "cloth": 0.015, "brushed": 0.035, "diamond": 0.004, "dull": 0.004, "layered": 0.035}


def sky():
    """A picture that is dark below and has a bright and a coloured patch."""
    image = np.tile(np.linspace(1.5, 0.3, 32, dtype=np.float32)[:, None, None], (1, 64, 3))
    image[6:10, 10:16] += (6, 5, 4)
    image[4:12, 40:44] += (1, 2, 4)
    return Environment((0.3, 0.4, 0.6), image)


def ball_in_the_studio(name):
    """A ball on a floor before a red panel, under the sky and a lamp."""
    floor = grid(6.0, material=Material("floor", (0.6, 0.6, 0.55, 1.0)))
    panel = quad((-1.2, 0, -1.1), (1, 0, 0), (0, 1.4, 0), Material("panel", (0.75, 0.25, 0.2, 1.0)))
    lamp = quad(
        (0.7, 1.8, 0.3), (0.4, 0, 0), (0, 0, 0.4), Material("lamp", (0, 0, 0, 1.0), emission=(12.0, 11.0, 10.0))
    )
    ball = sphere((0, 0.52, 0), 0.5, 4, MATERIALS[name])
    ball.normals = ((ball.positions - (0, 0.52, 0)) / 0.5).astype(np.float32)
    return Scene([Instance(mesh) for mesh in (ball, floor, panel, lamp)], environment=sky())


def errors(name, technique, frames=24, size=(32, 24)):
    """Return bias and relMSE of the pixels that show the ball."""
    scene, camera = ball_in_the_studio(name), Camera.look_at((0.8, 1.1, 2.2), (0, 0.5, 0), yfov_deg=40)
    show = ("radiance", "standard_error", "instance")
    truth = shoot(scene, size, camera=camera, diffuse=False, jitter=True, spp=1024, show=show)
    renderer = Renderer(
        scene, size=size, camera=camera, settings=Settings(gi=technique, camera=CameraSettings(frames=frames))
    )
    renderer.run()
    mask = truth["instance"].reshape(size[1], size[0]) == 1
    got = renderer.read_back("radiance")[..., :3].astype(np.float64)
    return bias(got, truth["radiance"], mask), relmse(got, truth["radiance"], truth["standard_error"], mask)


@pytest.mark.slow
@pytest.mark.parametrize("name", BOUNDS)
def test_many_light_agrees_with_the_path_tracer(name):
    most_bias, most_error = BOUNDS[name]
    off, error = errors(name, "many-light")
    assert abs(off) <= most_bias
    assert error <= most_error


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=() if n == "layered" else pytest.mark.slow) for n in SKY_BOUNDS]
)
def test_a_sky_without_occlusion_is_reflected_as_by_the_path_tracer(name):
    """Under a constant sky, what lobes, sheen and coats of the deferred base reflect equals the path tracer's."""
    scene = Scene([Instance(grid(40.0, material=MATERIALS[name]))], environment=Environment((1.0, 0.8, 0.6)))
    camera = Camera.look_at((0, 1, 2), (0, 0.2, 0), yfov_deg=50)
    truth = shoot(scene, (8, 6), camera=camera, diffuse=False, spp=1024, bounces=0)
    got = shoot(scene, (8, 6), camera=camera, diffuse=False, gi="none", show=("radiance",))
    assert got["radiance"].mean((0, 1)) == pytest.approx(truth["radiance"].mean((0, 1)), rel=SKY_BOUNDS[name])
