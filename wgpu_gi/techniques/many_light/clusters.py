"""Light lists of clusters: the VPLs that can light a tile of the picture, or a range of distances within it.

Olsson, Billeter and Assarsson 2012, "Clustered Deferred and Forward Shading"; Linke 2016, sections 3.5 and 4.6.
Departures: bounds are boxes of the visible positions, as Olsson proposes; slices divide each tile's own range of
distances; lists are bit masks in the order of slots, so light is summed in the same order as without culling.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...gpu.formats import FOUR_FLOATS
from ...gpu.graph import Graph
from ...gpu.handles import Buffer, Shared
from ...gpu.wgsl.load import load
from ..shared.bounds import SAVES
from ..shared.gbuffer import Gbuffer
from .vpl import Vpls

_TILE = tuple(int(load("many_light/gather/clusters.wgsl").constants[name]) for name in ("TILE_X", "TILE_Y"))
_SLICES = int(load("many_light/gather/clusters.wgsl").constants["MAX_SLICES"])
_ROWS = int(load("many_light/gather/cluster_bounds.wgsl").constants["ROWS"])
_CLUSTERS = int(load("many_light/gather/light_lists.wgsl").constants["CLUSTERS"])


@dataclass
class Clusters:
    """The bindings and constants by which `wgsl/many_light/gather/common.wgsl` reads the light lists, by name."""

    reads: dict[str, Buffer | Shared]
    constants: dict[str, float]


def declare_clusters(graph: Graph, culling: str, gbuffer: Gbuffer, vpls: Vpls, interleave: int) -> Clusters:
    """Declare the light lists of all VPLs; `culling` is "none", "tiled" or "clustered"."""
    if culling == "none":
        for name in ("cluster_bounds", "light_lists"):
            graph.skip(f"gather/{name}", "gather.culling is none", SAVES)
        neutral = graph.neutral("buffer")
        return Clusters({"lists": neutral}, {"CULLED": False})
    # Lay out the clusters and their lists: a word for every 32 VPLs of a class.
    width, height = graph.size
    columns, rows = -(-width // _TILE[0]), -(-height // _TILE[1])
    slices = _SLICES if culling == "clustered" else 1
    count = columns * rows * slices
    words = -(-vpls.count // (32 * interleave**2)) * interleave**2
    bounds = graph.buffer("gather/bounds", dtype=FOUR_FLOATS, count=2 * count)
    lists = graph.buffer(
        "gather/lists", dtype=np.uint32, count=count * words + (2 * columns * rows if slices > 1 else 0)
    )
    # Bound the clusters, and test the VPLs against their boxes.
    graph.compute(
        "gather/cluster_bounds",
        "many_light/gather/cluster_bounds.wgsl",
        over=(_TILE[0] * columns, _ROWS * rows),
        reads={"distance": gbuffer.distance},
        writes={"bounds": bounds},
        constants={"SLICES": slices},
    )
    graph.compute(
        "gather/light_lists",
        "many_light/gather/light_lists.wgsl",
        over=(words, -(-count // _CLUSTERS)),
        reads={"bounds": bounds, "vpl_table": vpls.table},
        writes={"lists": lists},
        params={"vpl_count": vpls.count},
        constants={"INTERLEAVE": interleave, "SLICES": slices, **vpls.constants},
    )
    return Clusters({"lists": lists}, {"CULLED": True, "SLICES": slices})
