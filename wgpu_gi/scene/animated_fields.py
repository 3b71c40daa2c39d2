"""Which fields animations change: how many numbers each has, and the range to which interpolation is limited."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..float_limits import (
    LARGEST_FACTOR,
    LARGEST_HEIGHT,
    LARGEST_IOR,
    LARGEST_LIGHT,
    LARGEST_YFOV,
    MAX_COORDINATE,
    SMALLEST_DISTANCE,
    SMALLEST_HEIGHT,
    SMALLEST_YFOV,
)
from .animation import Node
from .parts import DirectionalLight, Instance, Material, PointLight, SpotLight

LIGHTS = (PointLight, SpotLight, DirectionalLight)


class AnimatedField(NamedTuple):
    """A field of `width` numbers from `low` to `high`; width None: as many as there are morph targets."""

    width: int | None = 1
    low: float = -MAX_COORDINATE
    high: float = MAX_COORDINATE


_FRACTION, _FRACTIONS = AnimatedField(1, 0.0, 1.0), AnimatedField(3, 0.0, 1.0)
_FACTOR = AnimatedField(1, -LARGEST_FACTOR, LARGEST_FACTOR)
_LIGHT = {"intensity": AnimatedField(1, 0.0, LARGEST_LIGHT), "color": AnimatedField(3, 0.0, LARGEST_LIGHT)}
_POINT = {**_LIGHT, "position": AnimatedField(3), "range": AnimatedField(1, 0.0)}
_ANGLE = AnimatedField(1, 0.0, math.pi)
_SPOT = {**_POINT, "direction": AnimatedField(3), "inner_cone_angle": _ANGLE, "outer_cone_angle": _ANGLE}
FIELDS: dict[type, dict[str, AnimatedField]] = {
    Node: {"translation": AnimatedField(3), "rotation": AnimatedField(4), "scale": AnimatedField(3)},
    Instance: {"morph_weights": AnimatedField(None, -LARGEST_FACTOR, LARGEST_FACTOR)},
    PointLight: _POINT,
    SpotLight: _SPOT,
    DirectionalLight: {**_LIGHT, "direction": AnimatedField(3)},
    Camera: {
        "yfov": AnimatedField(1, SMALLEST_YFOV, LARGEST_YFOV),
        "orthographic_height": AnimatedField(1, SMALLEST_HEIGHT, LARGEST_HEIGHT),
    },
    Material: {
        "base_color": AnimatedField(4, 0.0, 1.0),
        "metallic": _FRACTION,
        "roughness": _FRACTION,
        "emission": AnimatedField(3, 0.0, LARGEST_LIGHT),
        "alpha_cutoff": _FACTOR,
        "normal_scale": _FACTOR,
        "ior": AnimatedField(1, 1.0, LARGEST_IOR),
        "specular": _FRACTION,
        "specular_color": AnimatedField(3, 0.0, LARGEST_FACTOR),
        "clearcoat": _FRACTION,
        "clearcoat_roughness": _FRACTION,
        "clearcoat_normal_scale": _FACTOR,
        "sheen_color": _FRACTIONS,
        "sheen_roughness": _FRACTION,
        "transmission": _FRACTION,
        "thickness": AnimatedField(1, 0.0),
        "attenuation_distance": AnimatedField(1, SMALLEST_DISTANCE),
        "attenuation_color": _FRACTIONS,
        "anisotropy": _FRACTION,
        "anisotropy_rotation": AnimatedField(1),
    },
}


def fields_of(part: Any) -> dict[str, AnimatedField]:
    """Return the fields of a part that animations may change; none for other objects."""
    return next((fields for kind, fields in FIELDS.items() if isinstance(part, kind)), {})


def set_field(part: Any, name: str, values: NDArray[np.float64], index: int | None = None) -> None:
    """Set a field, or one of its values, to interpolated ones, limited to its range, where splines may leave it."""
    width, low, high = fields_of(part)[name]
    limited = np.clip(values, low, high).tolist()
    if index is not None:
        before = getattr(part, name)
        setattr(part, name, (*before[:index], limited[0], *before[index + 1 :]))
    elif name == "range" and limited[0] == 0.0:
        setattr(part, name, None)  # "no limit", as in files
    elif name == "direction" and not any(limited):
        return  # nowhere: the direction stays
    else:
        setattr(part, name, limited[0] if width == 1 else tuple(limited))
    if isinstance(part, SpotLight):
        part.inner_cone_angle = min(part.inner_cone_angle, part.outer_cone_angle)
