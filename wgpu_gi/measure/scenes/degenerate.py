"""Generated scenes with degenerate geometry, lights in surfaces, and cameras in odd places.

Each scene is a room with two to five of the FLAWS and one camera of CAMERAS. Some cameras see little, on purpose.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ...camera import Camera
from ...scene.mesh_cleaning import has_area
from ...scene.scene import Instance, Mesh, Scene
from .draws import Draws, place
from .lights import lamp, point_light
from .rooms import RoomPlan, furnished_room
from .solids import box, plane, solid
from .surfaces import surface

PLAN = RoomPlan(object_count=(3, 7), light_count=(1, 4))
_UNLIKE_LAMPS = ("matte", "colored", "white", "glossy", "metal")


def degenerate(draws: Draws) -> Scene:
    """Return a room with flaws."""
    scene = furnished_room(draws, PLAN)
    for name in draws.sample(tuple(FLAWS), draws.integer(2, 5)):
        FLAWS[name](draws, scene)
    kind = draws.choice(tuple(CAMERAS))
    scene.cameras = [CAMERAS[kind](draws, scene)]
    scene.cameras[0].name = kind
    return scene


def _inside(draws: Draws, scene: Scene, margin: float = 0.2) -> np.ndarray:
    """Return a point in the middle of the scene, (3,) metres; `margin` is a share of its size."""
    low, high = scene.bounds()
    return low + (high - low) * (margin + (1 - 2 * margin) * draws.array(3))


# ------------------------------------------------------------------------------------------------ flaws


def _slivers(draws: Draws, scene: Scene) -> None:
    """Add a fan of triangles that are up to 1e5 times as long as wide."""
    count = draws.integer(5, 60)
    tips = draws.array(count, 3) - 0.5
    widths = 10 ** (-5 + 3 * draws.array(count))
    corners = np.stack([np.zeros((count, 3)), tips, tips + widths[:, None] * (draws.array(count, 3) - 0.5)], axis=1)
    points = corners.reshape(-1, 3).astype(np.float32)
    triangles = np.arange(3 * count, dtype=np.uint32).reshape(-1, 3)
    mesh = Mesh(points, triangles[has_area(points, triangles)], [surface(draws, _UNLIKE_LAMPS)], name="slivers")
    scene.instances.append(Instance(mesh, place(_inside(draws, scene), draws.uniform(0.5, 2)), "slivers"))


def _doubled(draws: Draws, scene: Scene) -> None:
    """Add an object twice at one place, with two materials."""
    first = solid(draws, surface(draws, _UNLIKE_LAMPS), draws.choice(("box", "ball", "plane")))
    second = Mesh(first.positions, first.triangles, [surface(draws)], normals=first.normals, name="doubled")
    second.texcoords0 = first.texcoords0
    matrix = place(_inside(draws, scene), draws.uniform(0.3, 1), draws.rotation())
    scene.instances += [Instance(first, matrix, "doubled"), Instance(second, matrix.copy(), "doubled")]


def _coplanar(draws: Draws, scene: Scene) -> None:
    """Add a carpet in the plane of the floor, one in that of the ceiling, or a box that stands in both."""
    x, _, z = _inside(draws, scene)
    top = scene.bounds()[1, 1]
    material, width = surface(draws), draws.uniform(0.5, 2.0)
    kind = draws.choice(("floor", "ceiling", "column"))
    if kind == "column":
        matrix, mesh = place((x, top / 2, z), (0.3, top, 0.3)), box(material)
    else:
        facing = np.eye(3) if kind == "floor" else np.diag([1.0, -1.0, -1.0])
        matrix, mesh = place((x, 0.0 if kind == "floor" else top, z), width, facing), plane(material)
    scene.instances.append(Instance(mesh, matrix, "coplanar"))


def _without_area(draws: Draws, scene: Scene) -> None:
    """Add an object with triangles that are points or lines, and unused vertices; and a mesh of nothing else."""
    mesh = solid(draws, surface(draws, _UNLIKE_LAMPS), "box")
    a, b, c = (mesh.triangles[:, k] for k in range(3))
    flat = np.concatenate([np.stack([a, a, a], 1), np.stack([a, b, a], 1), np.stack([c, b, b], 1)])
    mesh.triangles = np.concatenate([flat, mesh.triangles]).astype(np.uint32)
    for name in ("positions", "normals", "texcoords0"):
        values = getattr(mesh, name)
        if values is not None:
            setattr(mesh, name, np.concatenate([values, values[:3]]))
    points = Mesh(mesh.positions[:6], np.array([[0, 0, 0], [1, 2, 1]], np.uint32), [mesh.materials[0]], name="points")
    for item in (mesh, points):
        matrix = place(_inside(draws, scene), draws.uniform(0.3, 1), draws.rotation())
        scene.instances.append(Instance(item, matrix, "without area"))


def _mirrored(draws: Draws, scene: Scene) -> None:
    """Add instances of one mesh that are mirrored along one, two and three axes."""
    mesh = solid(draws, surface(draws))
    for signs in ((-1, 1, 1), (1, -1, -1), (-1, -1, -1)):
        matrix = place(_inside(draws, scene), np.array(signs) * draws.uniform(0.2, 0.8), draws.rotation())
        scene.instances.append(Instance(mesh, matrix, "mirrored"))


def _sheared(draws: Draws, scene: Scene) -> None:
    """Add an object that is sheared, and squeezed to as little as a thousandth along one axis."""
    matrix = place(
        _inside(draws, scene), (draws.uniform(0.3, 1.0), draws.log_uniform(1e-3, 1.0), 0.5), draws.rotation()
    )
    shear = np.eye(4)
    shear[0, 1], shear[0, 2], shear[1, 2] = draws.uniform(-2, 2), draws.uniform(-2, 2), draws.uniform(-2, 2)
    matrix = (matrix @ shear).astype(np.float32).astype(np.float64)
    scene.instances.append(Instance(solid(draws, surface(draws)), matrix, "sheared"))


def _light_in_surface(draws: Draws, scene: Scene) -> None:
    """Add a point light in the floor, in a wall or in an object; or an emitter in the plane of the ceiling."""
    x, y, z = _inside(draws, scene).tolist()
    low, high = scene.bounds()
    kind = draws.choice(("floor", "wall", "object", "emitter"))
    if kind == "emitter":
        panel = plane(lamp(draws, 100.0, 0.25), name="panel")
        matrix = place((x, high[1], z), 0.5, np.diag([1.0, -1.0, -1.0]))
        scene.instances.append(Instance(panel, matrix, "emitter in the ceiling"))
        return
    places = {"floor": (x, 0.0, z), "wall": (low[0], y, z)}
    centre = draws.choice(scene.instances).world_from_local[:3, 3].tolist()
    scene.lights.append(point_light(draws, places.get(kind, centre), 100.0, f"in {kind}"))


FLAWS: dict[str, Callable[[Draws, Scene], None]] = {
    "slivers": _slivers,
    "doubled": _doubled,
    "coplanar": _coplanar,
    "without area": _without_area,
    "mirrored": _mirrored,
    "sheared": _sheared,
    "light in surface": _light_in_surface,
}

# ------------------------------------------------------------------------------------------------ cameras


def _looking(draws: Draws, eye: object, direction: object, yfov_deg: float = 60.0) -> Camera:
    position = np.asarray(eye, np.float64)
    return Camera.look_at(position.tolist(), (position + np.asarray(direction)).tolist(), yfov_deg=yfov_deg)


def _camera_inside(draws: Draws, scene: Scene) -> Camera:
    """A camera in the middle of an object."""
    matrix = scene.instances[draws.integer(6, len(scene.instances) - 1)].world_from_local
    return _looking(draws, matrix[:3, 3], draws.rotation()[:, 0])


def _camera_pole(draws: Draws, scene: Scene) -> Camera:
    """A camera that looks straight up or down, parallel to its up vector."""
    return _looking(draws, _inside(draws, scene), (0.0, draws.choice((-1.0, 1.0)), 0.0))


def _camera_horizon(draws: Draws, scene: Scene) -> Camera:
    """A camera that looks horizontally in the plane of the floor, or a little above."""
    x, _, z = _inside(draws, scene)
    return _looking(draws, (x, draws.choice((0.0, 1e-6, 1e-3)), z), draws.turn()[:, 0])


def _camera_narrow(draws: Draws, scene: Scene) -> Camera:
    """The room's camera with a field of view of 0.1 to 5 degrees."""
    camera = scene.cameras[0]
    return Camera(camera.world_from_view, math.radians(draws.log_uniform(0.1, 5.0)))


def _camera_wide(draws: Draws, scene: Scene) -> Camera:
    """The room's camera with a field of view of 120 to 175 degrees."""
    camera = scene.cameras[0]
    return Camera(camera.world_from_view, math.radians(draws.uniform(120.0, 175.0)))


def _camera_orthographic(draws: Draws, scene: Scene) -> Camera:
    """An orthographic camera at the place of the room's own, or far behind the wall."""
    camera = Camera(scene.cameras[0].world_from_view.copy(), orthographic_height=draws.log_uniform(0.1, 8.0))
    if draws.chance(0.3):
        camera.world_from_view[:3, 3] += draws.log_uniform(1.0, 100.0) * camera.world_from_view[:3, 2]
    return camera


def _camera_rolled(draws: Draws, scene: Scene) -> Camera:
    """The room's camera, rolled upside down or by any angle."""
    pose = scene.cameras[0].world_from_view.copy()
    roll = draws.choice((math.pi, draws.uniform(-math.pi, math.pi)))
    c, s = math.cos(roll), math.sin(roll)
    pose[:3, :3] = pose[:3, :3] @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    return Camera(pose)


CAMERAS: dict[str, Callable[[Draws, Scene], Camera]] = {
    "ordinary": lambda draws, scene: scene.cameras[0],
    "inside an object": _camera_inside,
    "at a pole": _camera_pole,
    "at the horizon": _camera_horizon,
    "narrow": _camera_narrow,
    "wide": _camera_wide,
    "orthographic": _camera_orthographic,
    "rolled": _camera_rolled,
}
