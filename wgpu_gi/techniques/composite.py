"""Composite: the layers added up, averaged over jittered frames, and brought to the screen."""

from __future__ import annotations

from ..gpu.graph import Graph
from ..gpu.handles import Buffer
from .gbuffer import FOUR_FLOATS


def declare_sum(graph: Graph, emission: Buffer, direct: Buffer, indirect: Buffer | None) -> Buffer:
    """Declare radiance = emission + direct + indirect, (r, g, b, 1) per pixel, W/(m2 sr)."""
    width, height = graph.size
    radiance = graph.buffer("composite/radiance", dtype=FOUR_FLOATS, count=width * height, width=width)
    radiance.nonnegative = True
    graph.compute(
        "composite/sum",
        "composite/sum.wgsl",
        over=radiance,
        reads={
            "emission": emission,
            "direct": direct,
            "indirect": graph.neutral("buffer") if indirect is None else indirect,
        },
        writes={"radiance": radiance},
        params={"count": radiance.count},
        constants={"HAS_INDIRECT": indirect is not None},
    )
    return radiance


def declare_mean(graph: Graph, name: str, layer: Buffer) -> Buffer:
    """Declare the mean of a layer over the jittered frames so far, `view.sample_index` + 1 of them."""
    mean = graph.buffer(f"mean/{name}", dtype=FOUR_FLOATS, count=layer.count, width=graph.size[0], nonnegative=True)
    graph.compute(
        f"mean/{name}",
        "composite/accumulate.wgsl",
        over=mean,
        reads={"current": layer},
        writes={"mean": mean},
        params={"count": layer.count},
    )
    return mean
