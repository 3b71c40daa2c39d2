"""Asks a scene's surfaces by rays, beside the picture: which pixels each instance would cover if it were alone.

It has a render graph of its own, so that the picture of the frame's graph and its average stay.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .gpu.device import Device
from .gpu.graph import Graph
from .techniques.reference.amodal import WORDS, declare_amodal, rows_of_band
from .techniques.shared.scene_inputs import SceneInputs, declare_deformation, share_scene
from .upload.scene_upload import SceneUpload


class SurfaceTracer:
    """Traces rays through the GPU's copy of a scene."""

    def __init__(self, device: Device) -> None:
        self.graph = Graph(device)

    def amodal(self, upload: SceneUpload, view: NDArray[np.void], instances: int) -> NDArray[np.int64]:
        """Return for each instance on the GPU how many pixels it would cover alone, and their box: (n, 5).

        Columns: pixels, x, y, width, height; the box of no pixels is 0.
        """
        width, height = size = int(view["size"][0]), int(view["size"][1])
        found = np.zeros((instances, WORDS), np.int64)
        if not instances:
            return found
        rows = rows_of_band(size, instances)
        for first in range(0, height, rows):
            scene = self._begin(upload, view)
            boxes = declare_amodal(self.graph, scene, instances, first, rows)
            self.graph.compile([boxes])
            self.graph.run(force=True)
            band = self.graph.read_back(boxes).reshape(instances, WORDS).astype(np.int64)
            found[:, 0] += band[:, 0]
            found[:, 1:] = np.maximum(found[:, 1:], band[:, 1:])
        low = np.where(found[:, :1] > 0, (width, height) - found[:, 1:3], 0)
        return np.concatenate([found[:, :1], low, found[:, 3:] - low], axis=1)

    def _begin(self, upload: SceneUpload, view: NDArray[np.void]) -> SceneInputs:
        """Begin a declaration for a view of the scene."""
        self.graph.uniform("view", view)
        scene = share_scene(self.graph, upload)
        self.graph.begin((int(view["size"][0]), int(view["size"][1])))
        declare_deformation(self.graph, scene)
        return scene
