"""Lights as text, for the command line and the viewer: new lights, and changes of a scene's lights."""

from __future__ import annotations

import math
from collections.abc import Iterable

from ...errors import GiError
from ...float_limits import LARGEST_LIGHT, MAX_COORDINATE
from ..scene import DirectionalLight, Light, PointLight, Scene, SpotLight

KINDS = {"sun": (2,), "point": (2,), "spot": (3, 4)}  # how many words follow
FORMS = '"sun dx,dy,dz r,g,b", "point x,y,z r,g,b" or "spot x,y,z dx,dy,dz r,g,b OUTER,INNER"'
ENVIRONMENT = "env"  # names the environment among the lights


def parse_light(text: str) -> Light:
    """Return the light that a text of one of these forms describes, `KINDS`.

    "sun dx,dy,dz r,g,b": the direction in which its light travels; r,g,b in lux (W/m2 on a plane facing it). "point
    x,y,z r,g,b": position in metres; r,g,b in candela (W/sr). "spot x,y,z dx,dy,dz r,g,b OUTER,INNER": position,
    direction, candela on the axis, and the angles from the axis in degrees at which the light ends and begins to fade;
    INNER is 0 and OUTER 45 by default, as in glTF. One number instead of r,g,b means white. Raises GiError for text
    that is malformed, not finite or negative, and for a sun or spot without direction.
    """
    kind, *words = text.split() or [""]
    if kind not in KINDS or len(words) not in KINDS[kind]:
        raise GiError(f"light {_short(text)} is not understood; write {FORMS}")
    if kind == "sun":
        return DirectionalLight(_place(text, words[0], "direction"), 1.0, _color(text, words[1]), name="sun")
    position = _place(text, words[0], "position")
    if max(map(abs, position)) > MAX_COORDINATE:
        raise GiError(f"light {_short(text)}: its position must lie within {MAX_COORDINATE:g} m")
    if kind == "point":
        return PointLight(position, 1.0, _color(text, words[1]), name="point")
    angles = _numbers(text, words[3]) if len(words) == 4 else [45.0]
    outer, inner = [*angles, 0.0][:2]
    if len(angles) > 2 or not 0.0 <= inner <= outer <= 90.0 or outer == 0.0:
        raise GiError(f"light {_short(text)}: the angles of a spot must be OUTER,INNER with 0 <= INNER <= OUTER <= 90")
    direction = _place(text, words[1], "direction")
    color = _color(text, words[2])
    return SpotLight(position, direction, math.radians(inner), math.radians(outer), 1.0, color, name="spot")


def _place(text: str, word: str, what: str) -> list[float]:
    """Parse three numbers, a position, or a direction that is not zero."""
    numbers = _numbers(text, word)
    if len(numbers) != 3:
        raise GiError(f"light {_short(text)} needs three numbers for its {what} and three for its colour")
    return _direction(text, numbers) if what == "direction" else numbers


def relight(scene: Scene, text: str) -> None:
    """Change a light of the scene by "LIGHT=r,g,b"; "LIGHT=r,g,b dx,dy,dz" also sets the direction of a sun.

    LIGHT is an index into `scene.lights` or a name; indices come before names. "env=r,g,b" sets the radiance of the
    environment, which multiplies its map; "env=r,g,b degrees" also rotates the map about +Y. Units are those of
    `parse_light`. Raises GiError for text that is malformed, not finite or negative, and with a list of the lights if
    there is no such light.
    """
    # Parse the text.
    name, _, rest = text.rpartition("=")
    words = rest.split()
    if not name or len(words) not in (1, 2):
        raise GiError(
            f'light {_short(text)} is not understood; write "LIGHT=r,g,b", for a sun also "LIGHT=r,g,b dx,dy,dz"'
        )
    color = _color(text, words[0])
    more = _numbers(text, words[1]) if len(words) == 2 else None
    # Change the environment.
    if name == ENVIRONMENT and scene.environment is not None:
        if more is not None and len(more) != 1:
            raise GiError(f"light {_short(text)}: the rotation of the environment must be one number, in degrees")
        scene.environment.color = color
        if more is not None:
            scene.environment.rotation = math.radians(more[0])
        return
    # Change a light.
    light = _light(scene, name)
    if light is None:
        known = [f"{place} {light.name!r}" for place, light in enumerate(scene.lights[:20])]
        known += [ENVIRONMENT] * (scene.environment is not None)
        raise GiError(
            f"light {_short(text)}: there is no light {_short(name)}; this scene has {', '.join(known) or 'none'}"
        )
    if more is not None:
        if not isinstance(light, DirectionalLight):
            raise GiError(f"light {_short(text)}: only suns have a direction that can be changed")
        light.direction = _direction(text, more)
    light.intensity, light.color = 1.0, color


def light_texts(scene: Scene) -> list[str]:
    """Return the texts with which `relight` sets each light, then the environment, to its current values."""
    texts = []
    for place, light in enumerate(scene.lights):
        text = f"{place}={_list(light.intensity * part for part in light.color)}"
        texts.append(f"{text} {_list(light.direction)}" if isinstance(light, DirectionalLight) else text)
    if scene.environment is not None:
        degrees = math.degrees(scene.environment.rotation)
        texts.append(f"{ENVIRONMENT}={_list(scene.environment.color)} {degrees:.9g}")
    return texts


def _light(scene: Scene, name: str) -> Light | None:
    """Return the light with an index, else the first one with a name."""
    if name.isdecimal() and len(name) < 10 and int(name) < len(scene.lights):
        return scene.lights[int(name)]
    return next((light for light in scene.lights if light.name == name), None)


def _color(text: str, word: str) -> tuple[float, float, float]:
    """Parse r,g,b, or one number for white."""
    color = _numbers(text, word)
    color = color * 3 if len(color) == 1 else color
    if len(color) != 3:
        raise GiError(f"light {_short(text)} needs one number or three for its colour")
    if not all(0 <= part <= LARGEST_LIGHT for part in color):
        raise GiError(f"light {_short(text)}: a light cannot be negative or above {LARGEST_LIGHT:g}")
    return color[0], color[1], color[2]


def _direction(text: str, direction: list[float]) -> list[float]:
    """Return `direction`. Raises GiError if it does not have three numbers or is zero."""
    if len(direction) != 3:
        raise GiError(f"light {_short(text)} needs three numbers for its direction")
    if not any(direction):
        raise GiError(f"light {_short(text)}: the direction 0,0,0 points nowhere; the sun at noon travels 0,-1,0")
    return direction


def _numbers(text: str, word: str) -> list[float]:
    """Parse comma-separated finite numbers."""
    try:
        values = [float(part) for part in word.split(",")]
    except ValueError:
        raise GiError(f"light {_short(text)}: {_short(word)} is not a list of numbers such as 0.3,-1,0.2") from None
    if not all(math.isfinite(value) for value in values):
        raise GiError(f"light {_short(text)}: all numbers must be finite")
    return values


def _short(text: str) -> str:
    """Return a text in quotes, without its end if it is long."""
    return repr(text if len(text) <= 80 else f"{text[:77]}...")


def _list(values: Iterable[float]) -> str:
    """Write numbers with the nine digits that float32 needs."""
    return ",".join(f"{float(value):.9g}" for value in values)
