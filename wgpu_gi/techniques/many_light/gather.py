"""Final gathering: the irradiance of each pixel from the virtual point lights of its class (interleaved sampling).

Linke 2016, sections 3.4 and 4.5, "Design and Implementation of a Many-Light Method for Real-Time Dynamic Global
Illumination". Departures:

* Light falls off with 1/d^2 and is bounded by the area of its VPL; Linke's falls off with 1/d^4, with a constant bound.
* Visibility by default comes from shadow rays to VPLs drawn by their light (Talbot et al. 2005); imperfect shadow maps
  are an option.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import DTypeLike

from ...gpu.formats import FOUR_FLOATS
from ...gpu.graph import Graph
from ...gpu.handles import Buffer, Handle, Texture
from ...gpu.wgsl.load import load
from ...records import KnownAttributes
from ...settings import setting
from ..shared.bounds import SAVES
from ..shared.denoise import grid_size
from ..shared.gbuffer import Gbuffer
from ..shared.scene_inputs import SceneInputs
from ..shared.upsample import grid_constants
from .clusters import Clusters, declare_clusters
from .ism import Ism
from .ray_counts import RayCounts, declare_ray_counts, declare_ray_statistics
from .vpl import Vpls

_GROUP = tuple(int(load("many_light/gather/pixels.wgsl").constants[name]) for name in ("GROUP_X", "GROUP_Y"))
_PIXELS = int(load("many_light/gather/pixels.wgsl").constants["PIXELS"])


@dataclass(repr=False, slots=True)
class GatherSettings(KnownAttributes):
    """Gathering of light from VPLs."""

    interleave: int = setting(
        4,
        "Side n of squares of pixels: each pixel uses 1 / n^2 of the VPLs, a square uses all.",
        "pixels",
        range=(1, 8),
    )
    culling: str = setting(
        "tiled",
        "Skip VPLs that cannot light a tile of the picture (tiled), or a range of distances in it (clustered).",
        choices=("none", "tiled", "clustered"),
    )
    visibility: str = setting(
        "sampled",
        "Visibility of VPLs: rays to a few VPLs drawn by their light (sampled), imperfect shadow maps (ism), a ray to"
        " each VPL (exact), or all visible (none).",
        choices=("sampled", "ism", "exact", "none"),
    )
    rays: int = setting(1, "Rays per pixel with visibility `sampled`.", "rays", range=(1, 8), presets={"high": 4})
    adaptive: bool = setting(
        False,
        "With visibility `sampled`, still pictures take 1 to 8 rays per pixel from the second frame on, more in tiles"
        " whose visibility is noisy; the first frame takes gather.rays.",
    )
    clamping: str = setting(
        "disc",
        "Bound on the light of near VPLs: that of a disc of the VPL's area (disc), or none.",
        choices=("disc", "none"),
    )
    scale: str = setting(
        "moving",
        "Gather at every pixel (full), at a quarter of them and upsample (half), or at a quarter while a view of"
        " 1280x720 pixels or more moves (moving); at every pixel with a near field.",
        choices=("full", "half", "moving"),
    )
    reflections: float = setting(
        0.6,
        "Largest roughness of coats that reflect by a ray per pixel and frame; others reflect the VPLs. 0: all do.",
        "roughness",
        range=(0, 1),
    )
    compensation: bool = setting(True, "Add the light that the bound removes, by short rays.")


@dataclass
class NearField:
    """The part of the light that the near field finds in screen space and gathering leaves out.

    shares: for each VPL, the share of its light at distance 0, laid out as the VPL table. radius: r_max, heights of the
    picture.
    """

    shares: Texture
    radius: float


def near_radius(near_field: NearField | None) -> float:
    """Return r_max of the near field, heights of the picture; without a near field, no shader uses it."""
    return near_field.radius if near_field is not None else 0.0


@dataclass
class Gathered:
    """The light of VPLs at each pixel of a grid, from those of its class; 0 where there is no lit surface.

    irradiance: (r, g, b) in W/m2, and the depth of `shared/denoise/plane.wgsl`, 0 without a surface.
    normals: packed by the same file. glossy: the radiance of coats, W/(m2 sr), over `coat_tint` of `common/coat.wgsl`;
    None without coated materials. stride: picture pixels between the grid's pixels. interleave: side of the squares of
    the grid's pixels that divide the VPLs. clusters: the light lists. compensated: the bound's loss is to be added.
    bounded: the light of near VPLs has a bound. near_field: the part left out; None without a near field.
    """

    irradiance: Buffer
    glossy: Buffer | None
    normals: Buffer
    stride: int
    interleave: int
    clusters: Clusters
    compensated: bool = False
    bounded: bool = True
    near_field: NearField | None = None

    @property
    def grid(self) -> dict[str, float]:
        """The constants of `wgsl/shared/upsample/grid_pixel.wgsl`."""
        return grid_constants(self.stride)


def declare_gather(
    graph: Graph,
    settings: GatherSettings,
    scene: SceneInputs,
    gbuffer: Gbuffer,
    vpls: Vpls,
    ism: Ism | None,
    seed: int,
    near_field: NearField | None = None,
    stride: int = 1,
    frames: int = 1,
) -> Gathered:
    """Declare the light of VPLs at each pixel of a grid; `ism` is needed if `settings.visibility` is "ism".

    `stride`: of the grid, 1 or 2 pixels. `frames`: number per still picture.
    """
    n, exact = settings.interleave, settings.visibility == "exact"
    size = grid_size(graph, stride)
    coated = scene.features["HAS_COATS"]
    bounded = settings.clamping != "none"
    layers = _layers(graph, size, coated)
    clusters = declare_clusters(graph, settings.culling, gbuffer, vpls, n)
    counts = _ray_counts(graph, settings, _threads(size, n), frames)
    shader = f"many_light/gather/{'adaptive' if counts else settings.visibility}.wgsl"
    visibility, constants = _visibility(settings, scene, ism, counts)
    # Rays to all VPLs need one pass per word of a class' light list: see `gather/exact.wgsl`.
    words = -(-vpls.count // (32 * n * n))
    for first in range(words if exact else 1):
        graph.compute(
            f"gather_{first}" if first else "gather",
            shader,
            over=_threads(size, n),
            reads={
                "surfaces": gbuffer.surfaces,
                "distance": gbuffer.distance,
                "vpl_table": vpls.table,
                **clusters.reads,
                "near_shares": near_field.shares if near_field is not None else graph.neutral("texture_2d"),
                **visibility,
            },
            writes={**layers, **(counts.writes if counts else {})},
            params={"vpl_count": vpls.count, "first_word": first, "seed": seed, "near_radius": near_radius(near_field)},
            constants={
                **scene.constants(shader),
                **vpls.constants,
                **clusters.constants,
                **constants,
                **grid_constants(stride),
                "INTERLEAVE": n,
                "ADDED": exact,
                "BOUNDED": bounded,
                "NEAR_FIELD": near_field is not None,
            },
            clear=[layers[name] for name in ("irradiance", "glossy")] if exact and not first else (),
        )
    if counts:
        declare_ray_counts(graph, counts, n)
    glossy = layers["glossy"] if coated else None
    compensated, normals = settings.compensation and bounded, layers["normals"]
    return Gathered(layers["irradiance"], glossy, normals, stride, n, clusters, compensated, bounded, near_field)


def _ray_counts(graph: Graph, settings: GatherSettings, threads: tuple[int, int], frames: int) -> RayCounts | None:
    """Declare what the choice of numbers of rays needs of `threads`; None: each pixel has the same number."""
    absent = "gather.adaptive is off, or gather.visibility is not sampled"
    if settings.adaptive and settings.visibility == "sampled":
        if frames > 1:
            return declare_ray_statistics(graph, threads, settings.interleave)
        absent = "the picture is a single frame"
    graph.skip("gather/ray_counts", absent, SAVES)
    return None


def _visibility(
    settings: GatherSettings, scene: SceneInputs, ism: Ism | None, counts: RayCounts | None
) -> tuple[dict[str, Handle], dict[str, float]]:
    """Return the bindings and constants by which the shader finds the visibility of VPLs, by name."""
    if settings.visibility == "ism":
        assert ism is not None
        return ism.reads, ism.constants
    if settings.visibility == "none":
        return {}, {}
    reads = {**scene.surfaces, **(counts.reads if counts else {})}
    return reads, {"RAYS": settings.rays} if settings.visibility == "sampled" else {}


def _threads(size: tuple[int, int], interleave: int) -> tuple[int, int]:
    """Return the number of threads along x and y: whole workgroups for each class."""
    block = (_GROUP[0] * interleave, _GROUP[1] * _PIXELS * interleave)
    return -(-size[0] // block[0]) * _GROUP[0], -(-size[1] // block[1]) * interleave**2 * _GROUP[1]


def _layers(graph: Graph, size: tuple[int, int], coated: bool) -> dict[str, Buffer]:
    """Return the buffers that gathering writes, by their names in `Gathered`; one element if a layer is not needed."""
    width, height = size

    def layer(name: str, dtype: DTypeLike, needed: bool = True, nonnegative: bool = False) -> Buffer:
        count = width * height if needed else 1
        return graph.buffer(f"gather/{name}", dtype=dtype, count=count, width=width, nonnegative=nonnegative)

    return {
        "irradiance": layer("irradiance", FOUR_FLOATS, nonnegative=True),
        "glossy": layer("glossy", FOUR_FLOATS, coated, nonnegative=True),
        "normals": layer("normals", np.uint32),
    }
