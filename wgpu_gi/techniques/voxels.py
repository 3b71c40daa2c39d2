"""A grid of voxels over the picture, one bit each: what of the frustum is solid, for visibility between its surfaces.

Eisemann and Decoret 2008, "Single-Pass GPU Solid Voxelization for Real-Time Applications", as Soler et al. 2010 take
it, section 4. Departures: slices are as thick as their depth demands and span only what the picture shows; meshes with
open edges enter as surfaces; levels march through a finer grid than their own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..gpu.graph import Graph
from ..gpu.handles import Buffer
from ..scene.solids import CHOICES
from ..settings import setting
from .culling import CameraDraws, ViewCulling
from .scene_inputs import SceneInputs
from .ssil_levels import Levels


@dataclass
class VoxelSettings:
    """How visibility is found by voxels."""

    bits: int = setting(128, "Voxels in the depth of each cell; a multiple of 32.", "voxels", range=(32, 1024))
    steps: int = setting(8, "Steps of a march between two surfaces; a multiple of 4.", "steps", range=(4, 64))
    coarser: int = setting(
        1, "Levels by which the finest grid is coarser than the level that gathering starts at.", "levels", range=(0, 2)
    )
    finer: int = setting(2, "Levels by which the grid of a level is finer than itself.", "levels", range=(0, 6))
    solids: str = setting(
        "auto", "Meshes that are solids: those without open edges (auto), all, or none.", choices=CHOICES
    )


@dataclass
class Voxels:
    """Grids of the levels, by their number: cells in rows, `bits` / 32 words each. `range` as `bounds.wgsl` has it."""

    grids: dict[int, Buffer]
    range: Buffer
    sizes: dict[int, tuple[int, int]]
    bits: int
    steps: int
    finer: int

    def reads(self, level: int) -> dict[str, Buffer]:
        """Return what the march reads at a level."""
        return {"voxels": self.grids[self._grid(level)], "range": self.range}

    def constants(self, level: int) -> dict[str, float]:
        """Return the constants of the march at a level."""
        grid = self._grid(level)
        width, height = self.sizes[grid]
        return {
            "BITS": self.bits,
            "STEPS": self.steps,
            "SCALE": 2.0 ** (level - grid),
            "WIDTH": width,
            "HEIGHT": height,
        }

    def _grid(self, level: int) -> int:
        """Return the level whose grid a level marches through."""
        return min(max(level - self.finer, min(self.grids)), max(self.grids))


def declare_voxels(graph: Graph, settings: VoxelSettings, scene: SceneInputs, levels: Levels) -> Voxels:
    """Declare the voxels of the camera's frustum at all levels that light is gathered at."""
    solids = scene.solids
    assert solids is not None
    bits = -(-settings.bits // 32) * 32
    steps = -(-settings.steps // 4) * 4
    finest = levels.first + settings.coarser
    first = levels.surfels[finest]
    words = first.size[0] * first.size[1] * bits // 32
    crossings = graph.buffer("voxels/crossings", dtype=np.uint32, count=words if solids.has_solids else 1)
    shells = graph.buffer("voxels/shells", dtype=np.uint32, count=words if solids.has_shells else 1)
    range_ = graph.buffer("voxels/range", dtype=np.uint32, count=2)
    cells = {"crossings": crossings, "shells": shells}
    graph.compute(
        "voxels/bounds",
        "voxels/bounds.wgsl",
        over=levels.surfels[levels.first],
        reads={"surfels": levels.surfels[levels.first]},
        writes={"range": range_, **cells},
        constants={"BITS": bits},
        clear=[range_],
    )
    kinds = {"HAS_SOLIDS": solids.has_solids, "HAS_SHELLS": solids.has_shells}
    _declare_surfaces(graph, scene, finest, first.size, range_, cells, {"BITS": bits, **kinds})
    grid = graph.buffer(f"voxels/grid_{finest}", dtype=np.uint32, count=words)
    graph.compute(
        "voxels/fill",
        "voxels/fill.wgsl",
        over=first.size[0] * first.size[1],
        reads=cells,
        writes={"voxels": grid},
        constants={"BITS": bits, **kinds},
    )
    grids = {finest: grid}
    for k in range(finest + 1, len(levels.surfels) - settings.finer):
        width, height = levels.surfels[k].size
        grids[k] = graph.buffer(f"voxels/grid_{k}", dtype=np.uint32, count=width * height * bits // 32)
        graph.compute(
            f"voxels/shrink_{k}",
            "voxels/shrink.wgsl",
            over=(width, height),
            reads={"finer": grids[k - 1]},
            writes={"voxels": grids[k]},
            params={"finer_size": levels.surfels[k - 1].size, "size": (width, height)},
            constants={"BITS": bits},
        )
    sizes = {k: levels.surfels[k].size for k in grids}
    return Voxels(grids, range_, sizes, bits, steps, settings.finer)


def _declare_surfaces(
    graph: Graph,
    scene: SceneInputs,
    level: int,
    size: tuple[int, int],
    range_: Buffer,
    cells: dict[str, Buffer],
    constants: dict,
) -> None:
    """Declare the raster passes that enter all triangles in view into the cells."""
    assert scene.draws is not None and scene.solids is not None
    shader = "voxels/voxelize.wgsl"
    square = 1 << level
    # A pass of fragments needs a target.
    target = graph.texture("voxels/target", "r8unorm", size=size)
    culling = ViewCulling()
    for part, masked in (("opaque", False), ("masked", True)):
        if not (scene.draws.masked if masked else scene.draws.opaque):
            graph.skip(f"voxels/{part}", f"no {'alpha-masked' if masked else 'opaque'} material")
            continue
        graph.raster(
            f"voxels/{part}",
            shader,
            draw=CameraDraws(graph.uniforms["view"], scene.upload, masked, culling),
            index=scene.raster_indices,
            color={"color": target},
            reads={**scene.surfaces, **scene.raster, "range": range_, "solid_triangles": scene.solids.triangles},
            writes=cells,
            params={
                "scale": tuple(n / (m * square) for n, m in zip(graph.size, size, strict=True)),
                "width": size[0],
            },
            constants={**scene.constants(shader), **constants},
            entry=("vertex_masked", "fragment_masked") if masked else ("vertex", "fragment"),
            load=masked,
        )
