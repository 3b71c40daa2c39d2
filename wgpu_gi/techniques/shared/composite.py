"""Composite: sums the layers, averages them over jittered frames, and encodes the picture for the screen."""

from __future__ import annotations

from dataclasses import replace

from ...gpu.formats import FOUR_FLOATS
from ...gpu.graph import Graph
from ...gpu.handles import Buffer, Texture
from .technique import Light

NOISE_REACH = 4  # pixels around a pixel that its noise estimate reads: `wgsl/shared/composite/standard_error.wgsl`
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


def declare_tinted(graph: Graph, light: Light) -> Light:
    """Declare the layers of `light` times its tint; return `light` itself if it has none."""
    if light.tint is None:
        return light
    width, height = graph.size
    sources = {"emission": light.emission, "direct": light.direct, "indirect": light.indirect}
    tinted = {
        name: graph.buffer(
            f"composite/tinted_{name}",
            dtype=FOUR_FLOATS,
            count=width * height if layer else 1,
            width=width,
            nonnegative=True,
        )
        for name, layer in sources.items()
    }
    graph.compute(
        "composite/tint",
        "shared/composite/tint.wgsl",
        over=(width, height),
        reads={"tint": light.tint, **{name: layer or graph.neutral("buffer") for name, layer in sources.items()}},
        writes={f"tinted_{name}": buffer for name, buffer in tinted.items()},
        params={"size": (width, height)},
        constants={"HAS_INDIRECT": light.indirect is not None},
    )
    indirect = tinted["indirect"] if light.indirect else None
    return replace(light, emission=tinted["emission"], direct=tinted["direct"], indirect=indirect, tint=None)


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


def declare_standard_error(graph: Graph, radiance: Buffer) -> Buffer:
    """Declare the standard error of the mean of radiance over the frames of a still picture so far, W/(m2 sr)."""
    width = graph.size[0]
    centre, half_mean, spread, coarser_spread, error = (
        graph.buffer(MEANS + name, dtype=FOUR_FLOATS, count=radiance.count, width=width, nonnegative=True)
        for name in ("centre", "half_mean", "spread", "coarser_spread", "standard_error")
    )
    spreads = {"centre": centre, "spread": spread, "coarser_spread": coarser_spread}
    graph.compute(
        MEANS + "halves",
        "shared/composite/halves.wgsl",
        over=graph.size,
        reads={"current": radiance},
        writes={"half_mean": half_mean, **spreads},
    )
    graph.compute(
        MEANS + "standard_error",
        "shared/composite/standard_error.wgsl",
        over=graph.size,
        reads=spreads,
        writes={"standard_error": error},
    )
    return error


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
