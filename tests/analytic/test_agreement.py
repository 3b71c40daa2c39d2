"""One kind of light in three guises gives one picture: every strategy of the path tracer has the same mean."""

from __future__ import annotations

import numpy as np
from helpers.pictures import shoot

from wgpu_gi.camera import Camera
from wgpu_gi.scene.builtin import matte
from wgpu_gi.scene.scene import Environment, Image, Instance, Material, Scene, Texture
from wgpu_gi.scene.shapes import box, grid, sphere


def things():
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


def test_constant_sky_pictured_sky_and_a_shining_shell():
    """Light of radiance 1 from everywhere: met by chance, drawn from a picture, and from emitting triangles."""
    shell = sphere((0, 0.5, 0), 4.0, 2, matte(0.0, "shell", 1.0, double_sided=False), inward=True)
    environments = {
        "constant": Scene(things(), environment=Environment()),
        "picture": Scene(things(), environment=Environment(image=np.ones((4, 8, 3), np.float32))),
        "shell": Scene([*things(), Instance(shell)]),
    }
    camera = Camera.look_at((0.4, 1.6, 2.6), (0, 0.4, 0), yfov_deg=45.0)
    got = {
        name: shoot(scene, (24, 16), spp=400, camera=camera, diffuse=False, bounces=3,
                    show=("radiance", "direct", "indirect", "standard_error"))
        for name, scene in environments.items()
    }
    truth = got["constant"]
    noise = np.sqrt(sum((g["standard_error"] ** 2).sum((0, 1)) for g in got.values())) / truth["radiance"][..., 0].size
    assert (2 * noise < 0.005 * truth["direct"].mean((0, 1))).all()
    for name in ("picture", "shell"):
        for layer in ("direct", "indirect"):
            a, b = (g[layer].mean((0, 1)) for g in (got[name], truth))
            assert np.allclose(a, b, rtol=0.01 if layer == "indirect" else 0.005), (name, layer, a / b - 1)
