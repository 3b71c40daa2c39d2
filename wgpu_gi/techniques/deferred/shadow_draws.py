"""Draws of shadow maps: for each view, the clusters of triangles that it may see."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import GiError
from ...upload.draw_list import DrawList
from ..shared.culling import ViewCulling

Viewport = tuple[float, ...]  # x, y, width, height; least and greatest depth
Call = tuple[int, ...]  # of draw_indexed


def slot_bits(draws: DrawList) -> int:
    """Return the bits of an instance number that hold its slot: a multiple of four, so that pipelines rarely change."""
    return -(-(len(draws.slots) - 1).bit_length() // 4) * 4


class ShadowDraws:
    """Draws into each view the clusters that it may see; `update` sets the views and the draw list."""

    def __init__(self) -> None:
        self.culling = ViewCulling()
        self._calls: dict[bool, list[tuple[Viewport, list[Call]]]] = {}

    def update(self, views: NDArray[np.void], draws: DrawList) -> None:
        """Set the views and the draw list; culling runs when a view is drawn.

        Raises GiError if instance numbers cannot hold that many views.
        """
        if len(views) > 1 << (32 - slot_bits(draws)):
            raise GiError(
                f"{len(views)} shadow maps of a scene of {len(draws.slots) - 1} instances are more than can be"
                " numbered; use fewer lights or samples of emitters"
            )
        if self.culling.update(views, draws):
            self._calls = {}

    def record(self, encoder: Any, masked: bool) -> None:
        """Record the draws of all views."""
        if masked not in self._calls:
            self._calls[masked] = self._find_calls(masked)
        for viewport, calls in self._calls[masked]:
            encoder.set_viewport(*viewport)
            for call in calls:
                encoder.draw_indexed(*call)

    def _find_calls(self, masked: bool) -> list[tuple[Viewport, list[Call]]]:
        """Return viewport and draw calls of each view that sees any cluster."""
        assert self.culling.draws is not None
        bits = slot_bits(self.culling.draws)
        found: list[tuple[Viewport, list[Call]]] = []
        for number, (view, runs) in enumerate(zip(self.culling.views, self.culling.runs(masked), strict=True)):
            if runs:
                numbered = ((n, instances, first, 0, number << bits | slot) for first, n, slot, instances in runs)
                found.append(((*view["corner"].tolist(), *view["size"].tolist(), 0.0, 1.0), list(numbered)))
        return found


@dataclass(frozen=True)
class ShadowPart:
    """The opaque or the alpha-masked half of a renderer's shadow draws."""

    draws: ShadowDraws
    masked: bool

    def __call__(self, encoder: Any) -> None:
        """Record the draws."""
        self.draws.record(encoder, self.masked)
