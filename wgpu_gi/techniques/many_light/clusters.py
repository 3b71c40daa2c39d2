"""Which VPLs can light which pixels: lists for tiles of the picture, or for clusters of them by distance.

Olsson, Billeter and Assarsson 2012, "Clustered Deferred and Forward Shading". Departures: the bounds are the boxes of
what the pixels show; lists are bits in the order of slots, so that light is summed in the
same order as without them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...gpu.graph import Graph
from ...gpu.handles import Buffer, Shared
from ...gpu.wgsl.load import load
from ..shared.gbuffer import FOUR_FLOATS, Gbuffer
from .vpl import Vpls

_TILE = tuple(int(load("many_light/gather/clusters.wgsl").constants[name]) for name in ("TILE_X", "TILE_Y"))
_SLICES = int(load("many_light/gather/clusters.wgsl").constants["MAX_SLICES"])
_ROWS = int(load("many_light/gather/bounds.wgsl").constants["ROWS"])
_CLUSTERS = int(load("many_light/gather/lists.wgsl").constants["CLUSTERS"])


@dataclass
class Clusters:
    """What `wgsl/many_light/gather/gather.wgsl` reads of them, by its names, and its constants."""

    reads: dict[str, Buffer | Shared]
    constants: dict[str, float]


def declare_clusters(graph: Graph, culling: str, gbuffer: Gbuffer, vpls: Vpls, interleave: int) -> Clusters:
    """Declare the lists; `culling` is "none", "tiled" or "clustered"."""
    if culling == "none":
        for name in ("bounds", "lists"):
            graph.skip(f"gather/{name}", "gather.culling is none")
        neutral = graph.neutral("buffer")
        return Clusters({"lists": neutral}, {"CULLED": False})
    width, height = graph.size
    columns, rows = -(-width // _TILE[0]), -(-height // _TILE[1])
    slices = _SLICES if culling == "clustered" else 1
    count = columns * rows * slices
    words = -(-vpls.count // (32 * interleave**2)) * interleave**2
    bounds = graph.buffer("gather/bounds", dtype=FOUR_FLOATS, count=2 * count)
    lists = graph.buffer(
        "gather/lists", dtype=np.uint32, count=count * words + (2 * columns * rows if slices > 1 else 0)
    )
    graph.compute(
        "gather/bounds",
        "many_light/gather/bounds.wgsl",
        over=(_TILE[0] * columns, _ROWS * rows),
        reads={"distance": gbuffer.distance},
        writes={"bounds": bounds},
        constants={"SLICES": slices},
    )
    graph.compute(
        "gather/lists",
        "many_light/gather/lists.wgsl",
        over=(words, -(-count // _CLUSTERS)),
        reads={"bounds": bounds, "vpl_table": vpls.table},
        writes={"lists": lists},
        params={"vpl_count": vpls.count},
        constants={"INTERLEAVE": interleave, "SLICES": slices},
    )
    return Clusters({"lists": lists}, {"CULLED": True, "SLICES": slices})
