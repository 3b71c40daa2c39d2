"""Adaptive path tracing: paths where the error is, and light rays where the picture needs them.

Each half of the picture, its even and its odd rows, gets paths by the pilot of the other half, so that its mean stays
unbiased (Kirk and Arvo 1991, "Unbiased Sampling Techniques for Image Synthesis"). `wgsl/reference/learned.wgsl` and
`guide.wgsl` define what is learned. Departure: no path is thrown away, because the two pilots are independent.
"""

from __future__ import annotations

import numpy as np

from ...gpu.graph import Graph
from ...gpu.handles import Buffer
from ...gpu.wgsl.load import load
from ..shared.bounds import SAVES
from ..shared.scene_inputs import SceneInputs

LEARNED = "path/learned"  # the buffer's name
_SHADER = "reference/learn_guide.wgsl"
HALVES = 2


def adaptive_runs(spp: int, samples_per_run: int) -> int:
    """Return the number of runs that trace `spp` paths per pixel on the average."""
    constant = load(_SHADER).constants
    pilot, pilot_runs = int(constant["PILOT"]), int(constant["PILOT_RUNS"])
    later = -(-max(spp - pilot, 0) // samples_per_run)
    return later + next((n for n in range(1, pilot_runs) if mean_paths(n - 1, 1) >= spp), pilot_runs)


def mean_paths(run: int, samples_per_run: int) -> int:
    """Return the mean number of paths per pixel after run `run`, counted from 0, as `mean_paths` in WGSL."""
    constant = load(_SHADER).constants
    pilot, pilot_runs = int(constant["PILOT"]), int(constant["PILOT_RUNS"])
    if run < pilot_runs:
        return pilot >> (pilot_runs - 1 - run)
    return pilot + (run + 1 - pilot_runs) * samples_per_run


def missing_paths(graph: Graph) -> int:
    """Return the largest number of paths that a pixel lacks after the last run."""
    return int(graph.read_back(LEARNED)[int(load(_SHADER).constants["MISSING"])])


def declare_learned(graph: Graph, scene: SceneInputs, layers: dict[str, Buffer], tiles: int, adaptive: bool) -> Buffer:
    """Declare the passes that learn from the runs before; return the buffer that they and the path tracer share.

    `layers` has the path tracer's results. It comes later in a frame, so these passes see those of the run before. They
    change none, but declare them as written: a pass cannot read what a later one writes. Unless `adaptive`, the buffer
    is empty and unused.
    """
    if not adaptive:
        for name in ("learn_guide", "tile_errors", "tile_shares"):
            graph.skip(f"path/{name}", "path.adaptive is off", SAVES)
        return graph.buffer(LEARNED, dtype=np.uint32, count=1)
    constant = {name: int(value) for name, value in load(_SHADER).constants.items()}
    grids = HALVES * constant["GUIDED_LIGHTS"]
    words = constant["GUIDE_START"] + grids * constant["GRID_WORDS"] + HALVES * tiles
    learned = graph.buffer(LEARNED, dtype=np.uint32, count=words)
    graph.compute(
        "path/learn_guide",
        _SHADER,
        over=grids * constant["SIDE"],
        writes={"learned": learned},
        constants=scene.constants(_SHADER),
    )
    errors = graph.buffer("path/tile_errors", dtype=np.dtype((np.float32, 4)), count=HALVES * tiles)
    graph.compute(
        "path/tile_errors",
        "reference/tile_errors.wgsl",
        over=tiles * 64,
        writes={**layers, "learned": learned, "tiles": errors},
    )
    graph.compute(
        "path/tile_shares",
        "reference/tile_shares.wgsl",
        over=HALVES * 256,
        reads={"tiles": errors},
        writes={"learned": learned},
    )
    return learned
