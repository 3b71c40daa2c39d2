"""A grid of voxels over the picture, one bit each: what of the frustum is solid, for visibility between its surfaces.

Eisemann and Decoret 2008, "Single-Pass GPU Solid Voxelization for Real-Time Applications", as Soler et al. 2010 take
it, section 4. Departures: by compute instead of blending; slices are as thick as their depth demands and span only what
the picture shows; meshes with open edges and thin ones enter as surfaces; levels march through a finer grid than their
own, by steps of its cells.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...gpu.graph import Graph
from ...gpu.handles import Buffer
from ...gpu.wgsl.load import load
from ...settings import setting
from ...upload.solid_meshes import CHOICES
from .inputs import SsilInputs
from .levels import Levels

LEAST_CELLS = 160  # across the picture. Chosen: those of 640x360, and twice as many as 320x180 would have
TRIANGLE_ROW, CELL_ROW = (int(load(f"ssil/voxels/{name}.wgsl").constants["ROW"]) for name in ("voxelize", "fill"))


@dataclass
class VoxelSettings:
    """How visibility is found by voxels."""

    bits: int = setting(
        256, "Voxels in the depth of each cell; a multiple of 32.", "voxels", range=(32, 1024), presets={"low": 128}
    )
    step: float = setting(1.0, "Step of a march between two surfaces.", "cells", range=(0.25, 8), presets={"low": 2.0})
    coarser: int | None = setting(
        None,
        "Levels by which the finest grid is coarser than the level that gathering starts at; none for 1, or 0 where"
        f" that has fewer than {LEAST_CELLS} cells across.",
        "levels",
        range=(0, 2),
        presets={"low": 1, "high": 0},
    )
    finer: int = setting(2, "Levels by which the grid of a level is finer than itself.", "levels", range=(0, 6))
    solids: str = setting(
        "auto", "Meshes that are solids: thick ones without open edges (auto), all, or none.", choices=CHOICES
    )


@dataclass
class Voxels:
    """Grids of the levels, by their number: cells in rows, `bits` / 32 words each. `range` as `bounds.wgsl` has it."""

    grids: dict[int, Buffer]
    range: Buffer
    sizes: dict[int, tuple[int, int]]
    bits: int
    step: float
    finer: int

    def reads(self, level: int) -> dict[str, Buffer]:
        """Return what the march reads at a level."""
        return {"voxels": self.grids[self._grid(level)], "range": self.range}

    @property
    def constants(self) -> dict[str, float]:
        """The constants of the march."""
        return {"BITS": self.bits}

    def params(self, level: int) -> dict[str, object]:
        """Return the params of the march at a level."""
        grid = self._grid(level)
        return {
            "grid_size": self.sizes[grid],
            "cell": float(1 << grid),
            "step": self.step,
        }

    def _grid(self, level: int) -> int:
        """Return the level whose grid a level marches through."""
        return min(max(level - self.finer, min(self.grids)), max(self.grids))


# The params of a march where there are no voxels to march through.
NO_GRID = {"grid_size": (0, 0), "cell": 1.0, "step": 1.0}


def declare_voxels(graph: Graph, settings: VoxelSettings, scene: SsilInputs, levels: Levels) -> Voxels:
    """Declare the voxels of the camera's frustum at all levels that light is gathered at."""
    solids, draws = scene.solids, scene.draws
    drawn = bool(draws.opaque or draws.masked)
    bits = -(-settings.bits // 32) * 32
    few = levels.surfels[levels.first + 1].size[0] < LEAST_CELLS
    coarser = settings.coarser if settings.coarser is not None else int(not few)
    finest = levels.first + coarser
    first = levels.surfels[finest]
    words = first.size[0] * first.size[1] * bits // 32
    range_ = graph.buffer("voxels/range", dtype=np.uint32, count=2)
    graph.compute(
        "voxels/bounds",
        "ssil/voxels/bounds.wgsl",
        over=levels.surfels[levels.first],
        reads={"surfels": levels.surfels[levels.first]},
        writes={"range": range_},
        clear=[range_],
    )
    kinds = {"HAS_SOLIDS": drawn and solids.has_solids, "HAS_SHELLS": drawn and solids.has_shells}
    cells = graph.buffer("voxels/cells", dtype=np.uint32, count=words * max(sum(kinds.values()), 1))
    grid_params = {"size": first.size, "cell": float(1 << finest)}
    constants: dict[str, float] = {"BITS": bits, **kinds}
    shells = words if solids.has_solids else 0
    _declare_surfaces(graph, scene, range_, cells, {**grid_params, "shells": shells}, constants)
    grid = graph.buffer(f"voxels/grid_{finest}", dtype=np.uint32, count=words)
    graph.compute(
        "voxels/fill",
        "ssil/voxels/fill.wgsl",
        over=(CELL_ROW, -(-first.size[0] * first.size[1] // CELL_ROW)),
        reads={"cells": cells if drawn else graph.neutral("buffer")},
        writes={"voxels": grid},
        constants=constants,
    )
    grids = {finest: grid}
    for k in range(finest + 1, len(levels.surfels) - settings.finer):
        width, height = levels.surfels[k].size
        grids[k] = graph.buffer(f"voxels/grid_{k}", dtype=np.uint32, count=width * height * bits // 32)
        graph.compute(
            f"voxels/shrink_{k}",
            "ssil/voxels/shrink.wgsl",
            over=(width, height),
            reads={"finer": grids[k - 1]},
            writes={"voxels": grids[k]},
            params={"finer_size": levels.surfels[k - 1].size, "size": (width, height)},
            constants={"BITS": bits},
        )
    sizes = {k: levels.surfels[k].size for k in grids}
    return Voxels(grids, range_, sizes, bits, settings.step, settings.finer)


def _declare_surfaces(
    graph: Graph,
    scene: SsilInputs,
    range_: Buffer,
    cells: Buffer,
    grid: dict[str, object],
    constants: dict[str, float],
) -> None:
    """Declare the passes that enter all triangles into the cells; `grid` are the params that all share."""
    shader = "ssil/voxels/voxelize.wgsl"
    empty = [cells]
    for part, masked in (("opaque", False), ("masked", True)):
        runs = scene.draws.masked if masked else scene.draws.opaque
        if not runs:
            graph.skip(f"voxels/{part}", f"no {'alpha-masked' if masked else 'opaque'} material")
        for number, (first, indices, slot, instances) in enumerate(runs):
            count = indices // 3 * instances
            graph.compute(
                f"voxels/{part}" + (f"_{number}" if number else ""),
                shader,
                over=(TRIANGLE_ROW, -(-count // TRIANGLE_ROW)),
                reads={
                    **scene.surfaces,
                    **scene.raster,
                    "raster_indices": scene.raster_indices,
                    "range": range_,
                    "solid_triangles": scene.solids.triangles,
                },
                writes={"cells": cells},
                params={
                    **grid,
                    "first": first,
                    "triangles": indices // 3,
                    "slot": slot,
                    "count": count,
                },
                constants={**scene.constants(shader), **constants, "HAS_CUTS": masked},
                clear=empty,
            )
            empty = []
