"""Imperfect shadow maps (ISMs): the visibility of each virtual point light as a small map of its hemisphere.

Ritschel et al. 2008, "Imperfect Shadow Maps for Efficient Computation of Indirect Illumination"; Linke 2016, section
3.3.1 (splatting) and 3.3.2 (single texels and pull-push). Departures:

* A few rays from each VPL sample its surroundings, beside or instead of points spread over all surfaces, so that
  no surface near the VPL is missed.
* Cells of the map with silhouettes of large triangles are refined: each block of 2 x 2 texels gets a ray.
* Texels hold a plane instead of a distance, and splats lie in the plane of their surface.
* Texels have equal solid angles; they leaked less light behind a thin screen than octahedral maps, and no more than
  paraboloids.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...errors import GiError
from ...gpu.formats import FOUR_FLOATS, FOUR_WORDS
from ...gpu.graph import Graph
from ...gpu.handles import Buffer, Handle, Texture
from ...gpu.wgsl.load import load
from ...records import KnownAttributes
from ...settings import setting
from ...webgpu_limits import MAX_TEXTURE_SIDE
from ..shared.bounds import NOTHING
from ..shared.scene_inputs import SceneInputs
from .points import Points
from .vpl import Vpls

MAX_GROUPS = 65535  # WebGPU's default limit of a dispatch
TILE = int(load("many_light/ism/pull_push.wgsl").constants["TILE"])  # side of a workgroup's square, texels
BLOCK = int(load("many_light/ism/map.wgsl").constants["BLOCK"])
REFINE_GROUP = int(load("many_light/ism/silhouette_cells.wgsl").constants["REFINE_GROUP"])
# Points per map. Pull-push needs this many beside its rays for a bias within 3 % in the Cornell box.
DEFAULT_POINTS = {"splat": 0, "pull-push": 1024}


@dataclass(repr=False, slots=True)
class IsmSettings(KnownAttributes):
    """Imperfect shadow maps of virtual point lights."""

    mode: str = setting(
        "splat",
        "Draw points as discs in their surface's plane (splat), or as texels whose gaps are closed (pull-push).",
        choices=("splat", "pull-push"),
    )
    resolution: int = setting(
        64, "Side of a map; a power of two.", "texels", range=(16, 256), presets={"low": 32, "high": 128}
    )
    ray_spacing: int = setting(
        8, "Spacing of a light's rays; a power of two.", "texels", range=(4, 16), presets={"high": 4}
    )
    refine: bool = setting(True, "Trace a ray per 2 x 2 texels in cells with silhouettes of large triangles.")
    points: int | None = setting(
        None,
        f"Surface points drawn into each map; none: automatic, {DEFAULT_POINTS['pull-push']} with pull-push, else 0.",
        "points",
        range=(0, 65536),
    )
    max_splat_radius: float = setting(3.0, "Largest radius of a splat.", "texels", range=(0.5, 16.0))
    splat_scale: float = setting(0.7, "Radius of a splat over the radius of its point's area.", range=(0.1, 4.0))
    push_reach: float = setting(0.7, "Reach of a pull-push sample over its radius.", range=(0.1, 4.0))
    depth_interval: float = setting(
        1.2, "Depth interval that pull-push treats as one surface, over a sample's radius.", range=(0.1, 8.0)
    )


@dataclass
class Ism:
    """The bindings and constants of `wgsl/many_light/ism/lookup.wgsl`, by name.

    For debug views: `samples`, the texels before gaps are closed; `ray_hits`, the hits of rays, `ray_spacing` texels
    apart (0: `samples` holds them).
    """

    reads: dict[str, Handle]
    constants: dict[str, float]
    samples: Buffer
    ray_hits: Buffer
    ray_spacing: int


@dataclass
class _Layout:
    """Sizes of all maps: `size` of the atlas in texels, rays per side of a map, points per map."""

    size: tuple[int, int]
    rays: int
    points: int


def declare_ism(graph: Graph, settings: IsmSettings, scene: SceneInputs, points: Points, vpls: Vpls) -> Ism:
    """Declare the maps of all VPLs in one atlas, r32uint, in the code of `wgsl/many_light/ism/map.wgsl`.

    Raises GiError for sizes that are not powers of two, and for maps that exceed a texture or a buffer.
    """
    layout = _layout(graph, settings, vpls)
    single = settings.mode == "pull-push"
    width, height = layout.size
    constants: dict[str, float] = {"ISM_RESOLUTION": settings.resolution}
    sampled = single or layout.points > 0
    samples = graph.buffer("ism/samples", dtype=np.uint32, count=width * height if sampled else 1)
    rays = vpls.count * layout.rays**2
    ray_hits = graph.buffer("ism/ray_hits", dtype=FOUR_FLOATS, count=1 if single else 3 * rays)

    # Sample the surroundings of each VPL with surface points, then with rays.
    if layout.points:
        _declare_splats(graph, settings, layout, points, vpls, samples)
    else:
        graph.skip("ism/splat", "ism.points is 0", NOTHING)
    shader = "many_light/ism/rays.wgsl"
    graph.compute(
        "ism/rays",
        shader,
        over=vpls.count * layout.rays,
        reads={**scene.surfaces, "vpl_table": vpls.table},
        writes={"ray_hits": ray_hits, "samples": samples},
        params={"vpl_count": vpls.count, "atlas_width": width},
        constants={
            **scene.constants(shader),
            **constants,
            **vpls.constants,
            "RAY_SPACING": settings.ray_spacing,
            "SINGLE": single,
        },
        clear=[samples] if single and not layout.points else [],
    )

    # Close the gaps between the samples.
    atlas = graph.texture("ism/atlas", "r32uint", size=layout.size)
    if single:
        _declare_pull_push(graph, settings, layout, points, samples, atlas)
    else:
        _declare_fill(graph, settings, scene, vpls, ray_hits, samples if layout.points else None, atlas)
    return Ism({"ism_atlas": atlas}, constants, samples, ray_hits, 0 if single else settings.ray_spacing)


def _layout(graph: Graph, settings: IsmSettings, vpls: Vpls) -> _Layout:
    """Return the sizes of the maps. Raises GiError if the atlas or the buffer of ray hits is too large."""
    for name in ("resolution", "ray_spacing"):
        value = getattr(settings, name)
        if value & (value - 1):
            raise GiError(f"ism.{name} must be a power of two, not {value}")
    points = settings.points if settings.points is not None else DEFAULT_POINTS[settings.mode]
    # Make the atlas at least a tile, so that workgroups of pull-push are full.
    columns = max(1 << -(-(vpls.count - 1).bit_length() // 2), TILE // settings.resolution, 1)
    rows = max(-(-vpls.count // columns), TILE // settings.resolution)
    layout = _Layout(
        (columns * settings.resolution, rows * settings.resolution),
        settings.resolution // settings.ray_spacing + 1,
        points,
    )
    if max(layout.size) > MAX_TEXTURE_SIDE:
        raise GiError(
            f"{vpls.count} maps of {settings.resolution} x {settings.resolution} texels do not fit into a texture;"
            " lower ism.resolution or vpl.count"
        )
    # Check the largest buffers: ray hits of mode splat, samples of both modes.
    single = settings.mode == "pull-push"
    ray_bytes = 0 if single else 3 * vpls.count * layout.rays**2 * FOUR_FLOATS.itemsize
    sample_bytes = layout.size[0] * layout.size[1] * 4 if single or points else 0
    limit, needed = _buffer_limit(graph), max(ray_bytes, sample_bytes)
    if needed > limit:
        remedy = "raise ism.ray_spacing or lower " if ray_bytes == needed else "lower "
        raise GiError(
            f"imperfect shadow maps of {vpls.count} lights need a buffer of {needed / 2**20:.0f} MiB, and this device"
            f" binds at most {limit / 2**20:.0f} (max-storage-buffer-binding-size); {remedy}ism.resolution or vpl.count"
        )
    return layout


def _buffer_limit(graph: Graph) -> int:
    """Return the largest buffer that a shader can bind, bytes."""
    return int(graph.device.limits.get("max-storage-buffer-binding-size", 2**27))


def _declare_splats(
    graph: Graph, settings: IsmSettings, layout: _Layout, points: Points, vpls: Vpls, samples: Buffer
) -> None:
    """Declare the drawing of surface points, as discs or as single texels."""
    graph.compute(
        "ism/splat",
        "many_light/ism/splat.wgsl",
        over=(layout.points, vpls.count),
        reads={"points": points.buffer, "vpl_table": vpls.table},
        writes={"samples": samples},
        params={
            "points_per_map": layout.points,
            "atlas_width": layout.size[0],
            "max_radius": 0.0 if settings.mode == "pull-push" else settings.max_splat_radius,
            "splat_scale": settings.splat_scale,
        },
        constants={"ISM_RESOLUTION": settings.resolution, **vpls.constants},
        clear=[samples],
    )


def _declare_pull_push(
    graph: Graph, settings: IsmSettings, layout: _Layout, points: Points, samples: Buffer, atlas: Texture
) -> None:
    """Declare the pass that closes the gaps between single texels."""
    graph.compute(
        "ism/pull_push",
        "many_light/ism/pull_push.wgsl",
        over=(atlas.size[0], atlas.size[1] // TILE),
        reads={"samples": samples, "points": points.buffer},
        writes={"atlas": atlas},
        params={
            "points_per_map": layout.points,
            "push_reach": settings.push_reach,
            "depth_interval": settings.depth_interval,
        },
        constants={"ISM_RESOLUTION": settings.resolution, "RAY_SPACING": settings.ray_spacing},
    )


def _declare_fill(
    graph: Graph,
    settings: IsmSettings,
    scene: SceneInputs,
    vpls: Vpls,
    ray_hits: Buffer,
    samples: Buffer | None,
    atlas: Texture,
) -> None:
    """Declare the passes that fill the cells between rays and refine silhouette cells by further rays.

    A dispatch and a buffer hold a limited number of cells, so the maps are refined in ranges whose lists hold all of
    their cells. Every silhouette cell is refined, in any order of the list.
    """
    constants = {"ISM_RESOLUTION": settings.resolution, "RAY_SPACING": settings.ray_spacing}
    cells = settings.resolution // settings.ray_spacing
    blocks = settings.ray_spacing // BLOCK
    # Process a range of maps at a time.
    most = min(MAX_GROUPS * REFINE_GROUP // blocks, _buffer_limit(graph) // (FOUR_WORDS.itemsize * blocks**2))
    maps = min(max(most // cells**2, 1), vpls.count) if settings.refine else vpls.count
    listed = maps * cells**2 if settings.refine else 1
    silhouette_cells = graph.buffer("ism/silhouette_cells", dtype=np.uint32, count=listed)
    groups = graph.buffer("ism/refine_groups", dtype=np.uint32, count=4)
    texels = graph.buffer("ism/blocks", dtype=FOUR_WORDS, count=listed * blocks**2) if settings.refine else None
    listing: dict[str, Handle] = {"silhouette_cells": silhouette_cells, "refine_groups": groups}
    for first in range(0, vpls.count, maps):
        suffix = f"_{first // maps}" if first else ""
        graph.compute(
            f"ism/fill{suffix}",
            "many_light/ism/fill.wgsl",
            over=(cells, cells, min(maps, vpls.count - first)),
            reads={"ray_hits": ray_hits, "samples": samples or graph.neutral("buffer")},
            writes={"atlas": atlas, **listing},
            params={"first_slot": first},
            constants={**constants, "SPLATTED": samples is not None, "REFINED": settings.refine},
            clear=[groups],
        )
        if texels is None:
            graph.skip("ism/refine", "ism.refine is off", NOTHING)
            continue
        shader = "many_light/ism/refine.wgsl"
        graph.compute(
            f"ism/refine{suffix}",
            shader,
            indirect=groups,
            reads={**scene.surfaces, "vpl_table": vpls.table, **listing},
            writes={"blocks": texels},
            constants={**scene.constants(shader), **constants, **vpls.constants},
        )
        graph.compute(
            f"ism/store_blocks{suffix}",
            "many_light/ism/store_blocks.wgsl",
            indirect=groups,
            reads={**listing, "blocks": texels},
            writes={"atlas": atlas},
            constants=constants,
        )
