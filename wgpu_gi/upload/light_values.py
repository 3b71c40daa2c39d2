"""The light that a scene's values stand for, with all factors: candela, lux and radiance, (3,) float64.

Channels below SMALLEST_LIGHT are zero, so that no power, area or square of light vanishes in float32 where its factors
do not.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..float_limits import SMALLEST_LIGHT
from ..scene.scene import Environment, Light, Material, Scene, Texture, values_of

Color = NDArray[np.float64]
UNIT_STEP = 16  # of the exponent of `light_unit`


def punctual_light(light: Light) -> Color:
    """Return candela of a point or spot light, lux of a directional one."""
    return _or_none(np.asarray(light.color, np.float64) * light.intensity)


def emitted_radiance(material: Material) -> Color:
    """Return the radiance of an emitter without its texture, W/(m2 sr)."""
    return _or_none(material.emission)


def environment_radiance(environment: Environment | None) -> Color:
    """Return the radiance of an environment, or the factor of its picture."""
    return np.zeros(3) if environment is None else _or_none(environment.color)


def light_unit(scene: Scene) -> float:
    """Return a power of two from one to 2^17 times the brightest light; 1 without light.

    Its exponent is a multiple of 16: a light that dims or brightens a little leaves the uniform as it is, so that the
    G-buffer is kept. Float32 holds the square of 2^-46 of the brightest light.
    """
    materials = scene.materials
    lights = [punctual_light(light) for light in scene.lights] + [emitted_radiance(m) for m in materials]
    lights += [np.asarray(m.base_color[:3], np.float64) for m in materials if m.unlit]
    environment = scene.environment
    if environment is not None:
        lights.append(environment_radiance(environment) * (1 if environment.image is None else environment.image.max()))
    brightest = float(max((light.max() for light in lights), default=0.0))
    if brightest == 0:
        return 1.0
    exponent = math.frexp(max(brightest, SMALLEST_LIGHT))[1]
    return 2.0 ** (UNIT_STEP * math.ceil(exponent / UNIT_STEP))


def emission_key(material: Material) -> tuple[Any, ...]:
    """Return the values of a material that its light depends on, in comparable form."""
    shared = (id(material), tuple(material.emission), material.double_sided, material.unlit)
    values = (*shared, _texture_key(material.emission_texture))
    if not emitted_radiance(material).any():
        return values
    # Emitters may have an alpha mask.
    mask = (tuple(material.base_color), material.alpha_mode, material.alpha_cutoff)
    return (*values, *mask, _texture_key(material.base_color_texture))


def _texture_key(texture: Texture | None) -> tuple[Any, ...]:
    """Return the values of a texture in comparable form."""
    values = () if texture is None else values_of(texture).values()
    return tuple(tuple(v) if isinstance(v, (list, np.ndarray)) else v for v in values)


def _or_none(values: Sequence[float] | Color) -> Color:
    """Return the values, zero where they are below SMALLEST_LIGHT."""
    color = np.asarray(values, np.float64)
    return np.where(color < SMALLEST_LIGHT, 0.0, color)
