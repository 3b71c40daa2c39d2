"""Generated outdoor scenes: a street between houses and thin walls, and foliage of alpha-masked cards and strips."""

from __future__ import annotations

import math

import numpy as np

from ...camera import Camera
from ...scene.scene import Instance, Material, Mesh, Scene
from .draws import Draws, place
from .lights import lamp, point_light, sky, spot_light, sun
from .solids import ball, box, frustum, plane, solid
from .surfaces import paint, surface
from .textures import holes, rgba

GROUND = ("matte", "colored", "textured", "clay", "bumpy")
FACADES = ("matte", "colored", "white", "textured", "clay", "glossy", "bumpy", "dark")


def street(draws: Draws) -> Scene:
    """Return open ground with two rows of houses, thin walls, posts and small things, under a sun and a sky."""
    scene = Scene()
    _add_ground(draws, scene, draws.uniform(60.0, 120.0))
    scene.environment = sky(draws, draws.log_uniform(0.3, 3.0))
    if draws.chance(0.85):
        scene.lights.append(sun(draws, draws.log_uniform(2.0, 20.0)))
    # Two rows of houses along z, each side `half` metres from the middle.
    half = draws.uniform(3.0, 6.0)
    for side in (-1, 1):
        z = 8.0
        while z > -35.0:
            width, height, depth = draws.uniform(4, 12), draws.uniform(3, 14), draws.uniform(4, 12)
            if draws.chance(0.8):
                house = paint(draws, box(surface(draws, FACADES), draws.choice((1, 1, 4))))
                position = (side * (half + depth / 2), height / 2, z - width / 2)
                scene.instances.append(Instance(house, place(position, (depth, height, width)), "house"))
            z -= width + draws.choice((0.0, 0.5, 3.0))
    # Thin walls: of no thickness, or of millimetres.
    for _ in range(draws.integer(2, 6)):
        material = surface(draws, FACADES)
        length, height, thickness = draws.uniform(1, 5), draws.uniform(0.8, 2.5), draws.log_uniform(1e-3, 0.1)
        position = (draws.uniform(-0.9, 0.9) * half, height / 2, draws.uniform(-18, -3))
        if draws.chance(0.4):
            upright = draws.turn() @ np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
            scene.instances.append(Instance(plane(material), place(position, (length, 1, height), upright), "screen"))
        else:
            matrix = place(position, (length, height, thickness), draws.turn())
            scene.instances.append(Instance(box(material), matrix, "thin wall"))
    # Things on the ground, and street lamps.
    for _ in range(draws.integer(3, 10)):
        mesh, scale = paint(draws, solid(draws, surface(draws))), draws.log_uniform(0.3, 1.5)
        position = (draws.uniform(-0.9, 0.9) * half, scale / 2, draws.uniform(-16, -2.5))
        scene.instances.append(Instance(mesh, place(position, scale, draws.turn()), "thing"))
    _add_street_lamps(draws, scene, half)
    eye = (draws.uniform(-0.4, 0.4) * half, draws.uniform(1.2, 3.0), draws.uniform(0.5, 4.0))
    aim = (draws.uniform(-0.5, 0.5) * half, draws.uniform(0.5, 2.5), -10.0)
    scene.cameras = [Camera.look_at(eye, aim, yfov_deg=draws.uniform(40, 80), name="camera")]
    return scene


def _add_ground(draws: Draws, scene: Scene, width: float) -> None:
    ground = plane(surface(draws, GROUND), draws.integer(1, 8), draws.integer(1, 8), "ground")
    scene.instances.append(Instance(paint(draws, ground), place((0, 0, -10), width), "ground"))


def _add_street_lamps(draws: Draws, scene: Scene, half: float) -> None:
    """Add up to five posts that carry a bulb, a point light or a spot."""
    post = frustum(surface(draws, ("metal", "dark", "colored")), draws.integer(5, 12), 0.7, True, "post")
    for k in range(draws.integer(0, 5)):
        height, x = draws.uniform(2.5, 5.0), draws.choice((-1.0, 1.0)) * 0.85 * half
        z, flux = -2.0 - 5.0 * k, draws.log_uniform(20.0, 400.0)
        scene.instances.append(Instance(post, place((x, height / 2, z), (0.1, height, 0.1)), "post"))
        kind = draws.choice(("bulb", "point", "spot"))
        if kind == "bulb":
            bulb = ball(lamp(draws, flux, math.pi * 0.3 * 0.3), 1, name="bulb")
            scene.instances.append(Instance(bulb, place((x, height + 0.16, z), 0.3), "bulb"))
        elif kind == "point":
            scene.lights.append(point_light(draws, (x, height + 0.1, z), flux, f"point {k}"))
        else:
            scene.lights.append(spot_light(draws, (x, height + 0.1, z), (0.0, 0.0, z), flux, f"spot {k}"))


# ------------------------------------------------------------------------------------------------ foliage


def foliage(draws: Draws) -> Scene:
    """Return trees and bushes of alpha-masked cards, grass of thin strips, trunks and a sky, mostly with a sun."""
    scene = Scene()
    _add_ground(draws, scene, draws.uniform(20.0, 60.0))
    scene.environment = sky(draws, draws.log_uniform(0.3, 3.0))
    if draws.chance(0.85):
        scene.lights.append(sun(draws, draws.log_uniform(2.0, 20.0), lowest=0.3))
    if draws.chance(0.3):
        position = (draws.uniform(-2, 2), draws.uniform(1, 3), draws.uniform(-5, -2))
        scene.lights.append(point_light(draws, position, draws.log_uniform(50.0, 500.0)))
    # Trees and bushes: a trunk, and cards around a centre.
    cards = [_card(draws) for _ in range(draws.integer(1, 3))]
    trunk = frustum(surface(draws, ("matte", "colored", "dark", "bumpy")), draws.integer(5, 12), 0.6, True, "trunk")
    for _ in range(draws.integer(2, 5)):
        x, z, radius = draws.uniform(-4, 4), draws.uniform(-12, -3.5), draws.uniform(0.6, 1.6)
        height = draws.choice((0.4 * radius, draws.uniform(1.5, 3.5)))
        width = draws.uniform(0.08, 0.3)
        scene.instances.append(Instance(trunk, place((x, height / 2, z), (width, height, width)), "trunk"))
        for _ in range(draws.integer(8, 25)):
            offset = draws.rotation()[:, 0] * radius * draws.uniform(0.2, 1.0)
            matrix = place(np.array([x, height + 0.5 * radius, z]) + offset, draws.uniform(0.4, 1.2), draws.rotation())
            scene.instances.append(Instance(draws.choice(cards), matrix, "card"))
    # Grass, and a few solid things.
    grass = _strips(draws, draws.integer(100, 400))
    for _ in range(draws.integer(1, 4)):
        matrix = place((draws.uniform(-3, 3), 0.0, draws.uniform(-8, -2)), draws.uniform(0.6, 1.5), draws.turn())
        scene.instances.append(Instance(grass, matrix, "grass"))
    for _ in range(draws.integer(1, 4)):
        mesh, scale = paint(draws, solid(draws, surface(draws))), draws.log_uniform(0.3, 1.2)
        position = (draws.uniform(-3, 3), scale / 2, draws.uniform(-9, -3))
        scene.instances.append(Instance(mesh, place(position, scale, draws.turn()), "thing"))
    eye, aim = (draws.uniform(-1, 1), draws.uniform(0.5, 2.5), 1.0), (draws.uniform(-1, 1), draws.uniform(0.6, 2), -6.0)
    scene.cameras = [Camera.look_at(eye, aim, yfov_deg=draws.uniform(40, 75), name="camera")]
    return scene


def _card(draws: Draws) -> Mesh:
    """Return a square with leaves cut out by an alpha mask."""
    cutoff = draws.uniform(0.2, 0.8)
    material = Material("leaves", rgba(draws.color(0.4, 0.95)), alpha_mode="mask", alpha_cutoff=cutoff)
    material.base_color_texture, material.double_sided = holes(draws), draws.chance(0.8)
    return plane(material, name="card")


def _strips(draws: Draws, count: int) -> Mesh:
    """Return `count` blades of grass over a square metre or two: triangles of a millimetre to 2 cm by 0.1 to 0.6 m."""
    root = draws.array(count, 2) * 2 - 1
    angle, width = draws.array(count) * 2 * np.pi, 10 ** (-3 + 1.3 * draws.array(count))
    height, lean = 0.1 + 0.5 * draws.array(count), (draws.array(count, 2) - 0.5) * 0.3
    across = np.stack([np.cos(angle), np.sin(angle)], axis=1) * width[:, None] / 2
    corners = np.zeros((count, 3, 3))
    corners[:, 0, [0, 2]], corners[:, 1, [0, 2]], corners[:, 2, [0, 2]] = root - across, root + across, root + lean
    corners[:, 2, 1] = height
    material = Material("grass", rgba(draws.color(0.1, 0.7)), double_sided=draws.chance(0.7))
    triangles = np.arange(3 * count, dtype=np.uint32).reshape(-1, 3)
    return Mesh(corners.reshape(-1, 3).astype(np.float32), triangles, [material], name="grass")
