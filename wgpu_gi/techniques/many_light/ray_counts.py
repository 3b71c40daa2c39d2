"""Numbers of shadow rays per tile of the picture, from the noise of the frames of a still picture so far.

Rays go where they lower relMSE most: the optimal allocation of Neyman 1934, as in adaptive rendering (Rousselle et al.
2011, "Adaptive Sampling and Reconstruction using Greedy Error Minimization"). Departures: tiles instead of pixels; the
number over the whole picture follows from the noise that rays do not lower; counts of a frame depend on earlier frames
only, so the mean over frames is unbiased. A departure from Linke 2016, which traces no rays.
"""

from __future__ import annotations

from dataclasses import dataclass

from ...gpu.formats import FOUR_FLOATS
from ...gpu.graph import Graph
from ...gpu.handles import Buffer, Handle, Texture
from ...gpu.wgsl.load import load

_GROUP_X, _GROUP_Y = (int(load("many_light/gather/pixels.wgsl").constants[name]) for name in ("GROUP_X", "GROUP_Y"))
_RECORD = load("many_light/gather/ray_record.wgsl").struct_dtype("RayTile")


@dataclass
class RayCounts:
    """Statistics of the threads that gather, and the rays per pixel of each tile, `size` (x, y) in number."""

    statistics: Buffer
    counts: Texture
    size: tuple[int, int]

    @property
    def reads(self) -> dict[str, Handle]:
        """The bindings of `wgsl/many_light/gather/adaptive.wgsl` that it reads: the counts by the frame before."""
        return {"ray_counts": self.counts.previous}

    @property
    def writes(self) -> dict[str, Handle]:
        """The bindings that it writes."""
        return {"statistics": self.statistics}


def declare_ray_statistics(graph: Graph, threads: tuple[int, int], interleave: int) -> RayCounts:
    """Declare the resources for gathering by `threads` (x, y): whole workgroups for each class of pixels."""
    size = threads[0] // _GROUP_X, threads[1] // interleave**2
    statistics = graph.buffer("gather/ray_statistics", dtype=FOUR_FLOATS, count=threads[0] * threads[1])
    return RayCounts(statistics, graph.texture("gather/ray_counts", "r32uint", size=size, history=True), size)


def declare_ray_counts(graph: Graph, found: RayCounts, interleave: int) -> None:
    """Declare the passes that find the counts of the next frame."""
    tiles = graph.buffer("gather/ray_tiles", dtype=_RECORD, count=found.size[0] * found.size[1])
    params, constants = {"size": found.size}, {"INTERLEAVE": interleave}
    graph.compute(
        "gather/ray_tiles",
        "many_light/gather/ray_tiles.wgsl",
        over=found.size,
        reads={"statistics": found.statistics},
        writes={"tiles": tiles},
        params=params,
        constants=constants,
    )
    graph.compute(
        "gather/ray_counts",
        "many_light/gather/ray_counts.wgsl",
        over=1,
        reads={"tiles": tiles},
        writes={"ray_counts": found.counts},
        params=params,
        constants=constants,
    )
