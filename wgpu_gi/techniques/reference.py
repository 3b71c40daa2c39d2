"""The truth: a progressive path tracer over the same scene buffers, lights and BRDF as every other technique.

Kajiya 1986, "The Rendering Equation"; next-event estimation with multiple importance sampling after Veach 1997,
chapter 9; Owen-scrambled Sobol points after Burley 2020.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..gpu.graph import Graph
from ..gpu.handles import Buffer
from ..gpu.passes import Pass
from ..settings import setting
from .shared.scene_inputs import SceneInputs

UNLIMITED = 0x7FFFFFFF
FOUR_FLOATS = np.dtype((np.float32, 4))


@dataclass
class PathSettings:
    """How the path tracer divides its work, and what it is the truth of."""

    samples_per_run: int = setting(
        16, "Paths per pixel in one run of the pass; fewer refine in smaller steps.", "paths", range=(1, 64)
    )
    visible_only: bool = setting(
        False, "Let light leave only surfaces that the picture shows: what techniques in screen space can find at best."
    )


@dataclass
class Reference:
    """Linear radiance in W/(m2 sr): the layers by number of scatterings, their sum, its standard error.

    Buffers of (r, g, b, a) per pixel, rows from the top; `emission`'s a is the number of samples so far.
    """

    emission: Buffer
    direct: Buffer
    indirect: Buffer
    radiance: Buffer
    standard_error: Buffer


@dataclass
class Primary:
    """What is seen through the pixel centres: base colour; shading normal and distance; position. Four floats each."""

    albedo: Buffer
    normal: Buffer
    position: Buffer


def path_runs(settings: PathSettings, spp: int) -> int:
    """Return how many runs of the graph `spp` samples per pixel take, where no path is exceptionally long."""
    return -(-spp // settings.samples_per_run)


def declare_reference(
    graph: Graph,
    settings: PathSettings,
    scene: SceneInputs,
    *,
    spp: int,
    runs: int,
    bounces: int | None,
    seed: int,
) -> Reference:
    """Declare the path tracer: `spp` paths per pixel, with at most `bounces` indirect bounces (None: unlimited).

    It adds up to `settings.samples_per_run` samples in each of `runs` runs of the graph, until a pixel has them all.
    `emission`'s a tells how many it has: pixels with very long paths take fewer in a run and need more runs.
    """
    width, height = graph.size

    def buffers(*names: str) -> dict[str, Buffer]:
        count = width * height
        return {
            name: graph.buffer(f"path/{name}", dtype=FOUR_FLOATS, count=count, width=width, nonnegative=True)
            for name in names
        }

    layers = buffers("emission", "direct", "indirect", "deviation")
    results = buffers("radiance", "standard_error")
    tiles = -(-width // 8) * -(-height // 8)
    trace = graph.compute(
        "path/trace",
        "reference/path.wgsl",
        over=tiles * 64,
        reads={**scene.surfaces, **scene.lights},
        writes=layers,
        params={
            "samples": settings.samples_per_run,
            "spp": spp,
            "bounces": UNLIMITED if bounces is None else bounces,
            "seed": seed,
        },
        constants={**scene.constants("reference/path.wgsl"), "VISIBLE_ONLY": settings.visible_only},
        settle=runs,
        split=True,
    )
    _keep_full_runs(trace, spp)
    graph.compute(
        "path/resolve",
        "reference/resolve.wgsl",
        over=(width, height),
        reads=layers,
        writes=results,
        params={"size": (width, height)},
    )
    return Reference(layers["emission"], layers["direct"], layers["indirect"], **results)


def _keep_full_runs(trace: Pass, spp: int) -> None:
    """Go on with the samples that there are if only `spp` is another and no run has taken fewer for its sake.

    Then all runs are those of a picture that had this `spp` from the start, and so is every bit of it.
    """
    before = trace.params_before
    if before is not None and (trace.state.settle_index + 1) * before["samples"] <= min(spp, before["spp"]):
        trace.go_on_with("spp")


def declare_primary(graph: Graph, scene: SceneInputs) -> Primary:
    """Declare the pass that finds what each pixel's centre shows, without light."""
    width, height = graph.size
    buffers = {
        name: graph.buffer(f"primary/{name}", dtype=FOUR_FLOATS, count=width * height, width=width)
        for name in ("albedo", "normal", "position")
    }
    graph.compute(
        "primary",
        "reference/primary.wgsl",
        over=(width, height),
        reads=scene.surfaces,
        writes=buffers,
        constants=scene.constants("reference/primary.wgsl"),
    )
    return Primary(**buffers)
