"""Imperfect shadow maps: what each virtual point light sees, in one small map of a hemisphere each.

Ritschel et al. 2008, "Imperfect Shadow Maps for Efficient Computation of Indirect Illumination"; Linke 2016, section
3.3. Departures: a few rays from each light find points where it looks, so that nothing near it is missed, beside or
instead of points spread over all surfaces; at silhouettes of large surfaces each block of 2 x 2 texels has a ray;
texels hold a plane instead of a distance; all texels have the same solid angle, which leaked less behind a thin screen
than octahedral maps and was no worse there than paraboloids; discs lie in the plane of their surface.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...errors import GiError
from ...gpu.graph import Graph
from ...gpu.handles import Buffer, Handle, Texture
from ...gpu.wgsl.load import load
from ...settings import setting
from ..shared.scene_inputs import SceneInputs
from .points import Points
from .vpl import Vpls

LARGEST_SIDE = 8192  # texels: WebGPU's default limit of a texture's side
FOUR_FLOATS = np.dtype((np.float32, 4))
FOUR_WORDS = np.dtype((np.uint32, 4))
TILE = int(load("many_light/ism/pull_push.wgsl").constants["TILE"])  # texels of a side that a workgroup holds
BLOCK = int(load("many_light/ism/map.wgsl").constants["BLOCK"])
GROUP = int(load("many_light/ism/open_cells.wgsl").constants["OPEN_GROUP"])
MOST_GROUPS = 65535  # WebGPU's default limit of a dispatch
FEW_POINTS = 1024  # that pull-push needs beside rays for its bias in the Cornell box to stay within 3 %


@dataclass
class IsmSettings:
    """Imperfect shadow maps of virtual point lights."""

    mode: str = setting(
        "splat",
        "Draw points as pieces of their surface's plane, or as single texels whose gaps are closed by pull-push.",
        choices=("splat", "pull-push"),
    )
    resolution: int = setting(
        64, "Texels on a side of a map; a power of two.", "texels", range=(16, 256), presets={"low": 32, "high": 128}
    )
    cell: int = setting(
        8, "Texels from one ray of a light to the next; a power of two.", "texels", range=(4, 16), presets={"high": 4}
    )
    refine: bool = setting(True, "Trace a ray for each 2 x 2 texels of cells with silhouettes of large triangles.")
    points: int | None = setting(
        None,
        f"Points of all surfaces that are drawn into a map; none for {FEW_POINTS} with pull-push, else no points.",
        "points",
        range=(0, 65536),
    )
    footprint: float = setting(3.0, "Radius to which the disc of such a point is cut off.", "texels", range=(0.5, 16.0))
    grow: float = setting(0.7, "Radius of a point's disc, over that of its share of the area.", range=(0.1, 4.0))
    reach: float = setting(0.7, "How far pull-push spreads a point, over its radius.", range=(0.1, 4.0))
    interval: float = setting(
        1.2, "Depth that pull-push takes for one surface, over a point's radius.", range=(0.1, 8.0)
    )


@dataclass
class Ism:
    """What `wgsl/many_light/ism/lookup.wgsl` needs: its bindings and its constants, by name.

    For debug views: `drawn`, single texels before gaps are closed, and `near_points`, what rays found at every `cell`
    texels; 0 where they are among the single texels.
    """

    reads: dict[str, Handle]
    constants: dict[str, float]
    drawn: Buffer
    near_points: Buffer
    cell: int


def declare_ism(graph: Graph, settings: IsmSettings, scene: SceneInputs, points: Points, vpls: Vpls) -> Ism:
    """Declare the maps of all virtual point lights in one atlas.

    Raises GiError for sizes that are no powers of two, and for maps larger than a texture or a buffer may be.
    """
    for name in ("resolution", "cell"):
        value = getattr(settings, name)
        if value & (value - 1):
            raise GiError(f"ism.{name} must be a power of two, not {value}")
    single = settings.mode == "pull-push"
    per_map = settings.points if settings.points is not None else FEW_POINTS if single else 0
    # At least a tile, so that workgroups are full.
    across = max(1 << -(-(vpls.count - 1).bit_length() // 2), TILE // settings.resolution, 1)
    down = max(-(-vpls.count // across), TILE // settings.resolution)
    width, height = across * settings.resolution, down * settings.resolution
    side = settings.resolution // settings.cell + 1  # of the rays of a light
    rays = vpls.count * side**2
    near_count, drawn_count = 1 if single else 3 * rays, width * height if single or per_map else 1
    _check_size(graph, settings, vpls, (width, height), near_count * FOUR_FLOATS.itemsize, drawn_count * 4)
    constants: dict[str, float] = {"ISM_RESOLUTION": settings.resolution}
    drawn = graph.buffer("ism/drawn", dtype=np.uint32, count=drawn_count)
    near = graph.buffer("ism/near_points", dtype=FOUR_FLOATS, count=near_count)
    if per_map:
        _declare_points(graph, settings, per_map, points, vpls, drawn, width, constants)
    else:
        graph.skip("ism/points", "ism.points is 0")
    shader = "many_light/ism/rays.wgsl"
    graph.compute(
        "ism/rays",
        shader,
        over=vpls.count * side,
        reads={**scene.surfaces, "vpl_table": vpls.table},
        writes={"near_points": near, "drawn": drawn},
        params={"vpl_count": vpls.count, "atlas_width": width},
        constants={**scene.constants(shader), **constants, "CELL": settings.cell, "SINGLE": single},
        clear=[drawn] if single and not per_map else [],
    )
    atlas = graph.texture("ism/atlas", "r32uint", size=(width, height))
    if single:
        _declare_pull_push(graph, settings, per_map, points, drawn, atlas, constants)
    else:
        found = drawn if per_map else None
        _declare_fill(graph, settings, scene, vpls, near, found, atlas, constants)
    return Ism({"ism_atlas": atlas}, constants, drawn, near, 0 if single else settings.cell)


def _check_size(
    graph: Graph, settings: IsmSettings, vpls: Vpls, size: tuple[int, int], near_bytes: int, drawn_bytes: int
) -> None:
    """Raise GiError if the atlas, or what rays find, is more than a texture or a buffer holds."""
    if max(size) > LARGEST_SIDE:
        raise GiError(
            f"{vpls.count} maps of {settings.resolution} x {settings.resolution} texels are more than a texture holds;"
            " lower ism.resolution or vpl.count"
        )
    limit = graph.device.limits.get("max-storage-buffer-binding-size", 2**27)
    needed = max(near_bytes, drawn_bytes)
    if needed > limit:
        remedy = "raise ism.cell or lower " if near_bytes == needed else "lower "
        raise GiError(
            f"imperfect shadow maps of {vpls.count} lights need a buffer of {needed / 2**20:.0f} MiB, and this device"
            f" binds at most {limit / 2**20:.0f} (max-storage-buffer-binding-size); {remedy}ism.resolution or vpl.count"
        )


def _declare_points(
    graph: Graph,
    settings: IsmSettings,
    per_map: int,
    points: Points,
    vpls: Vpls,
    drawn: Buffer,
    atlas_width: int,
    constants: dict[str, float],
) -> None:
    """Declare the drawing of points of all surfaces, as discs or as single texels."""
    graph.compute(
        "ism/points",
        "many_light/ism/points.wgsl",
        over=(per_map, vpls.count),
        reads={"points": points.buffer, "vpl_table": vpls.table},
        writes={"drawn": drawn},
        params={
            "per_map": per_map,
            "atlas_width": atlas_width,
            "footprint": 0.0 if settings.mode == "pull-push" else settings.footprint,
            "grow": settings.grow,
        },
        constants=constants,
        clear=[drawn],
    )


def _declare_pull_push(
    graph: Graph,
    settings: IsmSettings,
    per_map: int,
    points: Points,
    drawn: Buffer,
    atlas: Texture,
    constants: dict[str, float],
) -> None:
    """Declare what closes the gaps between single texels."""
    graph.compute(
        "ism/pull_push",
        "many_light/ism/pull_push.wgsl",
        over=(atlas.size[0], atlas.size[1] // TILE),
        reads={"drawn": drawn, "points": points.buffer},
        writes={"atlas": atlas},
        params={"per_map": per_map, "reach": settings.reach, "interval": settings.interval},
        constants={**constants, "SPACING": settings.cell},
    )


def _declare_fill(
    graph: Graph,
    settings: IsmSettings,
    scene: SceneInputs,
    vpls: Vpls,
    near: Buffer,
    drawn: Buffer | None,
    atlas: Texture,
    constants: dict[str, float],
) -> None:
    """Declare what fills cells by the rays at their corners, and blocks of cells that these leave open by their own."""
    constants = {**constants, "CELL": settings.cell}
    cells = settings.resolution // settings.cell
    rows = settings.cell // BLOCK
    # As many as one dispatch and one buffer take.
    limit = graph.device.limits.get("max-storage-buffer-binding-size", 2**27)
    most = min(vpls.count * cells**2, MOST_GROUPS * GROUP // rows, limit // (FOUR_WORDS.itemsize * rows**2))
    most = most if settings.refine else 1
    open_cells = graph.buffer("ism/open_cells", dtype=np.uint32, count=most)
    groups = graph.buffer("ism/open_groups", dtype=np.uint32, count=4)
    graph.compute(
        "ism/fill",
        "many_light/ism/fill.wgsl",
        over=(cells, cells, vpls.count),
        reads={"near_points": near, "drawn": drawn or graph.neutral("buffer")},
        writes={"atlas": atlas, "open_cells": open_cells, "open_groups": groups},
        constants={**constants, "DRAWN": drawn is not None, "REFINED": settings.refine},
        clear=[groups],
    )
    if not settings.refine:
        graph.skip("ism/refine", "ism.refine is off")
        return
    blocks = graph.buffer("ism/blocks", dtype=FOUR_WORDS, count=most * rows**2)
    opened: dict[str, Handle] = {"open_cells": open_cells, "open_groups": groups}
    shader = "many_light/ism/refine.wgsl"
    graph.compute(
        "ism/refine",
        shader,
        indirect=groups,
        reads={**scene.surfaces, "vpl_table": vpls.table, **opened},
        writes={"blocks": blocks},
        constants={**scene.constants(shader), **constants},
    )
    graph.compute(
        "ism/put",
        "many_light/ism/put.wgsl",
        indirect=groups,
        reads={**opened, "blocks": blocks},
        writes={"atlas": atlas},
        constants=constants,
    )
