"""Generated interiors: a room of objects and lights, perhaps with an opening to a sky; and a hall of hundreds."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...camera import Camera
from ...scene.scene import Instance, Material, Mesh, Scene
from .draws import Draws, place
from .layers import LAYERED
from .lights import LAMPS, lamp, light_room, point_light, sky, spot_light, sun
from .solids import SHAPES, Part, ball, box, joined, plane, solid
from .surfaces import GLOSSY, SURFACES, TEXTURED, WALLS, paint, surface

Size = tuple[float, float, float]


@dataclass(frozen=True)
class RoomPlan:
    """What a room is made of: the names of materials, the numbers of objects and lights, the chance of an opening."""

    walls: tuple[str, ...] = WALLS
    objects: tuple[str, ...] = tuple(SURFACES)
    lamps: tuple[str, ...] = LAMPS
    object_count: tuple[int, int] = (3, 12)
    light_count: tuple[int, int] = (1, 6)
    opening: float = 0.4


ROOM = RoomPlan()
GLOSSY_ROOM = RoomPlan(("matte", "colored", "white", *GLOSSY), GLOSSY, object_count=(4, 10), opening=0.3)
LAYERED_ROOM = RoomPlan(("matte", "colored", "white", *LAYERED), tuple(LAYERED), object_count=(4, 10), opening=0.3)
TEXTURED_ROOM = RoomPlan(("textured", "textured", "painted", "white"), TEXTURED, ("screen", *LAMPS), opening=0.3)


def furnished_room(draws: Draws, plan: RoomPlan = ROOM) -> Scene:
    """Return a room as `plan` says, seen by a camera inside it."""
    size = (draws.uniform(3.0, 7.0), draws.uniform(2.4, 4.0), draws.uniform(3.0, 7.0))
    scene = Scene()
    opened = draws.chance(plan.opening)
    add_walls(draws, scene, size, plan.walls, opened)
    add_camera(draws, scene, size)
    add_objects(draws, scene, size, plan.objects, draws.integer(*plan.object_count))
    light_count = draws.integer(*plan.light_count)
    if opened:
        scene.environment = sky(draws, draws.log_uniform(0.5, 5.0))
        if light_count > 1 and draws.chance(0.6):
            scene.lights.append(sun(draws, draws.log_uniform(5.0, 50.0)))
            light_count -= 1
    light_room(draws, scene, size, plan.lamps, light_count)
    return scene


def add_walls(draws: Draws, scene: Scene, size: Size, names: tuple[str, ...], opened: bool) -> None:
    """Add floor, ceiling and four walls that face inward, one of them or the ceiling with a hole if `opened`."""
    hole = draws.choice((1, 2, 3, 4, 5)) if opened else -1
    width, height, depth = size
    tilt = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])  # turns +Y to +Z
    # Each side: position, extent along the plane's x and z, rotation of its +Y to the room's inside.
    sides: list[tuple[str, Size, tuple[float, float], NDArray[np.float64]]] = [
        ("floor", (0, 0, 0), (width, depth), np.eye(3)),
        ("ceiling", (0, height, 0), (width, depth), np.diag([1.0, -1.0, -1.0])),
    ]
    for k, (x, z, extent) in enumerate([(0, -depth, width), (-width, 0, depth), (0, depth, width), (width, 0, depth)]):
        rotation = np.round(draws.turn(k * math.pi / 2)) @ tilt
        sides.append((f"wall {k}", (x / 2, height / 2, z / 2), (extent, height), rotation))
    for number, (name, position, (across, along), rotation) in enumerate(sides):
        material = surface(draws, names)
        mesh = holed(draws, material) if number == hole else plane(material, draws.integer(1, 4), draws.integer(1, 3))
        mesh.name = name
        scene.instances.append(
            Instance(paint(draws, mesh), place(position, (across, 1.0, along), rotation), name),
        )


def holed(draws: Draws, material: Material) -> Mesh:
    """Return the unit square at y = 0 that faces +Y, with a rectangular hole."""
    x0, z0 = draws.uniform(-0.4, 0.0), draws.uniform(-0.4, 0.0)
    x1, z1 = x0 + draws.uniform(0.15, 0.4), z0 + draws.uniform(0.15, 0.4)
    parts: list[Part] = []
    for x, z in (((-0.5, 0.5), (-0.5, z0)), ((-0.5, 0.5), (z1, 0.5)), ((-0.5, x0), (z0, z1)), ((x1, 0.5), (z0, z1))):
        corners = np.array([[x[0], 0, z[1]], [x[1], 0, z[1]], [x[1], 0, z[0]], [x[0], 0, z[0]]])
        up = np.broadcast_to([0.0, 1.0, 0.0], (4, 3))
        parts.append((corners, up, corners[:, [0, 2]] + 0.5, np.array([[0, 1, 2], [0, 2, 3]])))
    return joined(parts, material, False, "wall with a hole")


def add_camera(draws: Draws, scene: Scene, size: Size) -> None:
    """Add a camera near a wall or in a corner that looks across the room."""
    width, height, depth = size
    side = draws.choice((-1.0, 1.0))
    eye = (
        draws.uniform(-0.42, 0.42) * width,
        draws.uniform(0.25, 0.75) * height,
        side * draws.uniform(0.35, 0.46) * depth,
    )
    aim = (
        draws.uniform(-0.2, 0.2) * width,
        draws.uniform(0.15, 0.55) * height,
        -side * draws.uniform(0.0, 0.3) * depth,
    )
    scene.cameras = [Camera.look_at(eye, aim, yfov_deg=draws.uniform(40.0, 85.0), name="camera")]


def add_objects(draws: Draws, scene: Scene, size: Size, names: tuple[str, ...], count: int) -> None:
    """Add `count` objects of the materials `names` that stand, lie, hang or float in the room."""
    place_objects(draws, scene, size, lambda: solid(draws, surface(draws, names)), count)


def place_objects(draws: Draws, scene: Scene, size: Size, make: Callable[[], Mesh], count: int) -> None:
    """Place `count` meshes that `make` returns, or returned before; none comes within 0.4 m of the camera."""
    eye = scene.cameras[0].position
    meshes: list[Mesh] = []
    while count > 0:
        # Choose a new mesh, or seldom one that is there already.
        mesh = draws.choice(meshes) if meshes and draws.chance(0.15) else make()
        scale = np.array([draws.log_uniform(0.2, 1.2) for _ in range(3)])
        if draws.chance(0.5):
            scale[:] = scale[0]
        scale = np.minimum(scale, 0.45 * np.array(size))
        upright = draws.chance(0.7)
        rotation = draws.turn() if upright else draws.rotation()
        if mesh.name == "plane":
            rotation = draws.rotation()
        # Keep it inside the room and away from the camera.
        reach = np.abs(rotation * scale).sum(1) / 2
        free = np.maximum(np.array(size) / 2 - reach - 0.01, 0.0)
        x, z = draws.uniform(-1, 1) * free[0], draws.uniform(-1, 1) * free[2]
        y = reach[1] + 2 * free[1] * (0.0 if upright and draws.chance(0.8) else draws.uniform(0.0, 0.9))
        if (np.abs(np.array([x, y, z]) - eye) < reach + 0.4).all():
            continue
        if mesh not in meshes:
            meshes.append(paint(draws, mesh))
        scene.instances.append(Instance(mesh, place((x, y, z), scale, rotation), f"{mesh.name} {count}"))
        count -= 1


def many(draws: Draws) -> Scene:
    """Return a hall with hundreds of instances of few meshes, and hundreds of lights, emitters among them."""
    size = (draws.uniform(10.0, 24.0), draws.uniform(4.0, 8.0), draws.uniform(10.0, 24.0))
    scene = Scene()
    add_walls(draws, scene, size, WALLS, opened=False)
    add_camera(draws, scene, size)
    add_crowd(draws, scene, size, draws.integer(200, 500))
    # Share an irradiance of about 10 W/m2 among the lights.
    area = 2 * (size[0] * size[1] + size[1] * size[2] + size[0] * size[2])
    light_count, emitter_count = draws.integer(100, 300), draws.integer(10, 60)
    flux = 10.0 * area / (light_count + emitter_count)
    for k in range(light_count):
        position = [
            draws.uniform(-0.48, 0.48) * size[0],
            draws.uniform(0.1, 0.97) * size[1],
            draws.uniform(-0.48, 0.48) * size[2],
        ]
        if draws.chance(0.3):
            target = (position[0] + draws.uniform(-1, 1), 0.0, position[2] + draws.uniform(-1, 1))
            scene.lights.append(spot_light(draws, position, target, flux * draws.log_uniform(0.2, 3), f"spot {k}"))
        else:
            scene.lights.append(point_light(draws, position, flux * draws.log_uniform(0.2, 3), f"point {k}"))
    # Emitters: few meshes, of materials that make bulbs of one size.
    width = draws.log_uniform(0.05, 0.3)
    bulbs = [ball(lamp(draws, flux, math.pi * width * width), 1), box(lamp(draws, flux, 6 * width * width))]
    for k in range(emitter_count):
        position = [
            draws.uniform(-0.45, 0.45) * size[0],
            draws.uniform(0.3, 0.9) * size[1],
            draws.uniform(-0.45, 0.45) * size[2],
        ]
        scene.instances.append(Instance(draws.choice(bulbs), place(position, width, draws.rotation()), f"lamp {k}"))
    return scene


def add_crowd(draws: Draws, scene: Scene, size: Sequence[float], count: int) -> None:
    """Add `count` small instances of 3 to 8 meshes all over a hall; none comes within 0.4 m of the camera."""
    names = tuple(name for name in SURFACES if name not in ("glow", "screen", "unlit"))
    meshes = [
        paint(draws, solid(draws, surface(draws, names), draws.choice(SHAPES))) for _ in range(draws.integer(3, 8))
    ]
    eye = scene.cameras[0].position
    for k in range(count):
        scale = draws.log_uniform(0.15, 0.9)
        floats = draws.chance(0.3)
        y = draws.uniform(0.1, 0.8) * size[1] if floats else scale / 2
        position = np.array([draws.uniform(-0.46, 0.46) * size[0], y, draws.uniform(-0.46, 0.46) * size[2]])
        if np.abs(position - eye).max() < scale + 0.4:
            position[1] = 0.9 * size[1] if eye[1] < 0.5 * size[1] else 0.1 * size[1]
        rotation = draws.rotation() if floats else draws.turn()
        scene.instances.append(Instance(draws.choice(meshes), place(position, scale, rotation), f"item {k}"))
