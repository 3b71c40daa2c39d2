"""Composite: sums the layers, averages them over jittered frames, and encodes the picture for the screen."""

from __future__ import annotations

from ...gpu.formats import FOUR_FLOATS
from ...gpu.graph import Graph
from ...gpu.handles import Buffer, Texture

MEANS = "mean/"  # prefix of the names of passes that average frames


def declare_sum(graph: Graph, emission: Buffer, direct: Buffer, indirect: Buffer | None) -> Buffer:
    """Declare radiance = emission + direct + indirect, (r, g, b, 1) per pixel, W/(m2 sr)."""
    width, height = graph.size
    radiance = graph.buffer("composite/radiance", dtype=FOUR_FLOATS, count=width * height, width=width)
    radiance.nonnegative = True
    graph.compute(
        "composite/sum",
        "shared/composite/sum.wgsl",
        over=(width, height),
        reads={
            "emission": emission,
            "direct": direct,
            "indirect": graph.neutral("buffer") if indirect is None else indirect,
        },
        writes={"radiance": radiance},
        params={"size": (width, height)},
        constants={"HAS_INDIRECT": indirect is not None},
    )
    return radiance


def declare_mean(graph: Graph, name: str, layer: Buffer) -> Buffer:
    """Declare the mean of a layer over the frames of a still picture so far."""
    mean = graph.buffer(MEANS + name, dtype=FOUR_FLOATS, count=layer.count, width=graph.size[0], nonnegative=True)
    graph.compute(
        MEANS + name,
        "shared/composite/mean.wgsl",
        over=graph.size,
        reads={"current": layer},
        writes={"mean": mean},
    )
    return mean


def declare_display(graph: Graph, radiance: Buffer, exposure: float) -> Texture:
    """Declare the picture for a screen, 8-bit sRGB: radiance times 2^`exposure` through the tone curve."""
    display = graph.texture("composite/display", "rgba8unorm")
    graph.compute(
        "composite/display",
        "shared/composite/display.wgsl",
        over=display,
        reads={"radiance": radiance},
        writes={"display": display},
        params={"scale": 2.0 ** max(-100.0, min(exposure, 100.0))},
    )
    return display
