"""The built-in scene `materials`: balls of layered materials, glass and blended panes, in a studio, to look at."""

from __future__ import annotations

import math

import numpy as np

from ...camera import Camera
from ..parts import Environment, Image, Instance, Material, Mesh, PointLight, Texture
from ..scene import Scene
from .shapes import grid, quad

RADIUS = 0.4
SPACING = 1.0  # metres between the centres of balls
SEGMENTS = 64  # around a ball
WHITE = (0.9, 0.9, 0.9, 1.0)

# The rows of balls, the farther one first.
ROWS = (
    (
        Material("plastic", (0.05, 0.2, 0.6, 1.0), roughness=0.35),
        Material("car paint", (0.5, 0.02, 0.02, 1.0), 0.6, 0.45, clearcoat=1.0, clearcoat_roughness=0.03),
        Material("velvet", (0.12, 0.01, 0.03, 1.0), sheen_color=(0.9, 0.35, 0.45), sheen_roughness=0.35),
        Material("brushed steel", (0.62, 0.6, 0.58, 1.0), 1.0, 0.4, anisotropy=0.9),
        Material("pearl", (0.8, 0.76, 0.7, 1.0), roughness=0.25, ior=1.9, specular_color=(1.0, 0.75, 0.9)),
        Material("chalk", (0.75, 0.75, 0.72, 1.0), roughness=0.9, specular=0.2),
    ),
    (
        Material("glass", WHITE, roughness=0.0, transmission=1.0, thickness=0.8),
        Material(
            "amber",
            WHITE,
            roughness=0.0,
            ior=1.55,
            transmission=1.0,
            thickness=0.8,
            attenuation_distance=0.25,
            attenuation_color=(0.9, 0.45, 0.08),
        ),
        Material("frosted glass", (0.85, 0.95, 0.9, 1.0), roughness=0.35, transmission=1.0, thickness=0.8),
        Material("soap bubble", WHITE, roughness=0.0, transmission=1.0),
        Material("ghost", (0.3, 0.8, 0.5, 0.4), roughness=0.5, alpha_mode="blend"),
        Material("lacquered gold", (1.0, 0.77, 0.34, 1.0), 1.0, 0.3, clearcoat=1.0),
    ),
)


def materials() -> Scene:
    """Two rows of balls on a tiled floor, a coloured pane and a veil before a wall; a lamp, a panel and a sky."""
    scene = Scene(environment=Environment((0.35, 0.4, 0.5), name="sky"))
    for row, kinds in enumerate(ROWS):
        for k, material in enumerate(kinds):
            matrix = np.eye(4)
            matrix[:3, 3] = (k - (len(kinds) - 1) / 2) * SPACING, RADIUS, (row - 0.5) * 1.2
            scene.instances.append(Instance(_ball(material), matrix, material.name))
    floor = grid(12.0, 12, Material("floor", roughness=0.6, base_color_texture=_tiles()), name="floor")
    floor.texcoords0 = floor.positions[:, [0, 2]].astype(np.float32)
    wall = quad((-6, 0, -2.5), (12, 0, 0), (0, 5, 0), Material("wall", (0.6, 0.58, 0.55, 1.0)), "wall")
    ruby = Material("ruby pane", (0.9, 0.1, 0.12, 1.0), roughness=0.0, transmission=1.0, double_sided=True)
    veil = Material("veil", (0.9, 0.9, 0.95, 0.35), roughness=1.0, alpha_mode="blend", double_sided=True)
    panel = Material("panel", (0.0, 0.0, 0.0, 1.0), emission=(6.0, 5.6, 5.0))
    meshes = [
        floor,
        wall,
        quad((-2.6, 0.0, -1.6), (1.2, 0, 0), (0, 1.6, 0), ruby, "pane"),
        quad((1.2, 0.0, -1.6), (1.4, 0, 0), (0, 1.6, 0), veil, "veil"),
        quad((-1.5, 3.6, -0.5), (3.0, 0, 0), (0, 0, 1.5), panel, "panel"),
    ]
    scene.instances += [Instance(mesh, name=mesh.name) for mesh in meshes]
    scene.lights = [PointLight((-3.0, 3.0, 3.0), 18.0, (1.0, 0.9, 0.75), name="lamp")]
    scene.cameras = [Camera.look_at((0.0, 2.1, 5.2), (0.0, 0.45, 0.0), yfov_deg=38, name="front")]
    return scene


def _ball(material: Material) -> Mesh:
    """Make a ball about the origin with a pole above and below, and texture coordinates along its circles."""
    rings = SEGMENTS // 2
    v, u = np.meshgrid(np.linspace(0.0, 1.0, rings + 1), np.linspace(0.0, 1.0, SEGMENTS + 1), indexing="ij")
    sine = np.sin(math.pi * v)
    normals = np.stack([sine * np.sin(2 * math.pi * u), np.cos(math.pi * v), sine * np.cos(2 * math.pi * u)], axis=-1)
    corner = (np.arange(rings)[:, None] * (SEGMENTS + 1) + np.arange(SEGMENTS)).ravel()
    below = corner + SEGMENTS + 1
    # The first and the last ring are triangles.
    lower = np.stack([corner, below, below + 1], axis=1)[: SEGMENTS * (rings - 1)]
    upper = np.stack([corner, below + 1, corner + 1], axis=1)[SEGMENTS:]
    flat = normals.reshape(-1, 3).astype(np.float32)
    return Mesh(
        flat * np.float32(RADIUS),
        np.concatenate([lower, upper]).astype(np.uint32),
        [material],
        normals=flat,
        texcoords0=np.stack([u, v], axis=-1).reshape(-1, 2).astype(np.float32),
        name=material.name,
    )


def _tiles() -> Texture:
    """Make a texture of light and dark tiles, half a metre wide where a metre is one unit."""
    pixels = np.full((2, 2, 4), 255, np.uint8)
    pixels[..., :3] = np.where((np.indices((2, 2)).sum(0) % 2 == 0)[..., None], 205, 105)
    return Texture(Image(pixels, "tiles"), filter="nearest")
