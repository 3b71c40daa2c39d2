"""Random scenes: `make_scene(kind, seed)` is a pure function, for tests of relations and of errors against truth.

Lengths are metres; lights are bright enough for an irradiance near 10 W/m2 in a room. Albedos are at most 0.95, except
in `extreme`. Values are rounded to float32, so that no platform's last bit of a sine shows.
"""

from __future__ import annotations

from collections.abc import Callable

from ...errors import GiError, known_names
from ...scene.scene import Scene
from .degenerate import degenerate
from .draws import Draws
from .extreme import extreme
from .moving import moving
from .outdoors import foliage, street
from .panes import glass
from .rooms import GLOSSY_ROOM, LAYERED_ROOM, TEXTURED_ROOM, furnished_room, many
from .scales import far, huge, tiny

_MAKERS: dict[str, Callable[[Draws], Scene]] = {
    "room": furnished_room,
    "street": street,
    "foliage": foliage,
    "glossy": lambda draws: furnished_room(draws, GLOSSY_ROOM),
    "textured": lambda draws: furnished_room(draws, TEXTURED_ROOM),
    "many": many,
    "tiny": tiny,
    "huge": huge,
    "far": far,
    "degenerate": degenerate,
    "extreme": extreme,
    "moving": moving,
    "layered": lambda draws: furnished_room(draws, LAYERED_ROOM),
    "glass": glass,
}

KINDS = tuple(_MAKERS)


def make_scene(kind: str, seed: int) -> Scene:
    """Return the scene of a kind and seed, named "kind-seed", with one camera.

    room: closed, 3 to 12 objects of 21 kinds of material, 1 to 6 lights, perhaps an opening to a sky. street: open
    ground, houses, thin walls, sun and sky. foliage: alpha-masked cards and thin strips. glossy: roughness 0 to 1,
    metals, normal maps. textured: colour and emission textures, few bright texels, vertex colours. many: hundreds of
    lights and instances. tiny, huge: rooms and streets scaled by 1e-6 to 1e6. far: at up to 1e7 m. degenerate: slivers,
    doubled and coplanar faces, odd transforms and cameras. extreme: intensities 1e-12 to 1e12, albedo 0 and 1. moving:
    a room with skins, morph targets and moving instances, lights and materials, at a random time of its animation.
    layered: clear coats, sheen, anisotropy, dielectrics, their textures. glass: panes, blended sheets, stacks of them,
    solid and rough glass.

    Raises GiError for an unknown kind or a seed below 0.
    """
    if kind not in _MAKERS:
        raise GiError(f"there is no kind of scene {kind!r}; {known_names(kind, KINDS)}")
    if seed < 0:
        raise GiError(f"the seed of a scene must be at least 0, not {seed}")
    scene = _MAKERS[kind](Draws(seed, KINDS.index(kind)))
    scene.name = f"{kind}-{seed}"
    return scene
