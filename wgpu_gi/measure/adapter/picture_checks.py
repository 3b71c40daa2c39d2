"""Small pictures of every technique against closed forms, and relations that hold bit for bit.

Each function returns the largest deviation, as a fraction; its docstring is the sentence of the report.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...options import TECHNIQUES as ALL
from ...scene.built_in import scenes as builtin
from ..stress import edits
from ..stress.studio import LIGHT, Layers, Studio, View

TECHNIQUES = tuple(sorted(ALL, key=lambda gi: gi == "path"))
SPP = 256


def _mean(layers: Layers, where: NDArray[np.bool_] | None = None) -> float:
    values = layers["radiance"] if where is None else layers["radiance"][where]
    return float(values.mean())


def sun(studio: Studio, gi: str) -> float:
    """A floor under a sun has L = albedo * lux * cos / pi."""
    (got,) = studio.take(gi, View(builtin.plane_sun(3.0, 60.0, 0.5)))
    return float(np.abs(got["radiance"] / (0.5 * 3.0 * math.cos(math.radians(60.0)) / math.pi) - 1).max())


def point_light(studio: Studio, gi: str) -> float:
    """A floor under a point light has L = albedo * I * h / (pi * (h^2 + r^2)^1.5)."""
    height, size = 2.0, studio.size
    (got,) = studio.take(gi, View(builtin.plane_point(height, 10.0, 0.5)))
    x = ((np.arange(size[0]) + 0.5) / size[0] - 0.5) * 4.0 * size[0] / size[1]
    z = ((np.arange(size[1]) + 0.5) / size[1] - 0.5) * 4.0
    squared = x[None, :] ** 2 + z[:, None] ** 2
    expected = 0.5 * 10.0 * height / (math.pi * (height**2 + squared) ** 1.5)
    # The floor ends 4 m from its centre.
    on_floor = np.broadcast_to(np.abs(x)[None, :] < 3.9, squared.shape)
    return float(np.abs(got["radiance"].mean(-1) / expected - 1)[on_floor].max())


def white_sky(studio: Studio, gi: str) -> float:
    """A convex ball in a white sky has the radiance of its albedo."""
    (got,) = studio.take(gi, View(builtin.furnace(0.5), frames=8, spp=16))
    return abs(_mean(got, got["depth"] > 0) / 0.5 - 1)


def closed_box(studio: Studio, gi: str) -> float:
    """A closed box whose walls emit Le has L = Le / (1 - albedo)."""
    (got,) = studio.take(gi, View(builtin.closed_box(2.0, 0.5), spp=SPP))
    return abs(_mean(got) / 4.0 - 1)


def facing_plates(studio: Studio, gi: str) -> float:
    """A plate that faces a lamp has L = albedo * Le * F, with their form factor F."""
    (got,) = studio.take(gi, View(builtin.plates(1.0, 3.0, 0.5), size=(24, 24), spp=SPP))
    return abs(_mean(got) / (0.5 * 3.0 * builtin.plates_form_factor(1.0)) - 1)


def light_in_a_sphere(studio: Studio, gi: str) -> float:
    """A light in the middle of a sphere gives L = albedo * I / (pi * R^2 * (1 - albedo)) with all bounces."""
    (got,) = studio.take(gi, View(builtin.sphere_light(2.0, 0.5, 10.0), size=(16, 16), frames=2, spp=SPP))
    return abs(_mean(got) / (0.5 * 10.0 / (math.pi * 4.0) / (1 - 0.5)) - 1)


def twice_the_light(studio: Studio, gi: str) -> float:
    """Twice the light gives exactly twice the picture: powers of two change no digits."""
    scene = builtin.cornell_spot()
    (once,), (twice,) = (studio.take(gi, View(s)) for s in (scene, edits.brightened(scene, 2.0)))
    return float(sum((2 * once[layer] != twice[layer]).sum() for layer in LIGHT))


def repetition(studio: Studio, gi: str) -> float:
    """Two runs give the same picture bit for bit, without NaN, infinite or negative values."""
    view = View(builtin.cornell_spot())
    (first,), (second,) = studio.take(gi, view), studio.take(gi, view)
    wrong = sum(int((first[n] != second[n]).sum() + (~(first[n] >= 0) | ~np.isfinite(first[n])).sum()) for n in first)
    return float(wrong)
