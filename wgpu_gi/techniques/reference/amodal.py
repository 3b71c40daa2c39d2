"""Which pixels each instance would cover if it were alone: rays that go on through all that they meet.

One pass serves any number of instances, in bands of rows that bound its memory. All rays together meet as many surfaces
as lie behind one another.
"""

from __future__ import annotations

import numpy as np

from ...gpu.graph import Graph
from ...gpu.handles import Buffer
from ..shared.scene_inputs import SceneInputs

SHADER = "reference/amodal.wgsl"
MOST_BITS = 1 << 28  # 32 MiB
WORDS = 5  # of an instance's result


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
        SHADER,
        over=(width, rows),
        reads=scene.surfaces,
        writes={"bits": bits, "boxes": boxes},
        params={"first_row": first_row, "rows": rows, "words": words},
        constants=scene.constants(SHADER),
        clear=[bits, boxes],
    )
    return boxes
