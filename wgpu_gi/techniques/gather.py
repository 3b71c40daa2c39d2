"""The gathering of light from VPLs, interleaved: each pixel sees those of its class.

Linke 2016, "Design and Implementation of a Many-Light Method for Real-Time Dynamic Global Illumination", sections 3.4
and 4.5. Departures: fall-off 1/d^2, bounded by the VPL's area; each workgroup finds its pixels by index arithmetic,
nothing is split or merged.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..gpu.graph import Graph
from ..gpu.handles import Buffer, Texture
from ..gpu.wgsl import load
from ..settings import setting
from .clusters import Clusters, declare_clusters
from .gbuffer import FOUR_FLOATS, TWO_FLOATS, Gbuffer
from .ism import Ism
from .scene_inputs import SceneInputs
from .vpl import Vpls

_GROUP = tuple(int(load("gather/pixels.wgsl").constants[name]) for name in ("GROUP_X", "GROUP_Y"))
_PIXELS = int(load("gather/pixels.wgsl").constants["PIXELS"])


@dataclass
class GatherSettings:
    """How pixels gather light from VPLs."""

    interleave: int = setting(
        4, "Side of the squares of pixels that share the VPLs among them.", "pixels", range=(1, 8)
    )
    culling: str = setting(
        "tiled",
        "Leave out VPLs that cannot light a tile of the picture, or a cluster of its pixels by distance.",
        choices=("none", "tiled", "clustered"),
    )
    visibility: str = setting(
        "sampled",
        "What tells whether a pixel sees a VPL: rays to a few VPLs drawn by their light, imperfect shadow maps, a ray"
        " to each VPL, or nothing.",
        choices=("sampled", "ism", "exact", "none"),
    )
    rays: int = setting(1, "Rays of each pixel, of visibility `sampled`.", "rays", range=(1, 8), presets={"high": 4})
    clamping: str = setting(
        "disc", "Bound of the light of near VPLs: that of a disc of their area, or none.", choices=("disc", "none")
    )
    compensation: bool = setting(False, "Find the light that the bound takes by what is near in the picture.")


@dataclass
class Near:
    """What a near field finds by itself: of each VPL that `shares` of its light, within so many heights' reach."""

    shares: Texture
    reach: float


def near_constants(near: Near | None) -> dict[str, float]:
    """Return those of `wgsl/gather/near.wgsl`."""
    return {"NEAR": near is not None, "NEAR_REACH": near.reach if near is not None else 1.0}


@dataclass
class Gathered:
    """What VPLs give to each pixel, each class from its own ones. Clear where there is nothing to light.

    irradiance: (r, g, b) in W/m2 and the depth as `wgsl/denoise/plane.wgsl` has it, 0 where there is nothing.
    normals: packed as there. glossy: the light that coats reflect, W/(m2 sr), over `coat_tint` of
    `wgsl/gather/coat.wgsl`; None if no material is coated. interleave: the side of the squares whose pixels differ.
    clusters: the lists that they went by. bound_sums: of bounds of near VPLs, as `wgsl/gather/common.wgsl` has them;
    None if what they take is not to be found. near: the near field that is left out.
    """

    irradiance: Buffer
    glossy: Buffer | None
    normals: Buffer
    interleave: int
    clusters: Clusters
    bound_sums: Buffer | None = None
    near: Near | None = None


def declare_gather(
    graph: Graph,
    settings: GatherSettings,
    scene: SceneInputs,
    gbuffer: Gbuffer,
    vpls: Vpls,
    ism: Ism | None,
    seed: int,
    near: Near | None = None,
) -> Gathered:
    """Declare the irradiance by VPLs, but for what is `near`; `ism` is there if `settings.visibility` is "ism"."""
    width, height = graph.size
    n = settings.interleave
    irradiance = graph.buffer(
        "gather/irradiance", dtype=FOUR_FLOATS, count=width * height, width=width, nonnegative=True
    )
    coated = scene.features["HAS_COATS"]
    glossy = graph.buffer(
        "gather/glossy", dtype=FOUR_FLOATS, count=width * height if coated else 1, width=width, nonnegative=True
    )
    normals = graph.buffer("gather/normals", dtype=np.uint32, count=width * height, width=width)
    compensated = settings.compensation and settings.clamping != "none"
    bound_sums = graph.buffer(
        "gather/bound_sums", dtype=TWO_FLOATS, count=width * height if compensated else 1, width=width
    )
    clusters = declare_clusters(graph, settings.culling, gbuffer, vpls, n)
    # Whole workgroups of each class.
    block = (_GROUP[0] * n, _GROUP[1] * _PIXELS * n)
    threads = (-(-width // block[0]) * _GROUP[0], -(-height // block[1]) * n * n * _GROUP[1])
    shader = f"gather/{settings.visibility}.wgsl"
    exact = settings.visibility == "exact"
    sampled = settings.visibility == "sampled"
    maps = ism if settings.visibility == "ism" else None
    assert maps is not None or settings.visibility != "ism"
    words = -(-vpls.count // (32 * n * n))
    for first in range(words if exact else 1):
        graph.compute(
            f"gather_{first}" if first else "gather",
            shader,
            over=threads,
            reads={
                "surfaces": gbuffer.surfaces,
                "distance": gbuffer.distance,
                "vpl_table": vpls.table,
                **clusters.reads,
                "near_shares": near.shares if near is not None else graph.neutral("texture_2d"),
                **(scene.surfaces if exact or sampled else {}),
                **(maps.reads if maps is not None else {}),
            },
            writes={"irradiance": irradiance, "glossy": glossy, "normals": normals, "bound_sums": bound_sums},
            params={"first": first} if exact else {"seed": seed} if sampled else None,
            constants={
                **scene.constants(shader),
                **clusters.constants,
                **(maps.constants if maps is not None else {}),
                "INTERLEAVE": n,
                "VPLS": vpls.count,
                "ADDED": exact,
                **({"RAYS": settings.rays} if sampled else {}),
                "BOUNDED": settings.clamping == "disc",
                "COMPENSATED": compensated,
                **near_constants(near),
            },
            clear=[irradiance, glossy, bound_sums] if exact and not first else (),
        )
    return Gathered(
        irradiance, glossy if coated else None, normals, n, clusters, bound_sums if compensated else None, near
    )
