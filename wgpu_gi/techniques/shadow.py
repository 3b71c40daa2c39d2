"""Shadow maps: all views of all lights in one depth atlas, kept while lights and geometry are still.

Williams 1978, "Casting Curved Shadows on Curved Surfaces"; filtering in `wgsl/shadow/lookup.wgsl`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..gpu.graph import Graph
from ..gpu.handles import Texture
from ..gpu.wgsl import load
from ..scene.draws import Draws
from .scene_inputs import SceneInputs
from .shadow_views import visible

SLOT_BITS = int(load("shadow/vertices.wgsl").constants["SLOT_BITS"])


class ShadowDraws:
    """Draws into each view the clusters that it may see; `update` tells which views and what."""

    def __init__(self) -> None:
        self.views: NDArray = np.zeros(0)
        self.draws: Draws | None = None
        self._boxes: NDArray[np.float32] = np.zeros((0, 2, 3), np.float32)
        self._shown: NDArray[np.bool_] | None = None

    def update(self, views: NDArray[np.void], draws: Draws) -> None:
        """Take other views, another scene or other places of it; what each view sees is found when it is drawn."""
        boxes = draws.clusters.boxes
        same = draws is self.draws and np.array_equal(boxes, self._boxes)
        if not same or views.tobytes() != self.views.tobytes():
            self.views, self.draws, self._boxes, self._shown = views, draws, boxes, None

    def record(self, encoder: Any, masked: bool) -> None:
        """Record the draws of all views."""
        assert self.draws is not None
        clusters = self.draws.clusters
        if self._shown is None:
            self._shown = visible(self.views, self._boxes)
        everything = self.draws.masked if masked else self.draws.opaque
        for number, view in enumerate(self.views):
            shown = self._shown[number]
            runs = list(everything) if shown.all() else clusters.visible(shown, masked)
            if not runs:
                continue
            (x, y), (width, height) = view["corner"].tolist(), view["size"].tolist()
            encoder.set_viewport(x, y, width, height, 0, 1)
            for first, count, slot, instances in runs:
                encoder.draw_indexed(count, instances, first, 0, number << SLOT_BITS | slot)


@dataclass(frozen=True)
class ShadowPart:
    """The opaque or the alpha-masked half of a renderer's shadow draws."""

    draws: ShadowDraws
    masked: bool

    def __call__(self, encoder: Any) -> None:
        """Record the draws."""
        self.draws.record(encoder, self.masked)


def declare_shadow_maps(graph: Graph, scene: SceneInputs, draws: ShadowDraws) -> Texture | None:
    """Declare the atlas of all shadow views, depth reversed; None where there are none."""
    assert scene.draws is not None and scene.direct is not None
    if not scene.direct.atlas_size:
        graph.skip("shadow/opaque", "no light casts shadows")
        return None
    size = scene.direct.atlas_size
    atlas = graph.texture("shadow/atlas", "depth32float", size=(size, size))
    for part, masked in (("opaque", False), ("masked", True)):
        if masked and not scene.draws.masked:
            graph.skip("shadow/masked", "no alpha-masked material")
            continue
        shader = "shadow/masked.wgsl" if masked else "shadow/map.wgsl"
        graph.raster(
            f"shadow/{part}",
            shader,
            draw=ShadowPart(draws, masked),
            index=scene.raster_indices,
            depth=atlas,
            reads={**scene.surfaces, **scene.raster, "shadow_views": scene.direct.views},
            constants=scene.constants(shader),
            load=masked,
        )
    return atlas
