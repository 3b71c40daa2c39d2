"""Frustum culling on the CPU, for cameras and lights: finds the clusters of the draw list that each view may see.

Assarsson and Moller 2000, "Optimized View Frustum Culling Algorithms for Bounding Boxes": a box lies outside if its
farthest corner along a plane's normal does. Draws keep the order of the index buffer, so coplanar surfaces look the
same from everywhere; drawing Sponza from near to far saves no time.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...gpu.draw_calls import DrawCalls
from ...gpu.handles import Uniform
from ...upload.draw_list import DrawCall, DrawList
from ...upload.scene_upload import SceneUpload

SLACK = 4e-6  # error of a sum over its absolute terms: 67 float32 roundings; this code and the shaders make ten

# Planes of clip space: -w <= x <= w, -w <= y <= w, 0 <= z <= w.
LEFT, RIGHT, BOTTOM, TOP = range(4)
SIDES = np.array(
    [(1, 0, 0, 1), (-1, 0, 0, 1), (0, 1, 0, 1), (0, -1, 0, 1), (0, 0, 1, 0), (0, 0, -1, 1)],
    np.float64,
)


def frustum_planes(records: NDArray[np.void]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the planes of v views, (v, 6, 4), and error bounds, (v, 6, 4): sums of absolute terms.

    A point lies in a view if plane . (x, y, z, 1) >= 0 for all of its planes.
    """
    rows = records["clip_from_world"].astype(np.float64).transpose(0, 2, 1)
    sides = np.tile(SIDES, (len(records), 1, 1))
    if "whole" in (records.dtype.names or ()):
        # A camera may show a window of its picture; y points up.
        low = 2.0 * records["corner"] / records["whole"] - 1.0
        high = 2.0 * (records["corner"] + records["size"]) / records["whole"] - 1.0
        sides[:, LEFT, 3], sides[:, RIGHT, 3] = -low[:, 0], high[:, 0]
        sides[:, BOTTOM, 3], sides[:, TOP, 3] = high[:, 1], -low[:, 1]
    return sides @ rows, np.abs(sides) @ np.abs(rows)


def visible(records: NDArray[np.void], boxes: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Return whether each of v views with a `clip_from_world` may see each box (c, 2, 3), metres: (v, c).

    Conservative: boxes just outside are kept, so rounding in the shaders loses none.
    """
    return reaches_inside(*frustum_planes(records), boxes)


def reaches_inside(
    planes: NDArray[np.float64], sizes: NDArray[np.float64], boxes: NDArray[np.float32]
) -> NDArray[np.bool_]:
    """Return whether each box (c, 2, 3) reaches to the inner side of all planes of each of v views: (v, c).

    planes (v, p, 4) and sizes (v, p, 4) as from `frustum_planes`.
    """
    low, high = boxes[:, 0].T, boxes[:, 1].T
    # Per box: twice the middle, the size, the largest absolute coordinates, and 2; in float32 for speed.
    corners = np.empty((10, len(boxes)), np.float32)
    np.add(low, high, out=corners[:3])
    np.subtract(high, low, out=corners[3:6])
    np.maximum(-low, high, out=corners[6:9])
    corners[9] = 2.0
    offsets = planes[..., 3:] + SLACK * sizes[..., 3:]
    terms = np.concatenate([planes[..., :3], np.abs(planes[..., :3]), 2 * SLACK * sizes[..., :3], offsets], 2)
    terms = terms.astype(np.float32)
    shown = terms[:, 0] @ corners >= 0
    for k in range(1, planes.shape[1]):
        shown &= terms[:, k] @ corners >= 0
    return shown


class ViewCulling:
    """The visible draws of several views: computed on demand, kept while views and boxes do not change."""

    def __init__(self) -> None:
        self.views: NDArray = np.zeros(0)
        self.draws: DrawList | None = None
        self.boxes: NDArray[np.float32] = np.zeros((0, 2, 3), np.float32)
        self._shown: NDArray[np.bool_] | None = None
        self._runs: dict[bool, list[list[DrawCall]]] = {}
        self._calls = {False: DrawCalls(), True: DrawCalls()}  # of the first view
        self._stale = set(self._calls)

    def update(self, views: NDArray[np.void], draws: DrawList) -> bool:
        """Set the views and the draw list; return whether anything changed."""
        boxes = draws.clusters.boxes
        same = draws is self.draws and (boxes is self.boxes or np.array_equal(boxes, self.boxes))
        if same and views.tobytes() == self.views.tobytes():
            return False
        self.views, self.draws, self.boxes, self._shown, self._runs = views, draws, boxes, None, {}
        self._stale = set(self._calls)
        return True

    def runs(self, masked: bool, chosen: NDArray[np.bool_] | None = None) -> list[list[DrawCall]]:
        """Return the draw calls of each view, opaque or alpha-masked; `chosen` (v, c): the clusters to draw at most."""
        assert self.draws is not None
        if self._shown is None:
            self._shown = visible(self.views, self.boxes)
        if chosen is not None:
            return [self.draws.visible(shown, masked) for shown in self._shown & chosen]
        if masked not in self._runs:
            self._runs[masked] = [self.draws.visible(shown, masked) for shown in self._shown]
        return self._runs[masked]

    def calls(self, masked: bool) -> DrawCalls:
        """Return the draw calls of the first view."""
        if masked in self._stale:
            self._stale.remove(masked)
            runs = self.runs(masked)[0]
            self._calls[masked].set([(count, instances, first, 0, slot) for first, count, slot, instances in runs])
        return self._calls[masked]


@dataclass(frozen=True)
class CameraDraws:
    """Draws the clusters that the camera in a uniform may see when the pass runs.

    Passes that draw for the same camera share `culling`. `pixels`: further pixels of the whole picture to draw.
    """

    view: Uniform
    upload: SceneUpload
    masked: bool
    culling: ViewCulling = field(compare=False)
    pixels: tuple[tuple[int, int], ...] = ()
    pixel_culling: ViewCulling = field(default_factory=ViewCulling, compare=False)

    def __call__(self, encoder: Any) -> None:
        """Record the draws."""
        assert self.upload.draws is not None
        views = np.frombuffer(self.view.data, self.view.dtype)
        self.culling.update(views, self.upload.draws)
        if (views["whole"] != views["size"]).any():
            # The target is that of the whole picture, so that rasterisation rounds alike in all of its windows.
            encoder.set_scissor_rect(*views["corner"][0].tolist(), *views["size"][0].tolist())
        encoder.draw_all(self.culling.calls(self.masked))
        if not self.pixels:
            return
        # Draw the other pixels, each by a window of its own.
        windows = np.repeat(views, len(self.pixels))
        windows["corner"], windows["size"] = self.pixels, 1
        self.pixel_culling.update(windows, self.upload.draws)
        for pixel, runs in zip(self.pixels, self.pixel_culling.runs(self.masked), strict=True):
            encoder.set_scissor_rect(*pixel, 1, 1)
            for first, count, slot, instances in runs:
                encoder.draw_indexed(count, instances, first, 0, slot)
