"""Questions about surfaces that rays without random choice answer, beside the picture.

`declare_amodal`: which pixels each instance would cover if it were alone, by rays that go on through all that they
meet. One pass serves any number of instances, in bands of rows that bound its memory; all rays together meet as many
surfaces as lie behind one another.
"""

from __future__ import annotations

import numpy as np

from ...gpu.graph import Graph
from ...gpu.handles import Buffer, Shared
from ..shared.scene_inputs import SceneInputs

AMODAL, CORNERS, REACH = "reference/amodal.wgsl", "reference/corners.wgsl", "reference/reach.wgsl"
MOST_BITS = 1 << 28  # 32 MiB
WORDS = 5  # of an instance's result
FOUR_WORDS = np.dtype((np.uint32, 4))


def rows_of_band(size: tuple[int, int], instances: int) -> int:
    """Return how many rows of a picture a band has."""
    width, height = size
    return max(min(MOST_BITS // (instances * width), height), 1)


def declare_amodal(graph: Graph, scene: SceneInputs, instances: int, first_row: int, rows: int) -> Buffer:
    """Declare the pass for a band of rows; return five words for each instance, as `amodal.wgsl` describes them."""
    width, _ = graph.size
    words = -(-rows * width // 32)
    boxes = graph.buffer("amodal/boxes", dtype=np.uint32, count=instances * WORDS)
    bits = graph.buffer("amodal/bits", dtype=np.uint32, count=instances * words)
    graph.compute(
        "amodal",
        AMODAL,
        over=(width, rows),
        reads=scene.surfaces,
        writes={"bits": bits, "boxes": boxes},
        params={"first_row": first_row, "rows": rows, "words": words},
        constants=scene.constants(AMODAL),
        clear=[bits, boxes],
    )
    return boxes


def declare_corners(graph: Graph, scene: SceneInputs) -> Buffer:
    """Declare the pass that finds each pixel's triangle and the point on it; return two elements for each pixel."""
    width, height = graph.size
    corners = graph.buffer("corners", dtype=FOUR_WORDS, count=2 * width * height)
    graph.compute(
        "corners",
        CORNERS,
        over=(width, height),
        reads=scene.surfaces,
        writes={"corners": corners},
        constants=scene.constants(CORNERS),
    )
    return corners


def declare_reach(graph: Graph, scene: SceneInputs, rays: Shared, count: int) -> Buffer:
    """Declare the pass that finds whether `count` rays get as far as their limits; return a word for each."""
    reached = graph.buffer("reach", dtype=np.uint32, count=count)
    graph.compute(
        "reach",
        REACH,
        over=count,
        reads={**scene.surfaces, "rays": rays},
        writes={"reached": reached},
        constants=scene.constants(REACH),
    )
    return reached
