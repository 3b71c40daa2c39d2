"""Generated scenes that move: a room whose things turn, bend and swell and whose lamps move, seen at a random time.

All that moves has its channels in one animation. The scene stands as `Scene.at` shows it at that time.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...scene.animation import Animation, Attachment, Channel, Interpolation, Node, Skeleton, Track
from ...scene.scene import DirectionalLight, Instance, Light, Material, Mesh, MorphTarget, Scene, Skin
from .draws import Draws, Rgb, place, unit
from .lights import LAMPS, light_room, sky
from .rooms import Size, add_camera, add_objects, add_walls
from .solids import ball, box, joined, settled_rows, sheet, torus
from .surfaces import SURFACES, WALLS, paint, surface
from .textures import rgba

Array = NDArray[np.float64]

LEAST_SECONDS, MOST_SECONDS = 0.5, 4.0  # of an animation
MOST_BEND = math.radians(35)  # of a joint
MOST_SHIFT = 0.3  # metres that things and lamps move
INTERPOLATIONS: tuple[Interpolation, ...] = ("step", "linear", "linear", "cubic")
INFLUENCES = (1, 2, 4, 8)  # joints of a vertex


def moving(draws: Draws) -> Scene:
    """Return a room with something that deforms and up to ten other things that move, at a random time."""
    size = (draws.uniform(3.0, 7.0), draws.uniform(2.4, 4.0), draws.uniform(3.0, 7.0))
    scene, motion = Scene(), Animation("motion")
    opened = draws.chance(0.25)
    add_walls(draws, scene, size, WALLS, opened)
    add_camera(draws, scene, size)
    walls = len(scene.instances)
    add_objects(draws, scene, size, tuple(SURFACES), draws.integer(2, 6))
    if opened:
        scene.environment = sky(draws, draws.log_uniform(0.5, 5.0))
    light_room(draws, scene, size, LAMPS, draws.integer(1, 4))
    # Move what is there, then add what deforms.
    things = scene.instances[walls:]
    for instance in draws.sample(things, draws.integer(0, min(4, len(things)))):
        _move(draws, motion, instance)
    for light in scene.lights:
        if draws.chance(0.6):
            _move_light(draws, motion, light)
    for _ in range(draws.integer(1, 2)):
        draws.choice((_add_worm, _add_worm, _add_swelling))(draws, scene, motion, size)
    if draws.chance(0.3):
        _change_material(draws, motion, draws.choice(scene.materials))
    scene.animations = [motion]
    end = motion.duration
    _stand(scene, draws.choice((0.0, end, draws.uniform(0.0, end), draws.uniform(0.0, end))))
    return scene


def _stand(scene: Scene, time: float) -> None:
    """Put everything where the animation has it at a time."""
    posed = scene.at(time)
    for mine, its in zip(scene.instances, posed.instances, strict=True):
        mine.world_from_local = _rounded(its.world_from_local)
        mine.joint_matrices = None if its.joint_matrices is None else _rounded(its.joint_matrices)
        mine.morph_weights = tuple(_rounded(its.morph_weights).tolist())
    for light, other in zip(scene.lights, posed.lights, strict=True):
        light.intensity = float(np.float32(other.intensity))
        for name in ("position", "direction"):
            if hasattr(light, name):
                x, y, z = _rounded(getattr(other, name)).tolist()
                setattr(light, name, unit((x, y, z)) if name == "direction" else (x, y, z))
    for material, changed in zip(scene.materials, posed.materials, strict=True):
        material.base_color = rgba(_color(changed.base_color))
        material.emission = _color(changed.emission)


def _rounded(values: object) -> Array:
    return np.asarray(values, np.float32).astype(np.float64)


def _color(values: object) -> Rgb:
    red, green, blue = _rounded(values)[:3].tolist()
    return red, green, blue


# ------------------------------------------------------------------------------------------------ tracks


def _track(draws: Draws, values: Array, steady: bool = False) -> Track:
    """Return a track through the values (k, w), of random times and interpolation; `steady` ones are linear."""
    first = draws.choice((0.0, 0.0, 0.1))
    times = first + np.cumsum(0.05 + draws.array(len(values))) / len(values) * draws.uniform(
        LEAST_SECONDS, MOST_SECONDS
    )
    kind = "linear" if steady else draws.choice(INTERPOLATIONS)
    if kind == "cubic":
        tangents = 0.3 * (2 * draws.array(2, *values.shape) - 1) * np.ptp(values, axis=0)
        values = np.stack([tangents[0], values, tangents[1]], axis=1)
    return Track(_rounded(times), _rounded(values), kind)


def _turns(draws: Draws, keys: int, most: float) -> Array:
    """Return quaternions xyzw (keys, 4) of rotations by up to `most` radians about random axes."""
    found = np.empty((keys, 4))
    for k in range(keys):
        angle = draws.uniform(-most, most) / 2
        found[k] = (*(math.sin(angle) * draws.rotation()[0]), math.cos(angle))
    return found


def _shifts(draws: Draws, keys: int, most: float = MOST_SHIFT) -> Array:
    return most * (2 * draws.array(keys, 3) - 1)


def _keys(draws: Draws) -> int:
    return draws.integer(2, 5)


# ------------------------------------------------------------------------------------------------ what moves


def _move(draws: Draws, motion: Animation, instance: Instance) -> None:
    """Let an instance turn, and perhaps shift and grow, about its own centre or a parent's."""
    parent = None
    if draws.chance(0.3):
        parent = Node(name="parent")
        motion.channels.append(Channel(parent, "translation", _track(draws, _shifts(draws, _keys(draws)))))
    x, y, z = instance.world_from_local[:3, 3].tolist()
    node = Node(parent, (x, y, z), name=instance.name)
    motion.channels.append(Channel(node, "rotation", _track(draws, _turns(draws, _keys(draws), math.pi))))
    if draws.chance(0.5):
        places = np.array((x, y, z)) + _shifts(draws, _keys(draws))
        motion.channels.append(Channel(node, "translation", _track(draws, places)))
    if draws.chance(0.3):
        motion.channels.append(Channel(node, "scale", _track(draws, 0.6 + 0.6 * draws.array(_keys(draws), 3), True)))
    own = np.array(instance.world_from_local)
    own[:3, 3] = 0.0
    motion.attachments.append(Attachment(instance, node, own))


def _move_light(draws: Draws, motion: Animation, light: Light) -> None:
    """Let a light shift, turn or change its intensity."""
    if not isinstance(light, DirectionalLight):
        places = np.array(light.position) + _shifts(draws, _keys(draws)) * (1.0, 0.3, 1.0)
        motion.channels.append(Channel(light, "position", _track(draws, places, True)))
    if hasattr(light, "direction"):
        ways = np.array(light.direction) + _shifts(draws, _keys(draws), 0.4)
        motion.channels.append(Channel(light, "direction", _track(draws, ways, True)))
    if draws.chance(0.4):
        levels = light.intensity * (0.2 + 1.8 * draws.array(_keys(draws), 1))
        motion.channels.append(Channel(light, "intensity", _track(draws, levels, True)))


def _change_material(draws: Draws, motion: Animation, material: Material) -> None:
    """Let the colour of a material change, and that of its light."""
    colors = np.array([rgba(draws.color(0.02, 0.95)) for _ in range(3)])
    motion.channels.append(Channel(material, "base_color", _track(draws, colors, True)))
    if max(material.emission) > 0:
        levels = np.array(material.emission) * (0.2 + 1.8 * draws.array(3, 1))
        motion.channels.append(Channel(material, "emission", _track(draws, levels, True)))


# ------------------------------------------------------------------------------------------------ what deforms


def _add_worm(draws: Draws, scene: Scene, motion: Animation, size: Size) -> None:
    """Add a mesh whose skin follows a chain of joints along its y axis, and that seldom swells as well."""
    mesh = _fine_mesh(draws, draws.choice(("worm", "worm", "ball", "box", "torus")))
    count = draws.integer(2, 9)
    heights = -0.5 + np.arange(count) / count
    # The weights fall off with the distance from the middle of each bone.
    off = (mesh.positions[:, 1:2].astype(np.float64) - heights - 0.5 / count) * count
    weights = np.maximum(1e-3, 1.0 - np.abs(off) / draws.uniform(0.6, 2.0))
    chosen = np.argsort(-weights, axis=1, kind="stable")[:, : draws.choice(INFLUENCES)]
    kept = np.take_along_axis(weights, chosen, 1)
    kept /= kept.sum(1, keepdims=True)
    mesh.skin = Skin(chosen.astype(draws.choice((np.uint16, np.uint32))), kept.astype(np.float32))
    # The root stands in the room; each joint turns by itself.
    matrix = _placed(draws, scene, size)
    nodes = [Node(matrix=matrix @ place((0.0, heights[0], 0.0)), name="root")]
    for k in range(1, count):
        nodes.append(Node(nodes[-1], (0.0, 1.0 / count, 0.0), name=f"joint {k}"))
    for node in nodes[1:]:
        if node is nodes[1] or draws.chance(0.8):
            motion.channels.append(Channel(node, "rotation", _track(draws, _turns(draws, _keys(draws), MOST_BEND))))
    unbind = np.tile(np.eye(4), (count, 1, 1))
    unbind[:, 1, 3] = -heights
    instance = Instance(mesh, name="worm")
    motion.skeletons.append(Skeleton([instance], nodes, unbind))
    if draws.chance(0.25):
        _swell(draws, motion, instance)
    scene.instances.append(instance)


def _add_swelling(draws: Draws, scene: Scene, motion: Animation, size: Size) -> None:
    """Add a mesh of one to four morph targets."""
    mesh = _fine_mesh(draws, draws.choice(("worm", "ball", "box", "torus")))
    instance = Instance(mesh, _placed(draws, scene, size), "swelling")
    _swell(draws, motion, instance)
    scene.instances.append(instance)


def _swell(draws: Draws, motion: Animation, instance: Instance) -> None:
    """Give a mesh morph targets, waves of displacement, and their weights a track."""
    mesh = instance.mesh
    points = mesh.positions.astype(np.float64)
    for k in range(draws.integer(1, 4)):
        waves = np.sin(points @ (8 * draws.rotation()) + 6 * draws.array(3)) * (0.03 + 0.12 * draws.array(3))
        target = MorphTarget(waves.astype(np.float32), name=f"wave {k}")
        if mesh.normals is not None and draws.chance(0.5):
            target.normals = (0.3 * waves[:, ::-1]).astype(np.float32)
        mesh.morph_targets.append(target)
    weights = -0.4 + 1.6 * draws.array(_keys(draws), len(mesh.morph_targets))
    motion.channels.append(Channel(instance, "morph_weights", _track(draws, weights)))
    instance.morph_weights = (0.0,) * len(mesh.morph_targets)


def _fine_mesh(draws: Draws, shape: str) -> Mesh:
    """Return a mesh of hundreds of vertices within the unit cube: a worm along y, a ball, a box or a ring."""
    names = tuple(name for name in SURFACES if name not in ("screen", "unlit"))
    material, smooth = surface(draws, names), draws.chance(0.7)
    if shape == "ball":
        return paint(draws, ball(material, draws.integer(2, 3), smooth))
    if shape == "box":
        return paint(draws, box(material, draws.integer(4, 9)))
    if shape == "torus":
        return paint(draws, torus(material, draws.integer(16, 32), draws.uniform(0.08, 0.2), smooth))
    radius = draws.uniform(0.06, 0.16)

    def worm(u: Array, v: Array) -> tuple[Array, Array]:
        angle, along = 2 * np.pi * u, np.sin(np.pi * np.clip(v, 0.0, 1.0)) ** 0.5
        normal = np.stack([np.cos(angle), np.zeros_like(u), -np.sin(angle)], -1)
        points = normal * (radius * along)[..., None] + np.stack([0 * v, v - 0.5, 0 * v], -1)
        return points, settled_rows(normal.reshape(-1, 3)).reshape(normal.shape).astype(np.float64)

    part = sheet(draws.integer(8, 16), draws.integer(12, 40), worm)
    return paint(draws, joined([part], material, smooth, "worm"))


def _placed(draws: Draws, scene: Scene, size: Size) -> Array:
    """Return the matrix of a thing in the room that comes no nearer than half a metre to the camera."""
    eye = scene.cameras[0].position
    while True:
        width = draws.uniform(0.5, 1.3)
        reach = 0.6 * width
        free = np.maximum(np.array(size) * (0.5, 1.0, 0.5) - reach, 0.01)
        position = np.array([draws.uniform(-1, 1) * free[0], 0.0, draws.uniform(-1, 1) * free[2]])
        position[1] = min(reach + draws.uniform(0.0, 0.8), free[1])
        if np.linalg.norm(position - eye) > reach + 0.5:
            return place(position, width, draws.turn() if draws.chance(0.6) else draws.rotation())
