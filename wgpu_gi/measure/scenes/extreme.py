"""Generated scenes of extreme brightness and reflectance: a room or street with one to three of the EXTREMES."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...scene.scene import Environment, Scene
from .draws import Draws
from .lights import emitters, scaled_color, scaled_light
from .outdoors import street
from .rooms import furnished_room
from .textures import grey, rgba

DIMMEST, BRIGHTEST = 1e-12, 1e12


def extreme(draws: Draws) -> Scene:
    """Return a room or street with extremes of light and reflectance."""
    scene = draws.choice((furnished_room, furnished_room, street))(draws)
    for name in draws.sample(tuple(EXTREMES), draws.integer(1, 3)):
        EXTREMES[name](draws, scene)
    return scene


def _all_lights(draws: Draws, scene: Scene) -> None:
    """Make all light 1e-12 to 1e12 times as bright; no single value leaves that range."""
    factor = _brightness(draws)
    scene.lights = [scaled_light(light, _bounded(light.intensity, factor)) for light in scene.lights]
    for material in emitters(scene.meshes):
        material.emission = scaled_color(material.emission, _bounded(max(material.emission), factor))
    sky = scene.environment
    if sky is not None and sky.image is not None:
        # Environment files hold radiance up to 1e10.
        sky.image = np.minimum(sky.image * np.float32(factor), np.float32(1e10))
    elif sky is not None:
        sky.color = scaled_color(sky.color, _bounded(max(sky.color), factor))


def _one_light(draws: Draws, scene: Scene) -> None:
    """Make one light or emitter of a scene 1e-12 to 1e12 W/sr or W/(m2 sr), whatever the others are."""
    value = _brightness(draws)
    lamps = emitters(scene.meshes)
    if scene.lights and (not lamps or draws.chance(0.5)):
        index = draws.integer(0, len(scene.lights) - 1)
        scene.lights[index].intensity = value
    elif lamps:
        material = draws.choice(lamps)
        material.emission = scaled_color(material.emission, value / max(material.emission))


def _bright_pixel(draws: Draws, scene: Scene) -> None:
    """Give the scene a sky image of which one pixel has a radiance of 1e6."""
    height = draws.choice((1, 16, 64))
    pixels = draws.uniform(0.0, 1.0) * draws.array(height, 2 * height, 3)
    pixels[draws.integer(0, (height - 1) // 2), draws.integer(0, 2 * height - 1)] = 1e6
    scene.environment = Environment(image=pixels.astype(np.float32), name="bright pixel")


def _black_and_white(draws: Draws, scene: Scene) -> None:
    """Make the base colour of a third of the materials exactly 0, of another third exactly 1."""
    for material in scene.materials:
        share = draws.uniform()
        if share < 2 / 3:
            material.base_color = rgba(grey(float(share < 1 / 3)))


def _all_white(draws: Draws, scene: Scene) -> None:
    """Make the base colour of every material 1, so that light in a closed room never ends."""
    for material in scene.materials:
        material.base_color = rgba(grey(1.0))


def _pure_channels(draws: Draws, scene: Scene) -> None:
    """Leave one channel of each light's colour, and make materials reflect one channel only."""
    for light in scene.lights:
        channel = draws.integer(0, 2)
        light.color = (float(channel == 0), float(channel == 1), float(channel == 2))
    for material in scene.materials:
        if draws.chance(0.5):
            keep = draws.integer(0, 2)
            red, green, blue = (value * (k == keep) for k, value in enumerate(material.base_color[:3]))
            material.base_color = rgba((red, green, blue))


def _end_of_ranges(draws: Draws, scene: Scene) -> None:
    """Set roughness and metalness to exactly 0 or 1."""
    for material in scene.materials:
        material.roughness, material.metallic = float(draws.integer(0, 1)), float(draws.integer(0, 1))


def _brightness(draws: Draws) -> float:
    """Return a number between the dimmest and the brightest, often one of the two."""
    return draws.choice((DIMMEST, BRIGHTEST, draws.log_uniform(DIMMEST, BRIGHTEST)))


def _bounded(value: float, factor: float) -> float:
    """Return the factor nearest to `factor` that keeps `value` within the brightest and dimmest."""
    return float(np.clip(value * factor, DIMMEST, BRIGHTEST)) / value


EXTREMES: dict[str, Callable[[Draws, Scene], None]] = {
    "all lights": _all_lights,
    "one light": _one_light,
    "bright pixel": _bright_pixel,
    "black and white": _black_and_white,
    "all white": _all_white,
    "pure channels": _pure_channels,
    "end of ranges": _end_of_ranges,
}
