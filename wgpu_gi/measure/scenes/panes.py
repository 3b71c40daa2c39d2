"""Generated rooms with things that light passes: panes, sheets, stacks of them, and solid glass."""

from __future__ import annotations

from ...scene.scene import Instance, Mesh, Scene
from .draws import Draws, place
from .layers import SOLID, THIN
from .lights import LAMPS, light_room, sky
from .rooms import Size, add_camera, add_walls, place_objects
from .solids import plane, solid
from .surfaces import SURFACES, WALLS, surface

CLOSED = ("box", "ball", "cylinder", "cone", "frustum", "torus")
OPEN = ("plane", "plane", "curtain")


def glass(draws: Draws) -> Scene:
    """Return a room of 2 to 8 things of glass or blended sheets, a stack of panes, and some opaque things."""
    size = (draws.uniform(3.0, 7.0), draws.uniform(2.4, 4.0), draws.uniform(3.0, 7.0))
    scene = Scene()
    opened = draws.chance(0.4)
    add_walls(draws, scene, size, WALLS, opened)
    add_camera(draws, scene, size)
    place_objects(draws, scene, size, lambda: _thing(draws), draws.integer(2, 8))
    if draws.chance(0.6):
        _add_stack(draws, scene, size)
    if opened:
        scene.environment = sky(draws, draws.log_uniform(0.5, 5.0))
    light_room(draws, scene, size, LAMPS, draws.integer(1, 4))
    return scene


def _thing(draws: Draws) -> Mesh:
    """Return a thin sheet, a closed body of glass, or something opaque."""
    kind = draws.choice(("thin", "thin", "solid", "solid", "opaque"))
    if kind == "opaque":
        return solid(draws, surface(draws, tuple(SURFACES)))
    names, shapes = (tuple(THIN), OPEN + CLOSED) if kind == "thin" else (tuple(SOLID), CLOSED)
    return solid(draws, surface(draws, names), draws.choice(shapes))


def _add_stack(draws: Draws, scene: Scene, size: Size) -> None:
    """Add two to five panes or sheets, one behind the other, across the view."""
    camera = scene.cameras[0]
    across = camera.world_from_view[:3, :3] @ draws.turn(draws.uniform(-0.6, 0.6))
    # The plane's +Y becomes the direction to the camera.
    rotation = across[:, [0, 2, 1]] * (1.0, 1.0, -1.0)
    width, gap = draws.uniform(0.3, 1.0), draws.log_uniform(0.005, 0.2)
    first = camera.position + across[:, 2] * -draws.uniform(0.8, 1.5)
    for k in range(draws.integer(2, 5)):
        mesh = plane(surface(draws, tuple(THIN)), name="stacked")
        position = first - across[:, 2] * gap * k
        scene.instances.append(Instance(mesh, place(position, width, rotation), f"stacked {k}"))
