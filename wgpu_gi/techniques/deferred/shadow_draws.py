"""Draws of shadow maps: for each view, the clusters that it sees and that may cast shadows into the picture.

The maps stay while the camera moves, as long as they hold all casters. When the camera leaves them behind, all clusters
in their views are drawn once, so that further moves cost nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...errors import GiError
from ...gpu.draw_calls import DrawCalls
from ...upload.draw_list import DrawList
from ..shared.culling import ViewCulling
from .shadow_casters import Receivers, casters, needed_texels

Viewport = tuple[float, ...]  # x, y, width, height; least and greatest depth
Rectangle = tuple[int, ...]  # x, y, width, height


class ViewDraws(NamedTuple):
    """The draw calls of a view: a range of those of all views."""

    viewport: Viewport
    needed: Rectangle
    first: int
    calls: int


class Parts(NamedTuple):
    """What v views draw: clusters (v, c), and rectangles of the atlas (v, 4)."""

    casters: NDArray[np.bool_]
    texels: NDArray[np.int64]


def slot_bits(draws: DrawList) -> int:
    """Return the bits of an instance number that hold its slot: a multiple of four, so that pipelines rarely change."""
    return -(-(len(draws.slots) - 1).bit_length() // 4) * 4


class ShadowDraws:
    """Draws clusters into each view; `update` sets the views and the draw list.

    `version` grows when the maps lack casters, so that they are drawn again.
    """

    def __init__(self) -> None:
        self.culling = ViewCulling()
        self.version = 0
        self._calls: dict[bool, tuple[DrawCalls, list[ViewDraws]]] = {}
        self._receivers: Receivers | None = None  # that the maps are drawn for; None: for all points
        self._drawn: Parts | None = None  # for `_receivers`; None: to be found
        self._camera = b""

    def update(self, views: NDArray[np.void], draws: DrawList, receivers: Receivers | None = None) -> None:
        """Set the views, the draw list and the points that need shadows (None: all); culling runs when needed.

        Raises GiError if instance numbers cannot hold that many views.
        """
        if len(views) > 1 << (32 - slot_bits(draws)):
            raise GiError(
                f"{len(views)} shadow maps of a scene of {len(draws.slots) - 1} instances are more than can be"
                " numbered; use fewer lights or samples of emitters"
            )
        camera = b"" if receivers is None else receivers.camera.tobytes()
        if self.culling.update(views, draws):
            self._calls, self._receivers, self._drawn = {}, receivers, None
        elif camera != self._camera and self._lacks_casters(receivers):
            self._calls, self._receivers = {}, None
            self.version += 1
        self._camera = camera

    def record(self, encoder: Any, masked: bool) -> None:
        """Record the draws of all views."""
        if masked not in self._calls:
            self._calls[masked] = self._find_calls(masked)
        calls, views = self._calls[masked]
        for viewport, needed, first, count in views:
            encoder.set_viewport(*viewport)
            encoder.set_scissor_rect(*needed)
            encoder.draw_all(calls, first, count)

    def _lacks_casters(self, receivers: Receivers | None) -> bool:
        """Tell whether the maps lack clusters or texels that `receivers` need."""
        if self._receivers is None:
            return False
        if receivers is None:
            return True
        drawn, needed = self._drawn_parts(), self._find_parts(receivers, False)
        reached = [(p.texels[:, :2], p.texels[:, :2] + p.texels[:, 2:]) for p in (drawn, needed)]
        outside = (reached[1][0] < reached[0][0]) | (reached[1][1] > reached[0][1])
        return bool((needed.casters & ~drawn.casters).any() or (outside & (needed.texels[:, 2:] > 0)).any())

    def _drawn_parts(self) -> Parts:
        assert self._receivers is not None
        if self._drawn is None:
            self._drawn = self._find_parts(self._receivers, True)
        return self._drawn

    def _find_parts(self, receivers: Receivers, wide: bool) -> Parts:
        views = self.culling.views
        return Parts(casters(views, receivers, self.culling.boxes, wide), needed_texels(views, receivers, wide))

    def _find_calls(self, masked: bool) -> tuple[DrawCalls, list[ViewDraws]]:
        """Return the draw calls of all views that see any cluster."""
        assert self.culling.draws is not None
        bits = slot_bits(self.culling.draws)
        views = self.culling.views
        chosen, texels = None, np.concatenate([views["corner"], views["size"]], 1)
        if self._receivers is not None:
            drawn = self._drawn_parts()
            chosen, texels = drawn.casters, drawn.texels
        calls: list[tuple[int, int, int, int, int]] = []
        found: list[ViewDraws] = []
        for number, runs in enumerate(self.culling.runs(masked, chosen)):
            if runs and texels[number, 2:].all():
                view = views[number]
                viewport = (*view["corner"].tolist(), *view["size"].tolist(), 0.0, 1.0)
                found.append(ViewDraws(viewport, tuple(int(x) for x in texels[number]), len(calls), len(runs)))
                calls += [(n, instances, first, 0, number << bits | slot) for first, n, slot, instances in runs]
        return DrawCalls(calls), found


@dataclass(frozen=True)
class ShadowPart:
    """The opaque or the alpha-masked half of a renderer's shadow draws."""

    draws: ShadowDraws
    masked: bool

    def __call__(self, encoder: Any) -> None:
        """Record the draws."""
        self.draws.record(encoder, self.masked)
