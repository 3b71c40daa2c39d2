"""Built-in scenes. Most have a known solution, given in the docstring of the function.

Sources: Goral et al. 1984 and Cornell University's data of the box (measured colours; a metre here is 100 mm of the
original); Howell, "A Catalog of Radiation Heat Transfer Configuration Factors", C-11 (parallel squares).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from ...camera import Camera
from ...errors import GiError, known_names
from ..scene import DirectionalLight, Environment, Instance, Light, Material, Mesh, PointLight, Scene, SpotLight
from .balls import materials
from .shapes import Point3, arch, box, grid, prism, quad, quads, sphere
from .walk import walk


def builtin_scene(name: str) -> Scene:
    """Build the scene `name` of BUILTIN_SCENES with its default arguments. Raises GiError for other names."""
    if name not in BUILTIN_SCENES:
        raise GiError(f"there is no built-in scene {name!r}; {known_names(name, BUILTIN_SCENES)}")
    scene = BUILTIN_SCENES[name]()
    scene.name = name
    return scene


def matte(
    albedo: float | Sequence[float], name: str = "", emission: float = 0.0, double_sided: bool = True
) -> Material:
    """Return a Lambert material: grey or RGB `albedo`, grey `emission` radiance."""
    red, green, blue = np.broadcast_to(np.asarray(albedo, np.float64), 3).tolist()
    return Material(name, (red, green, blue, 1.0), emission=(emission,) * 3, double_sided=double_sided)


def _scene(meshes: list[Mesh], camera: Camera, lights: Sequence[Light] = (), sky: float | None = None) -> Scene:
    """Return a scene of meshes in world space, in a constant environment of radiance `sky` if given."""
    return Scene(
        instances=[Instance(m, name=m.name) for m in meshes],
        lights=list(lights),
        environment=None if sky is None else Environment((sky, sky, sky)),
        cameras=[camera],
    )


# ------------------------------------------------------------------------------------------------ Cornell box

CORNELL_WALLS: dict[str, tuple[str, list[list[Point3]]]] = {
    "back": ("white", [[(5.496, 0, 5.592), (0, 0, 5.592), (0, 5.488, 5.592), (5.56, 5.488, 5.592)]]),
    "ceiling": (
        "white",
        [
            [(5.56, 5.488, 0), (5.56, 5.488, 5.592), (0, 5.488, 5.592), (0, 5.488, 0)],
            [(2.13, 5.488, 2.27), (2.13, 5.488, 3.32), (3.43, 5.488, 3.32), (3.43, 5.488, 2.27)],
        ],
    ),
    "floor": ("white", [[(5.528, 0, 0), (0, 0, 0), (0, 0, 5.592), (5.496, 0, 5.592)]]),
    "greenwall": ("green", [[(0, 0, 5.592), (0, 0, 0), (0, 5.488, 0), (0, 5.488, 5.592)]]),
    "redwall": ("red", [[(5.528, 0, 0), (5.496, 0, 5.592), (5.56, 5.488, 5.592), (5.56, 5.488, 0)]]),
}
CORNELL_LUMINAIRE: list[Point3] = [(3.43, 5.478, 2.27), (3.43, 5.478, 3.32), (2.13, 5.478, 3.32), (2.13, 5.478, 2.27)]
LARGE_BOX = ((4.23, 2.47), (4.72, 4.06), (3.14, 4.56), (2.65, 2.96))
SMALL_BOX = ((1.3, 0.65), (2.9, 1.14), (2.4, 2.72), (0.82, 2.25))


def _cornell_room(lights: Sequence[Light] = (), luminaire: bool = False) -> Scene:
    """Build the room with both boxes, the measured colours, and the camera: its 16:9 frame shows only the room."""
    materials = {
        "white": matte((0.725, 0.71, 0.68), "white"),
        "red": matte((0.63, 0.065, 0.05), "red"),
        "green": matte((0.14, 0.45, 0.091), "green"),
    }
    meshes = [quads(polygons, materials[colour], name) for name, (colour, polygons) in CORNELL_WALLS.items()]
    meshes.append(prism(LARGE_BOX, 3.3, materials["white"], "largebox"))
    meshes.append(prism(SMALL_BOX, 1.65, materials["white"], "smallbox"))
    if luminaire:
        light = matte(0.78, "light", double_sided=False)
        light.emission = (17.0, 12.0, 4.0)
        meshes.append(quads([CORNELL_LUMINAIRE], light, "luminaire"))
    camera = Camera.look_at((2.78, 2.73, -2.6), (2.78, 2.73, 0.0), yfov_deg=61.5, name="camera")
    return _scene(meshes, camera, lights)


def cornell() -> Scene:
    """The Cornell box under its ceiling lamp, emission (17, 12, 4). No closed form; `scenes/cornell` is the same."""
    return _cornell_room(luminaire=True)


def cornell_point(intensity: float = 30.0) -> Scene:
    """The Cornell box under a point light of `intensity` cd below the ceiling."""
    return _cornell_room([PointLight((2.78, 5.2, 2.795), intensity, (1.0, 0.85, 0.6), name="point")])


def cornell_spot(intensity: float = 400.0) -> Scene:
    """The Cornell box under a narrow spot of `intensity` cd aimed at the red wall: nearly all light is indirect."""
    position, aim = np.array((1.0, 4.2, 1.0)), np.array((5.52, 2.4, 1.5))
    angles = (math.radians(10), math.radians(13))
    spot = SpotLight(position.tolist(), (aim - position).tolist(), *angles, intensity, (1.0, 0.95, 0.85), name="spot")
    return _cornell_room([spot])


# ------------------------------------------------------------------------------------------------ closed forms


def furnace(albedo: float = 0.5, sky: float = 1.0, subdivisions: int = 3) -> Scene:
    """A convex matte ball in a constant environment: L = albedo * sky on the ball, L = sky elsewhere.

    Every point of a convex body sees only the sky, so E = pi sky, and there is no interreflection.
    """
    camera = Camera.look_at((0, 0, 3.5), (0, 0, 0), yfov_deg=40.0, name="front")
    return _scene([sphere(subdivisions=subdivisions, material=matte(albedo, "matte"), name="ball")], camera, sky=sky)


def sphere_light(radius: float = 2.0, albedo: float = 0.5, intensity: float = 10.0, subdivisions: int = 4) -> Scene:
    """A point light of I = `intensity` cd at the centre of a closed matte sphere of R = `radius`, camera inside.

    Direct E = I/R2 everywhere. Interreflected light in a sphere is uniform, and bounce k adds rho^k of it: direct
    L = rho E/pi, the next bounce adds rho2 E/pi, and all bounces give L = rho E / (pi (1 - rho)). The facets, scaled to
    the sphere's area, give the exact mean; from 4 subdivisions on, single points are within 0.5 %.
    """
    wall = sphere((0, 0, 0), radius, subdivisions, matte(albedo, "wall"), inward=True, name="sphere")
    camera = Camera.look_at((0, 0, radius / 2), (0, 0, -radius), yfov_deg=90.0, name="inside")
    return _scene([wall], camera, [PointLight((0.0, 0.0, 0.0), intensity, name="centre")])


def closed_box(emission: float = 1.0, albedo: float = 0.5, size: Sequence[float] = (4.0, 3.0, 2.0)) -> Scene:
    """A closed box whose walls all emit Le and reflect rho, camera inside: L = Le / (1 - rho) in every pixel.

    Direct light adds rho Le, bounce k adds rho^(k + 1) Le.
    """
    half = np.asarray(size, np.float64) / 2
    room = box((-half).tolist(), half.tolist(), matte(albedo, "glow", emission), inward=True, name="room")
    return _scene([room], Camera.look_at((0, 0, 0), (0.3, -0.2, -1.0), yfov_deg=70.0, name="inside"))


def plates_form_factor(distance: float = 1.0) -> float:
    """Return the form factor between two aligned parallel unit squares `distance` metres apart (Howell C-11)."""
    x = 1.0 / distance
    root = math.sqrt(1 + x * x)
    logarithm = math.log((1 + x * x) / math.sqrt(1 + 2 * x * x))
    return 2 / (math.pi * x * x) * (logarithm + 2 * x * root * math.atan(x / root) - 2 * x * math.atan(x))


def plates(distance: float = 1.0, emission: float = 1.0, albedo: float = 0.5) -> Scene:
    """Two unit squares facing each other: the upper one emits Le and is black, the lower one has albedo rho.

    The mean of E over the lower one is pi Le F, so the mean of the picture is L = rho Le F with
    F = `plates_form_factor(distance)` (0.19982 at 1 m). The camera between the plates is orthographic and looks down; a
    square picture shows exactly the lower one.
    """
    lower = quad((-0.5, 0, 0.5), (1, 0, 0), (0, 0, -1), matte(albedo, "receiver"), "receiver")
    lamp = matte(0.0, "lamp", emission, double_sided=False)
    upper = quad((-0.5, distance, -0.5), (1, 0, 0), (0, 0, 1), lamp, "lamp")
    camera = Camera.look_at((0, distance / 2, 0), (0, 0, 0), up=(0, 0, -1), name="down")
    camera.orthographic_height = 1.0
    return _scene([lower, upper], camera)


def plane_point(height: float = 2.0, intensity: float = 10.0, albedo: float = 0.5, size: float = 8.0) -> Scene:
    """A matte floor under a point light of I = `intensity` cd at `height` h: L = rho I h / (pi (h2 + r2)^1.5).

    r is the distance on the floor from the origin, below the light; E = I cos/d2, L = rho E/pi, and there is no
    interreflection. The camera is orthographic, 4 m high, and looks down with -Z on top, so that pixels map linearly to
    x and z.
    """
    floor = grid(size, material=matte(albedo, "floor"), name="floor")
    camera = Camera.look_at((0, 2 * height, 0), (0, 0, 0), up=(0, 0, -1), name="down")
    camera.orthographic_height = 4.0
    return _scene([floor], camera, [PointLight((0.0, height, 0.0), intensity, name="lamp")])


def plane_sun(lux: float = 3.0, zenith_deg: float = 60.0, albedo: float = 0.5, size: float = 8.0) -> Scene:
    """A matte floor under a sun `zenith_deg` from the zenith: L = albedo lux cos(zenith) / pi in every pixel."""
    scene = plane_point(albedo=albedo, size=size)
    zenith = math.radians(zenith_deg)
    scene.lights = [DirectionalLight((math.sin(zenith), -math.cos(zenith), 0.0), lux, name="sun")]
    return scene


# ------------------------------------------------------------------------------------------------ light leaks

# Material, lower and upper corner (x, y, z) of each block. Walls overlap floor, ceiling and each other, so that no ray
# passes between them. The corridor lies along x between z = -1 and 1; the sealed chamber has walls of 10 cm.
CORRIDOR_BLOCKS: dict[str, tuple[str, Point3, Point3]] = {
    "floor": ("floor", (-0.4, -0.2, -4.8), (10.4, 0.0, 4.8)),
    "ceiling": ("grey", (-0.4, 2.6, -4.8), (10.4, 2.8, 4.8)),
    "end_west": ("grey", (-0.2, -0.1, -1.2), (0.0, 2.7, 1.2)),
    "end_east": ("grey", (10.0, -0.1, -1.2), (10.2, 2.7, 1.2)),
    "north_sealed_10cm": ("grey", (-0.1, -0.1, 1.0), (3.1, 2.7, 1.1)),
    "north_a": ("grey", (3.0, -0.1, 1.0), (4.2, 2.7, 1.2)),
    "north_b": ("grey", (5.2, -0.1, 1.0), (10.1, 2.7, 1.2)),
    "north_lintel": ("grey", (4.1, 2.1, 1.0), (5.3, 2.7, 1.2)),
    "south_a": ("grey", (-0.1, -0.1, -1.2), (6.8, 2.7, -1.0)),
    "south_b": ("grey", (7.8, -0.1, -1.2), (10.1, 2.7, -1.0)),
    "south_lintel": ("grey", (6.7, 2.1, -1.2), (7.9, 2.7, -1.0)),
    "warm_west": ("warm", (3.0, -0.1, 1.1), (3.2, 2.7, 4.6)),
    "warm_east": ("warm", (6.6, -0.1, 1.1), (6.8, 2.7, 4.6)),
    "warm_north": ("warm", (3.1, -0.1, 4.4), (6.7, 2.7, 4.6)),
    "cool_west": ("cool", (5.4, -0.1, -4.6), (5.6, 2.7, -1.1)),
    "cool_east": ("cool", (9.0, -0.1, -4.6), (9.2, 2.7, -1.1)),
    "cool_south": ("cool", (5.5, -0.1, -4.6), (9.1, 2.7, -4.4)),
    "sealed_west": ("sealed", (-0.1, -0.1, 1.05), (0.0, 2.7, 3.5)),
    "sealed_east": ("sealed", (2.9, -0.1, 1.05), (3.05, 2.7, 3.5)),
    "sealed_north": ("sealed", (-0.1, -0.1, 3.4), (3.05, 2.7, 3.5)),
}


def corridor(lamp: float = 300.0, sealed_lamp: float = 1200.0) -> Scene:
    """A dark corridor between two lit rooms, warm and cool, and a sealed chamber with a magenta lamp; lamps in cd.

    No light leaves the chamber, so the picture does not depend on `sealed_lamp`, and is black for `lamp` = 0. All light
    in the corridor comes through two doors, most of it after several bounces.
    """
    materials = {
        "grey": matte(0.7, "grey"),
        "warm": matte((0.75, 0.45, 0.25), "warm"),
        "cool": matte((0.3, 0.5, 0.75), "cool"),
        "floor": matte((0.45, 0.42, 0.38), "floor"),
        "sealed": matte((0.8, 0.3, 0.8), "sealed"),
    }
    blocks = [box(low, high, materials[colour], name=name) for name, (colour, low, high) in CORRIDOR_BLOCKS.items()]
    lights = [
        PointLight((4.9, 2.2, 3.2), lamp, (1.0, 0.9, 0.75), name="warm_lamp"),
        PointLight((7.3, 2.2, -3.2), lamp, (0.75, 0.9, 1.0), name="cool_lamp"),
        PointLight((1.4, 1.5, 2.2), sealed_lamp, (1.0, 0.2, 1.0), name="sealed_lamp"),
    ]
    scene = _scene(blocks, Camera.look_at((9.5, 1.6, 0.2), (2.0, 1.15, 0.0), name="east"), lights)
    scene.cameras.append(Camera.look_at((0.4, 1.5, -0.6), (6.0, 1.2, 0.6), name="west"))
    return scene


def curtain(lamp: float = 60.0) -> Scene:
    """A room divided by a curtain of zero thickness, with a lamp of `lamp` cd close to one side of it; no closed form.

    The curtain consists of a flat sheet (its front faces the dark side) and a folded cloth; a gap of 1.2 m follows. The
    lamp's cone ends before the gap, so the visible half gets no direct light: all its light comes through the gap.
    """
    room = box((-3.0, 0.0, -2.0), (3.0, 2.6, 2.0), matte((0.7, 0.68, 0.64), "plaster"), inward=True, name="room")
    sheet = matte((0.25, 0.4, 0.7), "sheet", double_sided=False)
    flat = quad((0.0, 0.0, -0.6), (0.0, 0.0, -1.4), (0.0, 2.6, 0.0), sheet, "sheet")
    z = np.linspace(-0.6, 0.8, 57)
    folds = pairwise(zip(0.04 * np.sin(10 * np.pi * (z + 0.6)), z, strict=True))
    strips = [((x0, 0.0, z0), (x1, 0.0, z1), (x1, 2.6, z1), (x0, 2.6, z0)) for (x0, z0), (x1, z1) in folds]
    cloth = quads(strips, matte((0.7, 0.35, 0.25), "cloth"), "cloth")
    spot = SpotLight(
        (-0.7, 2.0, -1.2), (0, -1, 0), math.radians(30), math.radians(45), lamp, (1.0, 0.9, 0.75), name="lamp"
    )
    return _scene(
        [room, flat, cloth], Camera.look_at((2.7, 1.6, -1.5), (0.2, 1.1, 0.5), yfov_deg=65.0, name="dark"), [spot]
    )


# ------------------------------------------------------------------------------------------------ outdoors

# Material, lower and upper corner of each block. Blocks reach 10 cm into the ground. The wall with the gate lies along
# x at z = -6, open between x = -1.5 and 1.5.
COURTYARD_BLOCKS: dict[str, tuple[str, Point3, Point3]] = {
    "gate_west": ("plaster", (-8.0, -0.1, -6.6), (-1.5, 4.6, -6.0)),
    "gate_east": ("plaster", (1.5, -0.1, -6.6), (7.0, 4.6, -6.0)),
    "behind_gate": ("plaster", (-8.0, -0.1, -12.4), (7.0, 6.0, -12.0)),
    "west": ("brick", (-8.6, -0.1, -6.6), (-8.0, 3.6, 6.0)),
    "step_low": ("stone", (-8.1, -0.1, -2.0), (-5.2, 0.16, 2.5)),
    "step_high": ("stone", (-8.1, -0.1, -1.7), (-5.5, 0.32, 2.2)),
    "pillar_a": ("stone", (-6.1, -0.1, -1.5), (-5.7, 2.8, -1.1)),
    "pillar_b": ("stone", (-6.1, -0.1, 0.05), (-5.7, 2.8, 0.45)),
    "pillar_c": ("stone", (-6.1, -0.1, 1.6), (-5.7, 2.8, 2.0)),
    "portico": ("stone", (-8.1, 2.8, -1.7), (-5.5, 3.05, 2.2)),
    "crate_large": ("timber", (2.6, -0.1, -4.2), (3.9, 1.3, -2.9)),
    "crate_small": ("teal", (2.9, 1.3, -3.9), (3.6, 1.9, -3.2)),
    "bench": ("timber", (-1.9, 0.35, -3.4), (0.3, 0.45, -2.9)),
    "bench_west": ("stone", (-1.7, -0.1, -3.35), (-1.5, 0.35, -2.95)),
    "bench_east": ("stone", (-0.1, -0.1, -3.35), (0.1, 0.35, -2.95)),
    "pole": ("dark", (1.2, -0.1, -1.2), (1.26, 4.5, -1.14)),
}


def courtyard(lux: float = 3.0) -> Scene:
    """A courtyard with a gate, a portico and a pole 6 cm thick under sun and sky, from eye level; no closed form."""
    materials = {
        "plaster": matte((0.72, 0.66, 0.55), "plaster"),
        "brick": matte((0.55, 0.2, 0.13), "brick"),
        "stone": matte((0.6, 0.58, 0.54), "stone"),
        "timber": matte((0.42, 0.27, 0.14), "timber"),
        "teal": matte((0.1, 0.42, 0.42), "teal"),
        "dark": matte(0.12, "dark"),
    }
    blocks = [box(low, high, materials[colour], name=name) for name, (colour, low, high) in COURTYARD_BLOCKS.items()]
    blocks.append(arch((-1.5, 2.1, -6.6), (1.5, 4.6, -6.0), materials["plaster"], "gate"))
    blocks.append(grid(40.0, material=matte((0.4, 0.38, 0.33), "ground"), name="ground"))
    camera = Camera.look_at((2.6, 1.65, 3.4), (-1.4, 1.5, -3.5), name="pedestrian")
    scene = _scene(blocks, camera, [DirectionalLight((-0.7, -0.6, -0.25), lux, (1.0, 0.93, 0.8), name="sun")])
    scene.environment = Environment((0.15, 0.2, 0.28), name="sky")
    return scene


BUILTIN_SCENES: dict[str, Callable[[], Scene]] = {
    "cornell": cornell,
    "cornell-point": cornell_point,
    "cornell-spot": cornell_spot,
    "furnace": furnace,
    "sphere-light": sphere_light,
    "closed-box": closed_box,
    "plates": plates,
    "plane-point": plane_point,
    "plane-sun": plane_sun,
    "corridor": corridor,
    "curtain": curtain,
    "courtyard": courtyard,
    "walk": walk,
    "materials": materials,
}
