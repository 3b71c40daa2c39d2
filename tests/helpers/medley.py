"""A scene with every kind of surface, for passes that must handle all of them."""

from __future__ import annotations

import numpy as np

from wgpu_gi.camera import Camera
from wgpu_gi.scene.built_in.shapes import box, grid, quad, sphere
from wgpu_gi.scene.scene import Environment, Image, Instance, Material, Mesh, PointLight, Scene, Texture

UNIT_SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)


def at(x, y=0.0, z=0.0, scale=(1.0, 1.0, 1.0), turn=0.0) -> np.ndarray:
    """Return a matrix that scales, rotates about Y and translates."""
    matrix = np.eye(4)
    c, s = np.cos(turn), np.sin(turn)
    matrix[:3, :3] = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) * scale
    matrix[:3, 3] = (x, y, z)
    return matrix


def smooth(mesh: Mesh) -> Mesh:
    """Give a ball around the origin the normals of a sphere."""
    mesh.normals = (mesh.positions / np.linalg.norm(mesh.positions, axis=1, keepdims=True)).astype(np.float32)
    return mesh


def noise(seed: int) -> Image:
    """Return random pixels."""
    return Image(np.random.default_rng(seed).integers(0, 256, (8, 8, 4)).astype(np.uint8))


def medley() -> Scene:
    """Return a scene with mirrored instances, vertex colours, textures, normal maps, masks, emitters and unlit."""
    rng = np.random.default_rng(0)
    tiles = Texture(noise(1), offset=(0.3, -0.2), scale=(3.0, 2.0), rotation=0.5, wrap_u="mirror")
    bumpy = Texture(Image((np.array([90, 90, 190, 0]) + rng.integers(0, 65, (8, 8, 4))).astype(np.uint8)))
    holes = Texture(noise(2), filter="nearest", wrap_v="clamp", scale=(1.0, 2.0), texcoord=1)

    floor = grid(8.0, 2, Material("floor", base_color_texture=tiles, normal_texture=bumpy, roughness=0.6))
    floor.texcoords0 = (floor.positions[:, [0, 2]] * 0.3).astype(np.float32)
    ball = smooth(sphere(subdivisions=2, material=Material("ball", (0.9, 0.5, 0.2, 1.0), metallic=1.0, roughness=0.3)))
    bumps = smooth(sphere(subdivisions=2, material=Material("bumps", (0.2, 0.5, 0.9, 1.0), normal_texture=bumpy)))
    bumps.texcoords0 = bumps.positions[:, :2].copy()
    tangents = np.cross(bumps.normals, (0.3, 1, 0.2))
    bumps.tangents = np.c_[tangents, rng.choice([-1, 1], len(tangents))].astype(np.float32)
    colored = box((-0.5, 0, -0.5), (0.5, 1, 0.5), Material("colored", (0.9, 0.8, 0.7, 1.0), roughness=0.8))
    colored.colors = rng.random((8, 4)).astype(np.float32)
    # Masked by the texture and by the vertices' alpha.
    leaf = Material("leaf", base_color_texture=holes, alpha_mode="mask", alpha_cutoff=0.4, double_sided=True)
    sheet = quad((-1, 0, 0), (2, 0, 0), (0, 2, 0), leaf)
    sheet.texcoords1 = UNIT_SQUARE
    sheet.colors = np.array([(1, 1, 1, 1), (1, 1, 0, 0.5), (1, 0, 1, 1), (0, 1, 1, 1)], np.float32)
    lamp = quad((-1, 0, 0), (1, 0, 0), (0, 1, 0), Material("lamp", emission=(4.0, 3.0, 2.0)))
    panel = Material("panel", emission=(1.0, 2.0, 3.0), double_sided=True, emission_texture=tiles)
    screen = quad((-1, 0, 0), (1, 0, 0), (0, 1, 0), panel)
    screen.texcoords0 = UNIT_SQUARE
    sign = quad((0, 0, 0), (1, 0, 0), (0, 0.5, 0), Material("sign", (0.1, 0.9, 0.4, 1.0), unlit=True))

    instances = [
        Instance(floor, name="floor"),
        Instance(ball, at(-1.5, 0.9, 0.5, (0.6, 0.9, 0.6), 0.4), "left"),
        Instance(ball, at(1.2, 0.5, 1.5, (-0.5, 0.5, 0.5)), "right"),
        Instance(bumps, at(0, 1.0, -1.0)),
        Instance(bumps, at(2.6, 0.7, -1, (0.7, -0.7, 0.7), 1.0)),
        Instance(colored, at(-2.5, 0.05, 2, (-1, 1, 1), 0.5), "block"),
        Instance(sheet, at(0.5, 0.05, 2.2, turn=0.3)),
        Instance(sheet, at(-2.2, 0.05, -2, (-1, 1, 1), 2.8)),
        Instance(lamp, at(-0.5, 2.2, -2)),
        Instance(lamp, at(1.0, 2.2, -2, turn=np.pi)),
        Instance(screen, at(2.5, 2.2, -2, turn=np.pi)),
        Instance(sign, at(-2.5, 1.5, 1.5)),
    ]
    camera = Camera.look_at((0.3, 2.3, 6), (0, 0.9, 0), yfov_deg=50)
    return Scene(instances, [PointLight((1, 4, 3), 30.0)], Environment((0.2, 0.3, 0.4)), [camera])


def named(scene: Scene, name: str) -> Instance:
    """Return the instance with a name."""
    return next(i for i in scene.instances if i.name == name)
