"""Labels beside the points of a plot, where they cover neither one another nor a point."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

DISTANCE = 7.0  # of a label from its point, in typographic points
DIRECTIONS = 16  # tried at each distance: first to the right, then in turns above and below
DISTANCES = (1.0, 2.0, 3.5, 5.0)  # tried in turn, in units of DISTANCE
POINT_SIZE = 3.0  # half the size of a mark that labels must not cover


class Label(NamedTuple):
    """A text at a point of the data."""

    text: str
    x: float
    y: float
    color: str


def place_labels(
    panel: Any, labels: Sequence[Label], points: Sequence[tuple[float, float]], size: str = "small"
) -> None:
    """Write `labels` into a matplotlib panel whose limits are final, each near its point; `points` are kept free.

    The first place that is free is taken, else the first of all. A label far from its point gets a line to it.
    """
    figure = panel.figure
    figure.draw_without_rendering()  # lays out the panels, so that texts have places
    unit = figure.dpi / 72.0
    frame = panel.get_window_extent()
    mark = POINT_SIZE * unit, POINT_SIZE * unit
    taken = [_box(panel.transData.transform(point), mark) for point in points]
    for label in labels:
        text = panel.annotate(label.text, (label.x, label.y), (0, 0), textcoords="offset points", color=label.color)
        text.set_fontsize(size)
        extent = text.get_window_extent()
        half = extent.width / 2 + unit, extent.height / 2
        anchor = panel.transData.transform((label.x, label.y))
        places = [(anchor + offset * unit, offset, far) for offset, far in _offsets(half, unit)]
        boxes = [(_box(place, half), offset, far) for place, offset, far in places]
        free = [found for found in boxes if _is_inside(found[0], frame) and not _touches(found[0], taken)]
        box, offset, far = (free or boxes)[0]
        taken.append(box)
        text.set(position=tuple(offset), ha="center", va="center")
        if far and free:
            line = {"arrowstyle": "-", "color": label.color, "linewidth": 0.5, "shrinkA": 0, "shrinkB": 3}
            end = offset * np.maximum(1 - half[1] / unit / max(float(np.hypot(*offset)), 1e-6), 0)
            panel.annotate("", (label.x, label.y), tuple(end), textcoords="offset points", arrowprops=line)


def _offsets(half: tuple[float, float], unit: float) -> list[tuple[NDArray[np.float64], bool]]:
    """Return the centres of a label relative to its point, in typographic points, and whether they are far from it."""
    turns = [0.0] + [sign * step / DIRECTIONS for step in range(1, DIRECTIONS // 2 + 1) for sign in (1, -1)]
    found = []
    for number, distance in enumerate(DISTANCES):
        for turn in turns:
            direction = np.array([np.cos(2 * np.pi * turn), np.sin(2 * np.pi * turn)])
            found.append((direction * (DISTANCE * distance + np.array(half) / unit), number > 0))
    return found


def _box(centre: NDArray[np.float64], half: tuple[float, float]) -> tuple[float, float, float, float]:
    """Return the left, lower, right and upper end of a box of which `half` is half the width and height."""
    (x, y), (width, height) = centre, half
    return float(x - width), float(y - height), float(x + width), float(y + height)


def _touches(box: tuple[float, ...], others: Sequence[tuple[float, ...]]) -> bool:
    return any(box[0] < o[2] and o[0] < box[2] and box[1] < o[3] and o[1] < box[3] for o in others)


def _is_inside(box: tuple[float, ...], frame: Any) -> bool:
    return bool(frame.x0 <= box[0] and box[2] <= frame.x1 and frame.y0 <= box[1] and box[3] <= frame.y1)
