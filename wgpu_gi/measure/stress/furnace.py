"""White furnace: a white sphere of any roughness and metalness vanishes in a white sky, since it absorbs nothing."""

from __future__ import annotations

import numpy as np

from ...camera import Camera
from ...scene.built_in.shapes import sphere
from ...scene.scene import Environment, Instance, Material, Scene
from .findings import Finding
from .studio import Studio, View

BOUND = 0.005  # of the mean over the sphere, and in rings from centre to rim
SUBDIVISIONS = 4
FRAMES, SPP = 8, 64
SIGMAS = 5.0
RINGS = 4
VALUES = 6  # roughnesses from 0 to 1, and metalnesses 0, 0.5 and 1, chosen by the seed


def furnace(studio: Studio, gi: str, scene: Scene, rng: np.random.Generator) -> Finding:
    """Fail if the radiance of a white sphere in a white sky is not 1.000 +- 0.5 % in a ring; `scene` is not used."""
    roughness, metallic = float(rng.integers(VALUES)) / (VALUES - 1), float(rng.integers(3)) / 2
    ball = furnace_scene(roughness, metallic)
    # One bounce of direct light: a convex body has no indirect light.
    pictures = studio.take(gi, View(ball, spp=SPP), range(FRAMES))
    radiance = np.stack([p["radiance"].mean(-1) for p in pictures])
    on_ball = pictures[0]["depth"] > 0
    distance = pictures[0]["depth"]
    # Rings of equal area, from centre to rim, by distance.
    order = np.argsort(distance[on_ball], kind="stable")
    values = radiance[:, on_ball][:, order]
    rings = np.array([part.mean(1) for part in np.array_split(values, RINGS, axis=1)])
    mean, error = rings.mean(1), rings.std(1, ddof=1) / np.sqrt(len(pictures))
    off = np.abs(mean - 1) - SIGMAS * error
    numbers = {"roughness": roughness, "metallic": metallic, "radiance": float(values.mean())}
    numbers |= {f"ring {k}": float(value) for k, value in enumerate(mean)}
    if (off <= BOUND).all():
        return Finding("passed", numbers=numbers)
    worst = int(np.argmax(off))
    where = ("the centre", "the inner half", "the outer half", "the rim")[worst]
    sentence = (
        f"a white sphere of roughness {roughness:g} and metalness {metallic:g} has radiance {mean[worst]:.3f} in"
        f" {where}, not 1, in a white sky"
    )
    got = np.mean([p["radiance"] for p in pictures], axis=0)
    return Finding("failed", "furnace", sentence, numbers, got, np.ones_like(got))


def furnace_scene(roughness: float, metallic: float) -> Scene:
    """Return a white sphere in a white sky, seen so that it nearly fills the height of the picture."""
    material = Material("white", roughness=roughness, metallic=metallic)
    ball = sphere(subdivisions=SUBDIVISIONS, material=material)
    # Smooth normals: at the rim, a faceted sphere would show its facets.
    ball.normals = (ball.positions / np.linalg.norm(ball.positions, axis=1, keepdims=True)).astype(np.float32)
    camera = Camera.look_at((0, 0, 3.5), (0, 0, 0), yfov_deg=36.0)
    return Scene([Instance(ball)], [], Environment(), [camera])
