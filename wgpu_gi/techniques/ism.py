"""Imperfect shadow maps: what each virtual point light sees, in one small map of a hemisphere each.

Ritschel et al. 2008, "Imperfect Shadow Maps for Efficient Computation of Indirect Illumination"; Linke 2016, section
3.3. Departures: a few rays from each light find points where it looks, so that nothing near it is missed, beside or
instead of points spread over all surfaces; at silhouettes of large surfaces each texel has a ray; texels hold a plane
instead of a distance; all texels have the same solid angle, which leaked less behind a thin screen than octahedral
maps and was no worse there than paraboloids; discs lie in the plane of their surface.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import GiError
from ..gpu.graph import Graph
from ..gpu.handles import Buffer, Handle, Texture
from ..settings import setting
from .points import Points
from .scene_inputs import SceneInputs
from .vpl import Vpls

LARGEST_SIDE = 8192  # texels: WebGPU's default limit of a texture's side
FOUR_FLOATS = np.dtype((np.float32, 4))
TILE = 64  # texels of a side that a workgroup of pull-push holds


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
        8, "Texels from one ray of a light to the next; a power of two.", "texels", range=(2, 16), presets={"high": 4}
    )
    refine: bool = setting(True, "Trace a ray for each texel of cells with silhouettes of large triangles.")
    points: int = setting(0, "Points of all surfaces that are drawn into a map.", "points", range=(0, 65536))
    footprint: float = setting(3.0, "Radius to which the disc of such a point is cut off.", "texels", range=(0.5, 16.0))
    grow: float = setting(0.7, "Radius of a point's disc, over that of its share of the area.", range=(0.1, 4.0))
    reach: float = setting(0.7, "How far pull-push spreads a point, over its radius.", range=(0.1, 4.0))
    interval: float = setting(
        1.2, "Depth that pull-push takes for one surface, over a point's radius.", range=(0.1, 8.0)
    )


@dataclass
class Ism:
    """What `wgsl/ism/lookup.wgsl` needs: its bindings and its constants, by name."""

    reads: dict[str, Handle]
    constants: dict[str, float]


def declare_ism(graph: Graph, settings: IsmSettings, scene: SceneInputs, points: Points, vpls: Vpls) -> Ism:
    """Declare the maps of all virtual point lights in one atlas.

    Raises GiError for sizes that are no powers of two, and for an atlas larger than a texture may be.
    """
    for name in ("resolution", "cell"):
        value = getattr(settings, name)
        if value & (value - 1):
            raise GiError(f"ism.{name} must be a power of two, not {value}")
    # At least a tile, so that workgroups are full.
    across = max(1 << -(-(vpls.count - 1).bit_length() // 2), TILE // settings.resolution, 1)
    down = max(-(-vpls.count // across), TILE // settings.resolution)
    width, height = across * settings.resolution, down * settings.resolution
    if max(width, height) > LARGEST_SIDE:
        raise GiError(
            f"{vpls.count} maps of {settings.resolution} x {settings.resolution} texels are more than a texture holds;"
            " lower ism.resolution or vpl.count"
        )
    constants: dict[str, float] = {"ISM_RESOLUTION": settings.resolution, "ISM_COLUMNS": across}
    single = settings.mode == "pull-push"
    drawn = graph.buffer("ism/drawn", dtype=np.uint32, count=width * height if single or settings.points else 1)
    if settings.points:
        _declare_points(graph, settings, points, vpls, drawn, constants, single)
    else:
        graph.skip("ism/points", "ism.points is 0")
    near = _declare_rays(graph, settings, scene, vpls, drawn, constants, single)
    atlas = graph.texture("ism/atlas", "r32uint", size=(width, height))
    if single:
        _declare_pull_push(graph, settings, points, drawn, atlas, constants)
    else:
        _declare_fill(graph, settings, scene, vpls, near, drawn, atlas, constants)
    return Ism({"ism_atlas": atlas}, constants)


def _declare_points(
    graph: Graph,
    settings: IsmSettings,
    points: Points,
    vpls: Vpls,
    drawn: Buffer,
    constants: dict[str, float],
    single: bool,
) -> None:
    """Declare the drawing of points of all surfaces, as discs or as single texels."""
    graph.compute(
        "ism/points",
        "ism/points.wgsl",
        over=(settings.points, vpls.count),
        reads={"points": points.buffer, "vpl_table": vpls.table},
        writes={"drawn": drawn},
        constants={
            **constants,
            "PER_MAP": settings.points,
            "FOOTPRINT": 0.0 if single else settings.footprint,
            "GROW": settings.grow,
        },
        clear=[drawn],
    )


def _declare_rays(
    graph: Graph,
    settings: IsmSettings,
    scene: SceneInputs,
    vpls: Vpls,
    drawn: Buffer,
    constants: dict[str, float],
    single: bool,
) -> Buffer:
    """Declare the rays of every light, and return the points that they find."""
    side = settings.resolution // settings.cell + 1
    near = graph.buffer("ism/near_points", dtype=FOUR_FLOATS, count=1 if single else 3 * vpls.count * side * side)
    shader = "ism/rays.wgsl"
    graph.compute(
        "ism/rays",
        shader,
        over=(side * side, vpls.count),
        reads={**scene.surfaces, "vpl_table": vpls.table},
        writes={"near_points": near, "drawn": drawn},
        constants={**scene.constants(shader), **constants, "CELL": settings.cell, "SINGLE": single},
        clear=[drawn] if single and not settings.points else [],
    )
    return near


def _declare_pull_push(
    graph: Graph,
    settings: IsmSettings,
    points: Points,
    drawn: Buffer,
    atlas: Texture,
    constants: dict[str, float],
) -> None:
    """Declare what closes the gaps between single texels."""
    graph.compute(
        "ism/pull_push",
        "ism/pull_push.wgsl",
        over=(atlas.size[0] // TILE * 256, atlas.size[1] // TILE),
        reads={"drawn": drawn, "points": points.buffer},
        writes={"atlas": atlas},
        constants={
            **constants,
            "SPACING": settings.cell,
            "PER_MAP": settings.points,
            "REACH": settings.reach,
            "INTERVAL": settings.interval,
        },
    )


def _declare_fill(
    graph: Graph,
    settings: IsmSettings,
    scene: SceneInputs,
    vpls: Vpls,
    near: Buffer,
    drawn: Buffer,
    atlas: Texture,
    constants: dict[str, float],
) -> None:
    """Declare what fills cells by the rays at their corners, and texels of cells that these leave open by their own."""
    constants = {**constants, "CELL": settings.cell}
    cells = settings.resolution // settings.cell
    # As many as one dispatch takes.
    most = min(vpls.count * cells**2, 65535 * 64 // settings.cell**2) if settings.refine else 1
    open_cells = graph.buffer("ism/open_cells", dtype=np.uint32, count=most)
    groups = graph.buffer("ism/open_groups", dtype=np.uint32, count=4)
    graph.compute(
        "ism/fill",
        "ism/fill.wgsl",
        over=(cells, cells, vpls.count),
        reads={"near_points": near, "drawn": drawn if settings.points else graph.neutral("buffer")},
        writes={"atlas": atlas, "open_cells": open_cells, "open_groups": groups},
        constants={**constants, "DRAWN": settings.points > 0, "REFINED": settings.refine},
        clear=[groups],
    )
    if not settings.refine:
        graph.skip("ism/refine", "ism.refine is off")
        return
    refined = graph.buffer("ism/refined", dtype=np.uint32, count=most * settings.cell**2)
    opened: dict[str, Handle] = {"open_cells": open_cells, "open_groups": groups}
    shader = "ism/refine.wgsl"
    graph.compute(
        "ism/refine",
        shader,
        indirect=groups,
        reads={**scene.surfaces, "vpl_table": vpls.table, **opened},
        writes={"refined": refined},
        constants={**scene.constants(shader), **constants},
    )
    graph.compute(
        "ism/put",
        "ism/put.wgsl",
        indirect=groups,
        reads={**opened, "refined": refined},
        writes={"atlas": atlas},
        constants=constants,
    )
