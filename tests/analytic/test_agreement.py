"""Uniform light of radiance 1 in three forms gives one picture: the sampling strategies of the path tracer agree."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.pictures import shoot

from wgpu_gi.camera import Camera
from wgpu_gi.scene.built_in.scenes import matte
from wgpu_gi.scene.built_in.shapes import box, grid, sphere
from wgpu_gi.scene.scene import Environment, Image, Instance, Material, Scene, Texture


def objects():
    """A floor with bumps, a smooth-shaded and mirrored plastic ball, a rough metal block, a masked sheet."""
    rng = np.random.default_rng(0)
    bumps = np.concatenate([rng.integers(60, 195, (8, 8, 2)), np.full((8, 8, 1), 230), np.full((8, 8, 1), 255)], -1)
    holes = np.full((4, 4, 4), 255)
    holes[::2, ::2, 3] = 0
    floor = grid(3.0, material=Material("floor", (0.8, 0.7, 0.6, 1.0), normal_texture=_texture(bumps)))
    ball = sphere((0, 0, 0), 0.4, 3, Material("plastic", (0.2, 0.3, 0.9, 1.0), roughness=0.3))
    ball.normals = ball.positions / np.linalg.norm(ball.positions, axis=1, keepdims=True)
    block = box((-0.3, 0, -0.3), (0.3, 0.8, 0.3), Material("metal", (0.9, 0.6, 0.3, 1.0), metallic=1.0, roughness=0.5))
    mask = Material("mask", (0.5, 0.9, 0.5, 1.0), alpha_mode="mask", base_color_texture=_texture(holes))
    sheet = grid(0.8, material=mask)
    for mesh in (floor, sheet):
        mesh.texcoords0 = (mesh.positions[:, [0, 2]] * 0.4).astype(np.float32)
    mirrored = np.diag([-1.0, 1.2, 1.0, 1.0])
    mirrored[:3, 3] = 0.5, 0.5, 0.3
    places = [np.eye(4) for _ in range(3)]
    places[0][:3, 3], places[1][:3, 3], places[2][:3, 3] = (-0.7, 0, -0.2), (0, 1.0, 0.5), (0.9, 0, -0.9)
    return [
        Instance(floor),
        Instance(ball, mirrored),
        Instance(block, places[0]),
        Instance(block, places[2]),
        Instance(sheet, places[1]),
    ]


def _texture(rgba):
    return Texture(Image(rgba.astype(np.uint8)))


def sources():
    """Radiance 1 from everywhere: found by samples of the BRDF, of a picture, and of emitting triangles."""
    shell = sphere((0, 0.5, 0), 4.0, 2, matte(0.0, "shell", 1.0, double_sided=False), inward=True)
    return {
        "constant": Scene(objects(), environment=Environment()),
        "picture": Scene(objects(), environment=Environment(image=np.ones((4, 8, 3), np.float32))),
        "shell": Scene([*objects(), Instance(shell)]),
    }


@pytest.mark.slow
@pytest.mark.parametrize(("diffuse", "names"), [(True, ("picture", "shell")), (False, ("picture",))])
def test_uniform_light_is_the_same_from_sky_picture_and_emitter(diffuse, names):
    """Without `diffuse` the shell would have a coat and reflect, so it takes part only with `diffuse`."""
    camera = Camera.look_at((0.4, 1.6, 2.6), (0, 0.4, 0), yfov_deg=45.0)
    show = ("radiance", "direct", "indirect", "standard_error")
    got = {
        name: shoot(scene, (16, 12), spp=320, camera=camera, diffuse=diffuse, bounces=3, show=show)
        for name, scene in sources().items()
        if name in ("constant", *names)
    }
    expected = got["constant"]["direct"].mean((0, 1))
    for name in names:
        errors = [got[k]["standard_error"] for k in (name, "constant")]
        noise = np.sqrt(sum((e**2).sum((0, 1)) for e in errors)) / errors[0][..., 0].size
        assert (2 * noise < 0.02 * expected).all()
        for layer, bound in (("direct", 0.015), ("indirect", 0.05)):
            off = got[name][layer].mean((0, 1)) / got["constant"][layer].mean((0, 1)) - 1
            assert (np.abs(off) < bound).all(), (name, layer, off)
