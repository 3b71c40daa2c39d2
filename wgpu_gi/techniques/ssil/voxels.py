"""A grid of voxels over the view frustum, one bit each, for visibility between visible surfaces.

Eisemann and Decoret 2008, "Single-Pass GPU Solid Voxelization for Real-Time Applications", as used by Soler et al. 2010
(section 4, "Visibility computation"). Departures: atomics on a buffer replace blending with XOR; large triangles are
divided into tiles; slices grow with depth and span only the visible depths; meshes that are thin or have open
edges are voxelized as surfaces, not as solids; a level marches through a finer grid than its own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...gpu.graph import Graph
from ...gpu.handles import Buffer, Handle
from ...gpu.wgsl.load import load
from ...records import KnownAttributes
from ...settings import setting
from ...upload.solid_meshes import CHOICES
from ..shared.bounds import NOTHING
from .inputs import SsilInputs
from .levels import Levels

# The default grid is as fine as the first level if a coarser one has fewer cells across the picture than this. With 80
# cells instead of 160, Sponza at 320x180 has relMSE 5.4 instead of 4.0 and bias -9.2 instead of -8.5 %.
LEAST_CELLS = 160
TRIANGLE_ROW, CELL_ROW = (int(load(f"ssil/voxels/{name}.wgsl").constants["ROW"]) for name in ("voxelize", "fill"))
TILE_WORDS = int(load("ssil/voxels/triangle.wgsl").constants["TILE_WORDS"])
MOST_TILES = 65535  # workgroups of a dispatch along an axis


@dataclass(repr=False, slots=True)
class VoxelSettings(KnownAttributes):
    """Visibility by voxels."""

    slices: int = setting(
        256, "Voxels along the depth of each cell; a multiple of 32.", "voxels", range=(32, 1024), presets={"low": 128}
    )
    step: float = setting(1.0, "Step of a march between two surfaces.", "cells", range=(0.25, 8), presets={"low": 2.0})
    coarser: int | None = setting(
        None,
        "Levels by which the finest grid is coarser than the start level; none: automatic, 1, or 0 if 1 would leave"
        f" fewer than {LEAST_CELLS} cells across the picture.",
        "levels",
        range=(0, 2),
        presets={"low": 1, "high": 0},
    )
    finer: int = setting(2, "Levels by which the grid of a level is finer than the level.", "levels", range=(0, 6))
    solids: str = setting(
        "auto", "Meshes that are solids: thick ones without open edges (auto), all, or none.", choices=CHOICES
    )


@dataclass
class Voxels:
    """Grids by level: rows of cells, `slices` / 32 words each. `range`: the depth range, from `depth_range.wgsl`."""

    grids: dict[int, Buffer]
    range: Buffer
    sizes: dict[int, tuple[int, int]]
    slices: int
    step: float
    finer: int

    def reads(self, level: int) -> dict[str, Buffer]:
        """Return the bindings of the march at a level."""
        return {"voxels": self.grids[self._grid(level)], "range": self.range}

    @property
    def constants(self) -> dict[str, float]:
        """The constants of the march."""
        return {"SLICES": self.slices}

    def params(self, level: int) -> dict[str, object]:
        """Return the params of the march at a level."""
        grid = self._grid(level)
        return {
            "grid_size": self.sizes[grid],
            "cell": float(1 << grid),
            "step": self.step,
        }

    def _grid(self, level: int) -> int:
        """Return the level of the grid that a level marches through."""
        return min(max(level - self.finer, min(self.grids)), max(self.grids))


# The params of a march without voxels.
NO_GRID = {"grid_size": (0, 0), "cell": 1.0, "step": 1.0}


def declare_voxels(graph: Graph, settings: VoxelSettings, scene: SsilInputs, levels: Levels) -> Voxels:
    """Declare the voxels of the view frustum, at all levels that gather light."""
    solids, draws = scene.solids, scene.draws
    assert draws is not None
    # Choose the finest grid.
    few = levels.size_of(levels.first + 1)[0] < LEAST_CELLS
    coarser = settings.coarser if settings.coarser is not None else int(not few)
    finest = levels.first + coarser
    size = levels.size_of(finest)
    slices = -(-settings.slices // 32) * 32
    words = size[0] * size[1] * slices // 32

    # Find the depths that the slices span.
    range_ = graph.buffer("voxels/range", dtype=np.uint32, count=2)
    graph.compute(
        "voxels/depth_range",
        "ssil/voxels/depth_range.wgsl",
        over=levels.surfels[0],  # level 0 does not change from frame to frame, so voxels of a still picture are kept
        reads={"surfels": levels.surfels[0]},
        writes={"range": range_},
        clear=[range_],
    )

    # Voxelize the triangles: boundaries of solids first, then surfaces.
    drawn = bool(draws.opaque or draws.masked)
    kinds = {"HAS_SOLIDS": drawn and solids.has_solids, "HAS_SHELLS": drawn and solids.has_shells}
    list_ = words * max(sum(kinds.values()), 1)
    cells = graph.buffer("voxels/cells", dtype=np.uint32, count=list_ + 1 + MOST_TILES * TILE_WORDS)
    constants: dict[str, float] = {"SLICES": slices, **kinds}
    shells = words if solids.has_solids else 0
    grid_params = {"size": size, "cell": float(1 << finest), "shells": shells, "list": list_}
    _declare_surfaces(graph, scene, range_, cells, grid_params, constants)

    # Fill the solids.
    grid = graph.buffer(f"voxels/grid_{finest}", dtype=np.uint32, count=words)
    graph.compute(
        "voxels/fill",
        "ssil/voxels/fill.wgsl",
        over=(CELL_ROW, -(-size[0] * size[1] // CELL_ROW)),
        reads={"cells": cells if drawn else graph.neutral("buffer")},
        writes={"voxels": grid},
        constants=constants,
    )
    grids = _declare_coarser(graph, levels, {finest: grid}, slices, levels.gathered.stop - settings.finer)
    sizes = {k: levels.size_of(k) for k in grids}
    return Voxels(grids, range_, sizes, slices, settings.step, settings.finer)


def _declare_coarser(
    graph: Graph, levels: Levels, grids: dict[int, Buffer], slices: int, stop: int
) -> dict[int, Buffer]:
    """Declare the grids of the levels after the one in `grids`, before `stop`; return all grids."""
    for k in range(max(grids) + 1, stop):
        width, height = levels.size_of(k)
        grids[k] = graph.buffer(f"voxels/grid_{k}", dtype=np.uint32, count=width * height * slices // 32)
        graph.compute(
            f"voxels/downsample_{k}",
            "ssil/voxels/downsample.wgsl",
            over=(width, height),
            reads={"finer": grids[k - 1]},
            writes={"voxels": grids[k]},
            params={"finer_size": levels.size_of(k - 1), "size": (width, height)},
            constants={"SLICES": slices},
        )
    return grids


def _declare_surfaces(
    graph: Graph,
    scene: SsilInputs,
    range_: Buffer,
    cells: Buffer,
    grid: dict[str, object],
    constants: dict[str, float],
) -> None:
    """Declare the passes that voxelize all triangles into `cells`, large ones in tiles; `grid`: their common params."""
    shader = "ssil/voxels/voxelize.wgsl"
    reads: dict[str, Handle] = {
        **scene.surfaces,
        **scene.raster,
        "raster_indices": scene.raster_indices,
        "range": range_,
        "solid_triangles": scene.solids.triangles,
    }
    constants = {**scene.constants(shader), **constants}
    empty = [cells]
    for part, masked in (("opaque", False), ("masked", True)):
        runs = scene.draws.masked if masked else scene.draws.opaque
        if not runs:
            graph.skip(f"voxels/{part}", f"no {'alpha-masked' if masked else 'opaque'} material", NOTHING)
        for number, (first, indices, slot, instances) in enumerate(runs):
            count = indices // 3 * instances
            graph.compute(
                f"voxels/{part}" + (f"_{number}" if number else ""),
                shader,
                over=(TRIANGLE_ROW, -(-count // TRIANGLE_ROW)),
                reads=reads,
                writes={"cells": cells},
                params={**grid, "first": first, "triangles": indices // 3, "slot": slot, "count": count},
                constants={
                    **constants,
                    "HAS_CUTS": masked,
                    "LARGE": graph.device.capabilities.serial_cells,
                    "MOST_TILES": MOST_TILES,
                },
                clear=empty,
            )
            empty = []
    if not empty:
        _declare_tiles(graph, cells, reads, grid, {**constants, "HAS_CUTS": bool(scene.draws.masked)})


def _declare_tiles(
    graph: Graph,
    cells: Buffer,
    reads: dict[str, Handle],
    grid: dict[str, object],
    constants: dict[str, float],
) -> None:
    """Declare the passes that voxelize the listed tiles of large triangles."""
    groups = graph.buffer("voxels/tile_groups", dtype=np.uint32, count=3)
    graph.compute(
        "voxels/tile_groups",
        "ssil/voxels/tile_groups.wgsl",
        over=1,
        reads={"cells": cells},
        writes={"groups": groups},
        params={"list": grid["list"], "most": MOST_TILES},
    )
    graph.compute(
        "voxels/tiles",
        "ssil/voxels/tiles.wgsl",
        indirect=groups,
        reads=reads,
        writes={"cells": cells},
        params=grid,
        constants=constants,
    )
