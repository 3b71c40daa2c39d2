"""Lights as a line of text says them: new ones, and changes of those that a scene has."""

from __future__ import annotations

import math
from collections.abc import Iterable

from ...errors import GiError
from ..scene import DirectionalLight, Light, PointLight, Scene

ENVIRONMENT = "env"  # as the name of a light


def parse_light(text: str) -> Light:
    """Return the light that "sun dx,dy,dz r,g,b" or "point x,y,z r,g,b" describes.

    The sun's direction is that of travel and its r,g,b are lux (W/m2) on a plane facing it; a point's position is in
    metres and its r,g,b are candela (W/sr). One value instead of three is white light. Raises GiError if malformed,
    not finite or negative, or without direction.
    """
    words = text.split()
    if len(words) != 3 or words[0] not in ("sun", "point"):
        raise GiError(f'light {text!r} is not understood; write "sun dx,dy,dz r,g,b" or "point x,y,z r,g,b"')
    where = _numbers(text, words[1])
    place = "direction" if words[0] == "sun" else "position"
    if len(where) != 3:
        raise GiError(f"light {text!r} needs three numbers for its {place} and three for its colour")
    color = _color(text, words[2])
    if words[0] == "point":
        return PointLight(where, 1.0, color, name="point")
    return DirectionalLight(_direction(text, where), 1.0, color, name="sun")


def relight(scene: Scene, text: str) -> None:
    """Change a light of the scene as "LIGHT=r,g,b" says, a sun's direction, too: "LIGHT=r,g,b dx,dy,dz".

    LIGHT is a place in `scene.lights`, from 0, or a name; places win. "env=r,g,b" is the environment's constant
    radiance, or what multiplies its picture; "env=r,g,b degrees" also turns the picture about +Y. Units are those of
    `parse_light`. Raises GiError if malformed, not finite or negative, and listing the lights if there is none such.
    """
    name, _, rest = text.rpartition("=")
    words = rest.split()
    if not name or len(words) not in (1, 2):
        raise GiError(f'light {text!r} is not understood; write "LIGHT=r,g,b", for a sun also "LIGHT=r,g,b dx,dy,dz"')
    color = _color(text, words[0])
    more = _numbers(text, words[1]) if len(words) == 2 else None
    if name == ENVIRONMENT and scene.environment is not None:
        if more is not None and len(more) != 1:
            raise GiError(f"light {text!r}: an environment is turned by one number, in degrees")
        scene.environment.color = color
        if more is not None:
            scene.environment.rotation = math.radians(more[0])
        return
    light = _light(scene, name)
    if light is None:
        known = [f"{place} {light.name!r}" for place, light in enumerate(scene.lights[:20])]
        known += [ENVIRONMENT] * (scene.environment is not None)
        raise GiError(f"light {text!r}: there is no light {name!r}; this scene has {', '.join(known) or 'none'}")
    if more is not None:
        if not isinstance(light, DirectionalLight):
            raise GiError(f"light {text!r}: only of a sun the direction can be changed")
        light.direction = _direction(text, more)
    light.intensity, light.color = 1.0, color


def light_texts(scene: Scene) -> list[str]:
    """Return what makes each light, and then the environment, what it is by `relight`."""
    texts = []
    for place, light in enumerate(scene.lights):
        text = f"{place}={_list(light.intensity * part for part in light.color)}"
        texts.append(f"{text} {_list(light.direction)}" if isinstance(light, DirectionalLight) else text)
    if scene.environment is not None:
        degrees = math.degrees(scene.environment.rotation)
        texts.append(f"{ENVIRONMENT}={_list(scene.environment.color)} {degrees:.9g}")
    return texts


def _light(scene: Scene, name: str) -> Light | None:
    """Return the light at a place, else the first of a name."""
    if name.isdecimal() and int(name) < len(scene.lights):
        return scene.lights[int(name)]
    return next((light for light in scene.lights if light.name == name), None)


def _color(text: str, word: str) -> tuple[float, float, float]:
    """Return r,g,b; one value is white."""
    color = _numbers(text, word)
    color = color * 3 if len(color) == 1 else color
    if len(color) != 3:
        raise GiError(f"light {text!r} needs one number or three for its colour")
    if min(color) < 0:
        raise GiError(f"light {text!r}: a light cannot be negative")
    return color[0], color[1], color[2]


def _direction(text: str, direction: list[float]) -> list[float]:
    if len(direction) != 3:
        raise GiError(f"light {text!r} needs three numbers for its direction")
    if not any(direction):
        raise GiError(f"light {text!r}: the direction 0,0,0 points nowhere; the sun at noon travels 0,-1,0")
    return direction


def _numbers(text: str, word: str) -> list[float]:
    """Parse comma-separated finite numbers."""
    try:
        values = [float(part) for part in word.split(",")]
    except ValueError:
        raise GiError(f"light {text!r}: {word!r} is not a list of numbers such as 0.3,-1,0.2") from None
    if not all(math.isfinite(value) for value in values):
        raise GiError(f"light {text!r}: all numbers must be finite")
    return values


def _list(values: Iterable[float]) -> str:
    """Write numbers with all digits that the GPU's have."""
    return ",".join(f"{float(value):.9g}" for value in values)
