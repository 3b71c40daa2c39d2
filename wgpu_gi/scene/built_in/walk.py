"""A built-in scene that moves: a figure walks in a room, a lamp swings, and a door opens to a bright room and closes.

The animation takes 6 seconds, after which everything is where it was at its start.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

from ...camera import Camera
from ..animation import Animation, Attachment, Channel, Node, Skeleton, Track
from ..scene import Instance, Material, Mesh, PointLight, Scene, Skin
from .figure import Figure, make_figure
from .gait import Gait, make_gait
from .shapes import Point3, box, prism, sphere

DURATION = 6.0  # seconds
CYCLES = 5  # of two steps each, once around
CENTRE = (0.45, 0.0, 0.15)  # of the figure's path on the floor
# The door's leaf: its hinge, its width and height; the angle by time, which is 0 when shut.
HINGE, LEAF = (-1.4, 0.0, -2.5), (0.9, 2.05)
OPENING_TIMES = (0.0, 1.0, 1.25, 1.75, 2.0, 4.0, 4.25, 4.75, 5.0, 6.0)
OPENING = (0.0, 0.0, -12.0, -83.0, -95.0, -95.0, -83.0, -12.0, 0.0, 0.0)  # degrees
CORD, LAMP_SWING, LAMP_TURNS = (-0.3, 2.6, 0.4), 24.0, 3  # top of the lamp's cord; degrees; swings in an animation
LAMP_KEYS = 4  # cubic keys of each swing

# Material, lower and upper corner of each block. The room is 6 x 2.6 x 5 m; walls of 10 cm reach into each other. The
# bright room lies behind the north wall, whose opening has a stop on three sides for the leaf to shut against.
BLOCKS: dict[str, tuple[str, Point3, Point3]] = {
    "floor": ("floor", (-3.1, -0.1, -4.9), (3.1, 0.0, 2.6)),
    "ceiling": ("plaster", (-3.1, 2.6, -4.9), (3.1, 2.7, 2.6)),
    "west": ("ochre", (-3.1, -0.05, -4.9), (-3.0, 2.65, 2.6)),
    "east": ("teal", (3.0, -0.05, -4.9), (3.1, 2.65, 2.6)),
    "south": ("plaster", (-3.1, -0.05, 2.5), (3.1, 2.65, 2.6)),
    "north a": ("plaster", (-3.05, -0.05, -2.6), (-1.4, 2.65, -2.5)),
    "north b": ("plaster", (-0.5, -0.05, -2.6), (3.05, 2.65, -2.5)),
    "lintel": ("plaster", (-1.45, 2.05, -2.6), (-0.45, 2.65, -2.5)),
    "stop west": ("white", (-1.45, -0.05, -2.58), (-1.37, 2.1, -2.545)),
    "stop east": ("white", (-0.53, -0.05, -2.58), (-0.45, 2.1, -2.545)),
    "stop above": ("white", (-1.45, 2.02, -2.58), (-0.45, 2.1, -2.545)),
    "threshold": ("wood", (-1.45, -0.05, -2.6), (-0.45, 0.012, -2.545)),
    "bright end": ("plaster", (-3.1, -0.05, -4.9), (3.1, 2.65, -4.8)),
    "bright side": ("plaster", (1.3, -0.05, -4.85), (1.4, 2.65, -2.55)),
    "cabinet": ("wood", (-2.98, 0.0, -0.6), (-2.55, 0.75, 0.8)),
    "bench": ("wood", (1.3, 0.4, -2.4), (2.7, 0.46, -2.0)),
    "bench west": ("wood", (1.4, -0.01, -2.35), (1.48, 0.42, -2.05)),
    "bench east": ("wood", (2.52, -0.01, -2.35), (2.6, 0.42, -2.05)),
}


def walk(vertices: int = 4000, joints: int = 21) -> Scene:
    """A room with a walking figure of about `vertices` vertices, a swinging lamp and an opening door; no closed form.

    The cameras "corner" and "west" see all of it. The scene is at rest at the time 0.
    """
    materials = _materials()
    blocks = [box(low, high, materials[kind], name=name) for name, (kind, low, high) in BLOCKS.items()]
    instances = [Instance(block, name=block.name) for block in blocks]
    vase = sphere((-2.77, 0.93, -0.1), 0.18, 3, materials["vase"], name="vase")
    instances.append(Instance(vase, name="vase"))
    animation = Animation("walk")
    _add_figure(animation, *figure_and_gait(vertices, joints))
    _add_door(animation, materials["wood"], materials["white"])
    lamp = _add_lamp(animation, materials["shade"])
    instances += [a.part for a in animation.attachments if isinstance(a.part, Instance)]
    instances += [instance for skeleton in animation.skeletons for instance in skeleton.instances]
    scene = Scene(
        instances,
        [lamp, PointLight((-0.7, 2.1, -3.9), 120.0, (1.0, 0.96, 0.9), name="bright lamp")],
        cameras=[
            Camera.look_at((2.75, 1.7, 2.3), (-0.6, 0.95, -0.95), yfov_deg=56.0, name="corner"),
            Camera.look_at((-2.6, 1.6, 2.2), (0.2, 0.95, -0.9), yfov_deg=58.0, name="west"),
        ],
        animations=[animation],
    )
    _rest(scene, lamp)
    return scene


@cache
def figure_and_gait(vertices: int, joints: int) -> tuple[Figure, Gait]:
    """Return a figure and its gait, made once; their arrays are not to be changed."""
    figure = make_figure(vertices, joints)
    return figure, make_gait(figure)


def _materials() -> dict[str, Material]:
    colors: dict[str, tuple[Point3, float]] = {
        "plaster": ((0.72, 0.7, 0.66), 1.0),
        "floor": ((0.36, 0.25, 0.16), 0.6),
        "ochre": ((0.68, 0.42, 0.16), 1.0),
        "teal": ((0.16, 0.4, 0.42), 1.0),
        "wood": ((0.45, 0.27, 0.13), 0.5),
        "white": ((0.75, 0.75, 0.73), 0.5),
        "vase": ((0.12, 0.22, 0.5), 0.25),
        "shade": ((0.05, 0.06, 0.06), 1.0),  # dark: else the lamp lights a small spot of it to a lamp of its own
    }
    return {name: Material(name, (*c, 1.0), 0.0, rough, double_sided=True) for name, (c, rough) in colors.items()}


def _add_figure(animation: Animation, figure: Figure, gait: Gait) -> None:
    """Add a figure that walks once around CENTRE, its feet on the ground."""
    mesh = Mesh(
        figure.positions.astype(np.float32),
        figure.triangles.astype(np.uint32),
        [Material("figure", roughness=0.9)],
        normals=figure.normals.astype(np.float32),
        colors=np.column_stack([figure.colors, np.ones(len(figure.colors))]).astype(np.float32),
        name="figure",
        skin=Skin(figure.joints.astype(np.uint16), figure.weights.astype(np.float32)),
    )
    # The path: a node at its centre turns by keys a third of a turn apart.
    radius = gait.stride * CYCLES / (2 * math.pi)
    centre = Node(translation=CENTRE, name="path")
    turns = np.linspace(0.0, 2 * math.pi, 4)
    animation.channels.append(Channel(centre, "rotation", Track(np.linspace(0.0, DURATION, 4), _about(1, turns))))
    # The joints. The root stands left of the centre by the radius, faces along the path, +Z, and bobs.
    times = np.concatenate([gait.phases[:-1] + k for k in range(CYCLES)] + [[CYCLES]]) * DURATION / CYCLES
    repeated = np.concatenate([np.tile(np.arange(len(gait.phases) - 1), CYCLES), [0]])
    nodes: list[Node] = []
    for k, (name, parent) in enumerate(zip(figure.names, figure.parents, strict=True)):
        place = figure.places[k] - (figure.places[parent] if parent >= 0 else (radius, 0.0, 0.0))
        nodes.append(Node(nodes[parent] if parent >= 0 else centre, tuple(place.tolist()), name=name))
        animation.channels.append(Channel(nodes[k], "rotation", Track(times, gait.rotations[repeated, k])))
    heights = figure.places[0] - (radius, 0.0, 0.0) + gait.heights[repeated, None] * (0.0, 1.0, 0.0)
    animation.channels.append(Channel(nodes[0], "translation", Track(times, heights)))
    unbind = np.tile(np.eye(4), (len(nodes), 1, 1))
    unbind[:, :3, 3] = -figure.places
    animation.skeletons.append(Skeleton([Instance(mesh, name="figure")], nodes, unbind))


def _add_door(animation: Animation, wood: Material, white: Material) -> None:
    """Add a leaf with a handle, whose front is flush with the wall and swings into the room."""
    width, height = LEAF
    hinge = Node(translation=HINGE, name="hinge")
    leaf = box((0.004, 0.014, -0.04), (width - 0.004, height - 0.004, 0.0), wood, name="door")
    handle = box((width - 0.17, 1.0, -0.005), (width - 0.05, 1.025, 0.045), white, name="handle")
    animation.attachments += [Attachment(Instance(mesh, name=mesh.name), hinge) for mesh in (leaf, handle)]
    angles = np.radians(OPENING)
    animation.channels.append(Channel(hinge, "rotation", Track(np.array(OPENING_TIMES), _about(1, angles))))


def _add_lamp(animation: Animation, shade: Material) -> PointLight:
    """Add a lamp that hangs on a cord and swings, in an opaque shade that is open below; return its light."""
    top = Node(translation=CORD, name="cord")
    light = PointLight((0.0, 0.0, 0.0), 26.0, (1.0, 0.82, 0.58), name="lamp")
    down = np.eye(4)
    down[1, 3] = -0.72
    cord = prism(((-0.006, -0.006), (0.006, -0.006), (0.006, 0.006), (-0.006, 0.006)), -0.62, shade, "cord")
    parts = [cord, _cone((-0.6, 0.02), (-0.74, 0.2), shade, "shade")]
    animation.attachments += [Attachment(Instance(mesh, name=mesh.name), top) for mesh in parts]
    animation.attachments.append(Attachment(light, top, down))
    # A swing is a sine: cubic keys have its values and its slopes.
    phases = np.linspace(0.0, 2 * math.pi * LAMP_TURNS, LAMP_KEYS * LAMP_TURNS + 1)
    largest, speed = math.radians(LAMP_SWING), 2 * math.pi * LAMP_TURNS / DURATION
    halves = largest * np.sin(phases) / 2
    zero = np.zeros_like(halves)
    values = np.stack([zero, zero, np.sin(halves), np.cos(halves)], axis=1)
    slopes = np.stack([zero, zero, np.cos(halves), -np.sin(halves)], axis=1)
    slopes *= (largest * np.cos(phases) / 2 * speed)[:, None]
    keys = Track(np.linspace(0.0, DURATION, len(phases)), np.stack([slopes, values, slopes], axis=1), "cubic")
    animation.channels.append(Channel(top, "rotation", keys))
    return light


def _cone(upper: tuple[float, float], lower: tuple[float, float], material: Material, name: str) -> Mesh:
    """Make a flat-shaded cone about y, without caps, from two heights and radii."""
    segments = 24
    angles = np.linspace(0.0, 2 * math.pi, segments, endpoint=False)
    ring = np.stack([np.cos(angles), np.zeros(segments), -np.sin(angles)], axis=1)
    positions = np.concatenate([ring * radius + (0.0, height, 0.0) for height, radius in (lower, upper)])
    first = np.arange(segments)
    second = (first + 1) % segments
    triangles = [
        np.stack([first, second, second + segments], 1),
        np.stack([first, second + segments, first + segments], 1),
    ]
    return Mesh(positions.astype(np.float32), np.concatenate(triangles).astype(np.uint32), [material], name=name)


def _about(axis: int, angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return quaternions xyzw (t, 4) of rotations about an axis by radians (t,)."""
    found = np.zeros((len(angles), 4))
    found[:, axis], found[:, 3] = np.sin(angles / 2), np.cos(angles / 2)
    return found


def _rest(scene: Scene, lamp: PointLight) -> None:
    """Put everything where it is at the time 0."""
    posed = scene.at(0.0)
    for instance, its in zip(scene.instances, posed.instances, strict=True):
        instance.world_from_local, instance.joint_matrices = its.world_from_local, its.joint_matrices
    swung = posed.lights[scene.lights.index(lamp)]
    assert isinstance(swung, PointLight)
    lamp.position = swung.position
