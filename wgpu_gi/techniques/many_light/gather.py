"""The gathering of light from VPLs, interleaved: each pixel sees those of its class.

Linke 2016, "Design and Implementation of a Many-Light Method for Real-Time Dynamic Global Illumination", sections 3.4
and 4.5. Departures: fall-off 1/d^2, bounded by the VPL's area; each workgroup finds its pixels by index arithmetic,
nothing is split or merged.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import DTypeLike

from ...gpu.graph import Graph
from ...gpu.handles import Buffer, Texture
from ...gpu.wgsl.load import load
from ...settings import setting
from ..shared.gbuffer import FOUR_FLOATS, TWO_FLOATS, Gbuffer
from ..shared.scene_inputs import SceneInputs
from .clusters import Clusters, declare_clusters
from .ism import Ism
from .vpl import Vpls

_GROUP = tuple(int(load("many_light/gather/pixels.wgsl").constants[name]) for name in ("GROUP_X", "GROUP_Y"))
_PIXELS = int(load("many_light/gather/pixels.wgsl").constants["PIXELS"])


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


def near_reach(near: Near | None) -> float:
    """Return the reach of the near field; without one, nothing reads it."""
    return near.reach if near is not None else 0.0


@dataclass
class Gathered:
    """What VPLs give to each pixel, each class from its own ones. Clear where there is nothing to light.

    irradiance: (r, g, b) in W/m2 and the depth as `shared/denoise/plane.wgsl` has it, 0 where there is nothing.
    normals: packed as there. glossy: the light that coats reflect, W/(m2 sr), over `coat_tint` of
    `common/coat.wgsl`; None if no material is coated. interleave: the side of the
    squares whose pixels use different VPLs. clusters: the lists of VPLs. bound_sums: sums of the bounds on near VPLs,
    as in `many_light/gather/common.wgsl`; None without compensation. near: the near field that is left out.
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
    n = settings.interleave
    coated = scene.features["HAS_COATS"]
    compensated = settings.compensation and settings.clamping != "none"
    layers = _layers(graph, coated, compensated)
    clusters = declare_clusters(graph, settings.culling, gbuffer, vpls, n)
    shader = f"many_light/gather/{settings.visibility}.wgsl"
    exact = settings.visibility == "exact"
    sampled = settings.visibility == "sampled"
    maps = ism if settings.visibility == "ism" else None
    assert maps is not None or settings.visibility != "ism"
    words = -(-vpls.count // (32 * n * n))
    for first in range(words if exact else 1):
        graph.compute(
            f"gather_{first}" if first else "gather",
            shader,
            over=_threads(graph.size, n),
            reads={
                "surfaces": gbuffer.surfaces,
                "distance": gbuffer.distance,
                "vpl_table": vpls.table,
                **clusters.reads,
                "near_shares": near.shares if near is not None else graph.neutral("texture_2d"),
                **(scene.surfaces if exact or sampled else {}),
                **(maps.reads if maps is not None else {}),
            },
            writes=layers,
            params={
                "vpl_count": vpls.count,
                "first_word": first,
                "seed": seed,
                "near_reach": near_reach(near),
            },
            constants={
                **scene.constants(shader),
                **clusters.constants,
                **(maps.constants if maps is not None else {}),
                "INTERLEAVE": n,
                "ADDED": exact,
                "BOUNDED": settings.clamping == "disc",
                "COMPENSATED": compensated,
                **({"RAYS": settings.rays} if sampled else {}),
                "NEAR": near is not None,
            },
            clear=[layers[name] for name in ("irradiance", "glossy", "bound_sums")] if exact and not first else (),
        )
    return Gathered(
        layers["irradiance"],
        layers["glossy"] if coated else None,
        layers["normals"],
        n,
        clusters,
        layers["bound_sums"] if compensated else None,
        near,
    )


def _threads(size: tuple[int, int], interleave: int) -> tuple[int, int]:
    """Return the threads that gather: whole workgroups of each class."""
    block = (_GROUP[0] * interleave, _GROUP[1] * _PIXELS * interleave)
    return -(-size[0] // block[0]) * _GROUP[0], -(-size[1] // block[1]) * interleave**2 * _GROUP[1]


def _layers(graph: Graph, coated: bool, compensated: bool) -> dict[str, Buffer]:
    """Return what gathering writes, by the names of `Gathered`; of what is not asked for a stand-in."""
    width, height = graph.size

    def layer(name: str, dtype: DTypeLike, asked: bool = True, nonnegative: bool = False) -> Buffer:
        count = width * height if asked else 1
        return graph.buffer(f"gather/{name}", dtype=dtype, count=count, width=width, nonnegative=nonnegative)

    return {
        "irradiance": layer("irradiance", FOUR_FLOATS, nonnegative=True),
        "glossy": layer("glossy", FOUR_FLOATS, coated, nonnegative=True),
        "normals": layer("normals", np.uint32),
        "bound_sums": layer("bound_sums", TWO_FLOATS, compensated),
    }
