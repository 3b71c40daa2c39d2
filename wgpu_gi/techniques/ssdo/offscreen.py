"""Off-screen light from a radiance cache in world space.

A departure from Ritschel et al. 2009, "Approximating Dynamic Global Illumination in Image Space", whose light comes
from the pictures. Rays of undecided directions (`rays.py`) request the cells of their hits, which then have the light
of sources, or of all bounces.
"""

from __future__ import annotations

from ...gpu.handles import Buffer
from ..shared.radiance_cache import RadianceCache, declare_update
from .search_request import SearchRequest

REQUEST = "ssdo/offscreen/request.wgsl"


def declare_cached_light(
    request: SearchRequest, cache: RadianceCache, name: str, undecided: Buffer, hits: Buffer, found: Buffer
) -> None:
    """Declare the light of the hits `found` of the directions in the list `undecided`, into their entries in `hits`."""
    graph, scene, seed = request.graph, request.scene, request.seed
    graph.compute(
        f"{name}_request",
        REQUEST,
        indirect=undecided,
        reads={**scene.surfaces, "undecided": undecided},
        writes={"cache_hits": found, "table": cache.table, "requested": cache.requested},
        params={"seed": seed},
        constants=scene.constants(REQUEST),
        clear=[cache.requested],
    )
    suffix = name.removeprefix("ssdo/")
    declare_update(graph, scene, cache, found, seed, direct_only=request.one_bounce, suffix=f"_{suffix}")
    graph.compute(
        f"{name}_light",
        "ssdo/offscreen/light.wgsl",
        indirect=undecided,
        reads={"undecided": undecided, "cache_hits": found, "cells": cache.cells},
        writes={"hits": hits},
        constants=scene.constants("ssdo/offscreen/light.wgsl"),
    )
