"""A radiance cache in world space: the irradiance of surfaces that rays hit, kept from frame to frame.

Cells of a spatial hash (Gautron 2020, "Real-Time Ray-Traced Ambient Occlusion of Complex Scenes using Spatial Hashing")
hold running means, as in NVIDIA's SHaRC and the world cache of Bevy's Solari. A technique's rays request the cells of
the points that they hit (`request.wgsl`); each requested cell gets one path per frame from one of these points; then
the technique looks up the means. Departures: cells hold irradiance instead of radiance, so materials keep their detail;
all points that update a cell have been hit by rays from the picture, so light behind a wall does not leak through it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...gpu.graph import Graph
from ...gpu.handles import Buffer
from ...gpu.wgsl.load import load
from ...upload.scene_upload import SceneUpload
from .scene_inputs import LIGHT_INPUTS, SURFACE_INPUTS, SceneInputs
from .technique import Kept

CELLS = 2**16  # 2.6 MB; a view from within a room uses 1,000 to 4,000 in 12 frames of 160x90
_UPDATE = "shared/radiance_cache/update.wgsl"
_SCENE = load(_UPDATE).struct_dtype("CacheScene")
_CELL = load(_UPDATE).struct_dtype("Cell")
_HIT = load(_UPDATE).struct_dtype("CacheHit")
_HEADER = int(load(_UPDATE).constants["LIST_HEADER"])
_VERSIONS = 2**16


class _CacheState:
    """The version of the scene, and the resources that it stands for."""

    def __init__(self) -> None:
        self.key: object = None
        self.version = 0


@dataclass(frozen=True)
class RadianceCache:
    """table: check and vote of each cell. requested: the cells of this frame. cells: their means."""

    table: Buffer
    requested: Buffer
    cells: Buffer


def note_changes(graph: Graph, kept: Kept, upload: SceneUpload, bounces: int | None) -> None:
    """Tell the cache which scene its means are of, once per frame after the scene's upload.

    A change of the scene, or of `bounces` from or to one, makes it forget its means.
    """
    state = kept(_CacheState)
    names = (*SURFACE_INPUTS, *LIGHT_INPUTS)
    key = (id(upload), upload.info.tobytes(), bounces == 1, *(upload.resources[name][1] for name in names))
    if key != state.key:
        state.key, state.version = key, (state.version + 1) % _VERSIONS
    scene = np.zeros((), _SCENE)
    scene["version"] = state.version
    graph.uniform("cache_scene", scene)


def most_rays(graph: Graph, pixels: int) -> int:
    """Return the largest number of rays per pixel whose hits fit a buffer, at least 1."""
    limit: int = graph.device.limits.get("max-storage-buffer-binding-size", 2**27)
    return max(limit // (_HIT.itemsize * pixels), 1)


def declare_hits(graph: Graph, name: str, rays: int) -> Buffer:
    """Declare a buffer for the hits of a number of rays."""
    return graph.buffer(name, dtype=_HIT, count=rays)


def declare_cache(graph: Graph) -> RadianceCache:
    """Declare the buffers of the cache."""
    return RadianceCache(
        graph.buffer("radiance_cache/table", dtype=np.uint32, count=2 * CELLS),
        graph.buffer("radiance_cache/requested", dtype=np.uint32, count=_HEADER + CELLS),
        graph.buffer("radiance_cache/cells", dtype=_CELL, count=CELLS),
    )


def declare_update(
    graph: Graph,
    scene: SceneInputs,
    cache: RadianceCache,
    hits: Buffer,
    seed: int,
    *,
    direct_only: bool,
    suffix: str = "",
) -> None:
    """Declare the update of the cells that `hits` have requested.

    direct_only: they hold the light of sources, not of surfaces. suffix: of the names of a frame's further updates.
    """
    graph.compute(
        f"radiance_cache/update{suffix}",
        _UPDATE,
        indirect=cache.requested,
        reads={
            **scene.surfaces,
            **scene.lights,
            "table": cache.table,
            "requested": cache.requested,
            "hits": hits,
        },
        writes={"cells": cache.cells},
        params={"seed": seed},
        constants={**scene.constants(_UPDATE), "DIRECT_ONLY": direct_only},
    )
    graph.compute(
        f"radiance_cache/resolve{suffix}",
        "shared/radiance_cache/resolve.wgsl",
        over=(CELLS,),
        writes={"table": cache.table, "cells": cache.cells},
    )
