"""Temporal anti-aliasing of moving pictures: radiance averaged over jittered frames along reprojected pixels.

Karis 2014, "High-Quality Temporal Supersampling" (jitter, motion of the closest neighbour, compressed light, YCoCg);
Salvi 2016, "An Excursion in Temporal Supersampling" (clip by variance); Jimenez 2016, "Filmic SMAA" (Catmull-Rom
history). Departures:

* Light is compressed relative to the mean of 3x3 pixels, so that the picture does not depend on the exposure.
* Beside lamps four times as bright as their surroundings, light is hardly compressed, and moving pixels have no
  history: resampling it spreads lamps over dark surfaces.
* The first frames form a cumulative mean, so that `frames` frames at rest are anti-aliased by as many samples.
* A history is dropped where it shows only nearer surfaces.

Lights thinner than a pixel lose energy: at rest 74 % at half a pixel, 13 % at 0.9; in motion 4 %
(`tests/truth/README.md`, "Moving pictures").
"""

from __future__ import annotations

from ...gpu.formats import FOUR_FLOATS, FOUR_WORDS
from ...gpu.graph import Graph
from ...gpu.handles import Buffer
from .technique import Light

NAME = "antialias"


def declare_antialias(graph: Graph, frames: int, radiance: Buffer, light: Light) -> Buffer:
    """Declare radiance averaged over about `frames` frames, (r, g, b, coverage) per pixel, W/(m2 sr).

    `light` has emission, and the motion and the distance of the surfaces.
    """
    assert light.distance is not None
    width, height = graph.size
    count = width * height
    history = graph.buffer(f"{NAME}/history", dtype=FOUR_WORDS, count=count, width=width, history=True)
    picture = graph.buffer(f"{NAME}/radiance", dtype=FOUR_FLOATS, count=count, width=width, nonnegative=True)
    graph.compute(
        NAME,
        "shared/antialias/antialias.wgsl",
        over=(width, height),
        reads={
            "radiance": radiance,
            "motion": light.views["motion"],
            "distance": light.distance,
            "emission": light.emission,
            "previous": history.previous,
        },
        writes={"history": history, "picture": picture},
        params={"frames": frames},
    )
    return picture
