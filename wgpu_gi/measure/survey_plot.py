"""The plot of a survey: error against time, a line from the single frame to the still picture of each technique."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from ..pictures.atomic_file import atomic_file
from .direct_labels import Label, place_labels
from .plot import COLORS, DOTS_PER_INCH, MARKERS, require_matplotlib
from .ranking import LIMITS_MS, Point, ms_text
from .survey import Survey

PANEL_INCHES = (7.4, 4.8)
BLACKS = {"path": "black", "path, denoised": "0.45"}
CAPTION = "triangle: low quality, circle: medium; hollow: a single frame, filled: the still picture"


def save_survey_plot(path: str | Path, surveys: Sequence[Survey], adapter: str) -> None:
    """Plot a panel for each scene; write .png, .svg or .pdf. Both axes are logarithmic.

    Errors below the noise of the truth are drawn at a tenth of it. Raises GiError without matplotlib.
    """
    require_matplotlib()
    figure_module = importlib.import_module("matplotlib.figure")
    width, height = PANEL_INCHES
    figure = figure_module.Figure(figsize=(width, height * len(surveys)), layout="constrained")
    for panel, survey in zip(figure.subplots(len(surveys), squeeze=False).flat, surveys, strict=True):
        _draw(panel, survey, adapter)
    with atomic_file(path) as temporary:
        figure.savefig(temporary, format=Path(path).suffix.lower()[1:], dpi=DOTS_PER_INCH)


def _draw(panel: Any, survey: Survey, adapter: str) -> None:
    # Set up the axes.
    size = "{}x{}".format(*survey.size)
    panel.set_title(f"{survey.scene}, {size}, on {adapter}\n{CAPTION}", fontsize="small")
    panel.set(xscale="log", yscale="log", xlabel="time for the picture", ylabel="relMSE, less the noise of the truth")
    panel.grid(True, which="major", color="0.9", linewidth=0.8)
    panel.set_axisbelow(True)
    panel.spines[["top", "right"]].set_visible(False)
    panel.xaxis.set_major_formatter(lambda ms, _: ms_text(ms))

    # Draw a line for each technique and quality.
    names = list(dict.fromkeys(p.gi for p in survey.points))
    plain = [name for name in names if name not in BLACKS]
    colors = BLACKS | {name: COLORS[number % len(COLORS)] for number, name in enumerate(plain)}
    lowest = survey.noise / 10 or 1e-8
    drawn: list[tuple[float, float]] = []
    labels = []
    for name in names:
        of_name = [p for p in survey.points if p.gi == name]
        for quality in dict.fromkeys(p.quality for p in of_name):
            line = [(p.ms, max(p.relmse, lowest)) for p in of_name if p.quality == quality]
            _draw_line(panel, line, colors[name], quality)
            drawn += _along(line)
        labels.append(_label(of_name, colors[name], lowest))

    for limit in LIMITS_MS:
        panel.axvline(limit, color="0.6", linestyle=":", linewidth=1)

    # Label them where nothing else is.
    panel.margins(0.08, 0.1)
    place_labels(panel, labels, drawn)


def _along(line: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return points on a line, close enough together that no label fits between them."""
    logs = np.log(np.array(line))
    parts = [np.linspace(a, b, 40) for a, b in pairwise(logs)]
    return [(float(x), float(y)) for x, y in np.exp(np.concatenate([logs, *parts]))]


def _draw_line(panel: Any, line: Sequence[tuple[float, float]], color: str, quality: str) -> None:
    panel.plot(*zip(*line, strict=True), color=color, linewidth=1)
    if not quality:
        panel.plot(*zip(*line, strict=True), ".", color=color)
        return
    for number, point in enumerate(line):
        fill = color if number == len(line) - 1 else "white"
        panel.plot(*point, MARKERS[quality], color=color, markerfacecolor=fill)


def _label(points: Sequence[Point], color: str, lowest: float) -> Label:
    """Return the label of a technique, at its least error; the path tracer's says how many samples it has there."""
    best = min(points, key=lambda p: p.relmse)
    last = max(points, key=lambda p: p.ms) if not best.quality else best
    text = last.gi if last.quality else f"{last.gi}, {last.samples}"
    return Label(text, last.ms, max(last.relmse, lowest), color)
