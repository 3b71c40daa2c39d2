"""Virtual point lights: drawn from all places where light was found to be reflected, by how much it may matter.

Keller 1997, "Instant Radiosity"; Linke 2016, section 3.2. Departures: lights are drawn by flux and by what they may
give to the view, instead of from a regular grid, so none is spent on an empty texel; paths give the light of emitters,
of the environment, and of further bounces.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...gpu.graph import Graph
from ...gpu.handles import Buffer, Handle, Texture
from ...gpu.wgsl.load import load
from ...settings import setting
from ..shared.gbuffer import Gbuffer
from .inputs import ManyLightInputs
from .points import Points
from .rsm import CANDIDATE, Rsm

VIEW_POINTS = 64  # pixels that stand for the view; chosen
TABLE_WIDTH = int(load("many_light/vpl/table.wgsl").constants["VPL_TABLE_WIDTH"])
OVERLAP_LIGHTS = 512  # that each light is compared with at most; chosen
BLOCK = int(load("many_light/vpl/weigh.wgsl").constants["BLOCK"])


@dataclass
class VplSettings:
    """Virtual point lights."""

    count: int = setting(2048, "Virtual point lights.", "lights", range=(64, 16384), presets={"low": 512, "high": 4096})
    importance: str = setting(
        "view",
        "Draw lights by flux, so that they stay while the camera moves, also by what they may give to the view, or from"
        " all places alike (grid).",
        choices=("view", "flux", "grid"),
    )
    paths: int = setting(
        8192,
        "Paths that light walks from emitters and the environment, and for more than one bounce.",
        "paths",
        range=(64, 1 << 16),
        presets={"low": 2048, "high": 32768},
    )
    vertices: int = setting(12, "Bounces that a path of light has at most.", "bounces", range=(1, 32))


@dataclass
class Vpls:
    """The table of virtual point lights as `wgsl/many_light/vpl/table.wgsl` has it, and how many slots it has."""

    table: Texture
    count: int


def declare_walk(
    graph: Graph,
    settings: VplSettings,
    scene: ManyLightInputs,
    points: Points,
    albedo: Handle,
    bounces: int | None,
    seed: int,
) -> tuple[Buffer, int] | None:
    """Declare the paths of light; return their candidates and how many there are, or None if none is needed."""
    vertices = min(settings.vertices, bounces or settings.vertices)
    has_sky, has_emitters = scene.features["HAS_ENVIRONMENT"], scene.features["HAS_EMITTERS"]
    if not has_sky and not has_emitters and vertices == 1:
        graph.skip("vpl/walk", "the reflective shadow maps hold all light of one bounce")
        return None
    others = has_emitters or (scene.vpl.rsm_texels > 0 and vertices > 1)
    sky_paths = (settings.paths // 2 if others else settings.paths) if has_sky else 0
    count = settings.paths * vertices
    walk = graph.buffer("vpl/walk", dtype=CANDIDATE, count=2 * count)
    shader = "many_light/vpl/walk.wgsl"
    graph.compute(
        "vpl/walk",
        shader,
        over=settings.paths,
        reads={**scene.surfaces, **scene.lights, "points": points.buffer, "ambient_albedo": albedo},
        writes={"walk": walk},
        params={"paths": settings.paths, "sky_paths": sky_paths, "seed": seed},
        constants=scene.constants(shader),
    )
    return walk, count


def declare_vpls(
    graph: Graph,
    settings: VplSettings,
    rsm: Rsm | None,
    walk: tuple[Buffer, int] | None,
    gbuffer: Gbuffer,
    seed: int,
) -> Vpls:
    """Declare the choice of virtual point lights among the texels of the maps and the vertices of the paths."""
    count = settings.count
    texels = rsm.count if rsm is not None else 0
    candidates = texels + (walk[1] if walk is not None else 0)
    found = {
        "rsm": rsm.buffer if rsm is not None else graph.neutral("buffer"),
        "walk": walk[0] if walk is not None else graph.neutral("buffer"),
    }
    by_view = settings.importance == "view"
    if by_view:
        view_points = graph.buffer("vpl/view_points", dtype=np.dtype((np.float32, 8)), count=VIEW_POINTS)
        graph.compute(
            "vpl/view_points",
            "many_light/vpl/view_points.wgsl",
            over=VIEW_POINTS,
            reads={"surfaces": gbuffer.surfaces, "distance": gbuffer.distance},
            writes={"view_points": view_points},
        )
    else:
        graph.skip("vpl/view_points", f"vpl.importance is {settings.importance}")
    blocks = graph.buffer("vpl/blocks", count=-(-candidates // BLOCK))
    cumulative = graph.buffer("vpl/cumulative", count=candidates)
    graph.compute(
        "vpl/weigh",
        "many_light/vpl/weigh.wgsl",
        over=candidates,
        reads={**found, "view_points": view_points if by_view else graph.neutral("buffer")},
        writes={"cumulative": cumulative, "blocks": blocks},
        params={"texels": texels, "candidates": candidates},
        constants={"VIEW": by_view, "GRID": settings.importance == "grid"},
    )
    totals = graph.buffer("vpl/totals", count=blocks.count)
    graph.compute("vpl/total", "many_light/vpl/total.wgsl", over=1, reads={"blocks": blocks}, writes={"totals": totals})
    size = (TABLE_WIDTH, -(-2 * count // TABLE_WIDTH))
    drawn, table = (graph.texture(f"vpl/{name}", "rgba32uint", size=size) for name in ("drawn", "table"))
    graph.compute(
        "vpl/select",
        "many_light/vpl/select.wgsl",
        over=count,
        reads={**found, "cumulative": cumulative, "totals": totals},
        writes={"vpls": drawn},
        params={"texels": texels, "candidates": candidates, "count": count, "seed": seed},
    )
    graph.compute(
        "vpl/overlap",
        "many_light/vpl/overlap.wgsl",
        over=count,
        reads={"drawn": drawn},
        writes={"vpls": table},
        params={"count": count, "stride": -(-count // OVERLAP_LIGHTS)},
    )
    return Vpls(table, count)
