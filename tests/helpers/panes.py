"""Scenes of stacked panes, blended or of glass, with closed forms of what they pass."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wgpu_gi.camera import Camera
from wgpu_gi.scene.built_in.scenes import matte
from wgpu_gi.scene.built_in.shapes import grid, quad
from wgpu_gi.scene.scene import Environment, Instance, Light, Material, Mesh, Scene

ALPHAS = (0.3, 0.6, 0.45)
COLORS = ((0.9, 0.2, 0.1), (0.1, 0.8, 0.3), (0.2, 0.3, 0.9))
PASSED = float(np.prod([1 - a for a in ALPHAS]))
GLASS_COLORS = ((0.9, 0.3, 0.2), (0.8, 0.9, 0.5), (0.6, 0.8, 0.95))
BEHIND = (0.5, 1.0, 0.25)
F0 = 0.04


def blended() -> list[Material]:
    """Return unlit materials of ALPHAS and COLORS: their radiance is their colour."""
    return [
        Material(base_color=(*color, alpha), alpha_mode="blend", unlit=True)
        for color, alpha in zip(COLORS, ALPHAS, strict=True)
    ]


def glass() -> list[Material]:
    """Return clear thin glass of GLASS_COLORS."""
    return [Material(base_color=(*color, 1.0), transmission=1.0, roughness=0.0) for color in GLASS_COLORS]


def glass_tint(cosine: float) -> np.ndarray:
    """Return what the stack of glass passes: the product of colour (1 - F), F by Schlick."""
    return np.prod(GLASS_COLORS, axis=0) * (1 - F0 - (1 - F0) * (1 - cosine) ** 5) ** len(GLASS_COLORS)


def blended_radiance() -> np.ndarray:
    """Return the radiance of the blended stack: sum_i c_i a_i prod_j<i (1 - a_j) + prod (1 - a) BEHIND."""
    passed, radiance = 1.0, np.zeros(3)
    for alpha, color in zip(ALPHAS, COLORS, strict=True):
        radiance += passed * alpha * np.array(color)
        passed *= 1 - alpha
    return radiance + passed * np.array(BEHIND)


def stack_before(materials: Sequence[Material], wall: bool) -> Scene:
    """Return panes across the view, parallel rays, before a wall of radiance BEHIND or an environment of it."""
    panes = [quad((-3.1, -3, -1 - k), (6, 0, 0), (0, 6, 0), material) for k, material in enumerate(materials)]
    if wall:
        panes.append(quad((-9, -9, -6), (18, 0, 0), (0, 18, 0), Material(base_color=(*BEHIND, 1.0), unlit=True)))
    camera = Camera.look_at((0, 0, 2), (0, 0, 0))
    camera.orthographic_height = 2.0
    return Scene([Instance(p) for p in panes], [], None if wall else Environment(BEHIND), cameras=[camera])


def floor_under(
    materials: Sequence[Material],
    lights: Sequence[Light],
    environment: Environment | None = None,
    lamps: Sequence[Mesh] = (),
) -> Scene:
    """Return a grey floor under panes of 40 m, 1 m above it; the camera is below the panes."""
    panes = [quad((-20, 1 + 0.2 * k, 20), (40, 0, 0), (0, 0, -40), material) for k, material in enumerate(materials)]
    camera = Camera.look_at((0, 0.5, 0), (0, 0, 0), up=(0, 0, -1))
    camera.orthographic_height = 1.0
    floor = grid(8, material=matte(0.5))
    return Scene([Instance(p) for p in (floor, *panes, *lamps)], list(lights), environment, cameras=[camera])
