"""The plot of a bench: error against time, a line per technique, the path tracer, and the noise of the truth."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

from ..errors import GiError
from ..pictures.atomic_file import atomic_file
from .results import PRESET, Measurement, Reference, Report, SceneReport, bounces_text

PLOT_FORMATS = (".png", ".svg", ".pdf")
LAYERS = {"full": "full image", "indirect": "indirect part"}
COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")  # Okabe and Ito 2008, for any colour vision
MARKERS = {"low": "v", "medium": "o", "high": "^"}
PANEL_INCHES = (5.2, 3.9)
DOTS_PER_INCH = 130


def require_matplotlib() -> None:
    """Raise GiError if matplotlib is not installed."""
    try:
        importlib.import_module("matplotlib.figure")
    except ImportError:
        raise GiError("plots need a package: pip install matplotlib") from None


def save_plot(path: str | Path, report: Report) -> None:
    """Plot two panels, full image and indirect part, for each scene; write .png, .svg or .pdf.

    x is the time of a frame with all moving (filled marks), of all frames that a still picture averages (hollow marks),
    or of a whole picture of the path tracer. Both axes are logarithmic; an error that is not positive is below the
    noise of the truth and is left out. With swept settings, the line connects the Pareto front. Labels mark the front
    and the preset; for still pictures the first, the last and the preset.
    """
    # Lay out the panels.
    require_matplotlib()
    figure_module = importlib.import_module("matplotlib.figure")
    rows = len(report.scenes)
    figure = figure_module.Figure(figsize=(2 * PANEL_INCHES[0], rows * PANEL_INCHES[1] + 0.5), layout="constrained")
    panels = figure.subplots(rows, len(LAYERS), squeeze=False, sharex="row")
    names = list(dict.fromkeys(m.gi for scene in report.scenes for m in scene.techniques))
    colors = {name: COLORS[number % len(COLORS)] for number, name in enumerate(names)}

    # Draw them, with one legend for all.
    for scene, row in zip(report.scenes, panels, strict=True):
        for layer, panel in zip(LAYERS, row, strict=True):
            _draw_panel(panel, scene, layer, colors)
    handles: dict[str, Any] = {}
    for panel in panels.flat:
        lines, labels = panel.get_legend_handles_labels()
        handles |= dict(zip(labels, lines, strict=True))
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=4, frameon=False)
    figure.suptitle(f"Error against time on {report.machine['adapter']}", fontsize="medium")
    with atomic_file(path) as temporary:
        figure.savefig(temporary, format=Path(path).suffix.lower()[1:], dpi=DOTS_PER_INCH)


def _draw_panel(panel: Any, scene: SceneReport, layer: str, colors: dict[str, str]) -> None:
    panel.set_title(f"{scene.scene}, {scene.size[0]}x{scene.size[1]}: {LAYERS[layer]}", fontsize="medium")
    panel.set_xscale("log")
    panel.set_yscale("log")
    panel.set_xlabel("GPU ms per frame, all moving (path tracer: per picture)")
    panel.set_ylabel("relMSE minus the noise of the truth")
    panel.grid(True, which="major", color="0.88", linewidth=0.8)
    panel.set_axisbelow(True)
    panel.spines[["top", "right"]].set_visible(False)
    for number, reference in enumerate(scene.references):
        _draw_reference(panel, reference, layer, ("--", "-.", ":")[number % 3])
    for name, color in colors.items():
        points = [(m, *_point(m, layer)) for m in scene.techniques if m.gi == name]
        _draw_technique(panel, name, color, [(m, x, y) for m, x, y in points if x > 0 and y > 0])
        _draw_settled(panel, color, layer, [m for m in scene.techniques if m.gi == name and m.settled_frames > 1])
    least, most = panel.get_xlim()
    subs = (1, 2, 5) if most < 1000 * least else (1, 3)  # more labels would touch
    panel.xaxis.set_major_locator(importlib.import_module("matplotlib.ticker").LogLocator(subs=subs))
    panel.xaxis.set_major_formatter("{x:g}")
    panel.xaxis.set_minor_formatter("")
    if not panel.lines:
        panel.text(0.5, 0.5, "nothing to measure: the truth is black", ha="center", transform=panel.transAxes)


def _draw_reference(panel: Any, reference: Reference, layer: str, style: str) -> None:
    """Draw the curve of the path tracer, with its samples per pixel at both ends, and the noise of the truth."""
    bounces = bounces_text(reference.bounces)
    curves = (("", "black", reference.curve), (" + denoiser", "0.45", reference.denoised))
    for name, color, curve in curves:
        errors = ((p, p.errors[layer]) for p in curve)
        points = [(p.spp, p.gpu_ms, e.relmse) for p, e in errors if e is not None and e.relmse > 0 and p.gpu_ms > 0]
        if points:
            _, x, y = zip(*points, strict=True)
            panel.plot(x, y, color=color, linestyle=style, marker=".", label=f"path tracer{name}, {bounces}")
            for spp, ms, error in (points[0], points[-1]):
                _annotate(panel, f"{spp} spp{name}", ms, error, color)
    noise = reference.noise[layer]
    if noise:
        panel.axhline(noise, color="0.55", linestyle=style, linewidth=1, label=f"noise of the truth, {bounces}")


def _draw_technique(panel: Any, name: str, color: str, points: list[tuple[Measurement, float, float]]) -> None:
    if not points:
        return
    swept = any(m.variant for m, _, _ in points)
    best = frontier(points) if swept else points
    panel.plot([x for _, x, _ in best], [y for _, _, y in best], color=color)
    for m, x, y in points:
        # One entry in the legend per technique.
        label = name if m is points[0][0] else None
        panel.plot(x, y, color=color, marker=MARKERS[m.quality], linestyle="-", label=label)
        if len(points) > 1 and ((m, x, y) in best or PRESET in m.variant):
            _annotate(panel, _values(m) if swept else m.quality, x, y, color)


def frontier(points: list[tuple[Measurement, float, float]]) -> list[tuple[Measurement, float, float]]:
    """Return the Pareto front of points (measurement, time, error), by time."""
    best: list[tuple[Measurement, float, float]] = []
    for point in sorted(points, key=lambda p: p[1:]):
        if not best or point[2] < best[-1][2]:
            best.append(point)
    return best


def _draw_settled(panel: Any, color: str, layer: str, measurements: list[Measurement]) -> None:
    """Draw hollow marks for still pictures, at the time of all their frames."""
    swept = any(m.variant for m in measurements)
    errors = ((m, *_point(m, layer), m.settled[layer]) for m in measurements)
    points = [(m, x, y, e.relmse) for m, x, y, e in errors if e is not None and e.relmse > 0 and x > 0 and y > 0]
    best = frontier([(m, m.settled_frames * x, settled) for m, x, _, settled in points])
    if swept:
        panel.plot([x for _, x, _ in best], [y for _, _, y in best], color=color, linestyle=":")
    for m, x, y, settled in points:
        after = m.settled_frames * x
        panel.plot(after, settled, color=color, marker=MARKERS[m.quality], markerfacecolor="white", linestyle="")
        frames = f"{m.settled_frames} frames"
        if not swept:
            panel.plot((x, after), (y, settled), color=color, linestyle=":", linewidth=1)
            _annotate(panel, frames, after, settled, color)
        elif m is best[0][0]:
            _annotate(panel, f"{_values(m)}, {frames}", after, settled, color)
        elif m is best[-1][0] or PRESET in m.variant:
            _annotate(panel, _values(m), after, settled, color)


def _values(m: Measurement) -> str:
    """Return the values of the swept settings, for a label."""
    return " ".join(text.partition("=")[2] or text for text in m.variant.split())


def _annotate(panel: Any, text: str, x: float, y: float, color: str) -> None:
    panel.annotate(text, (x, y), (5, 4), textcoords="offset points", fontsize="x-small", color=color)


def _point(m: Measurement, layer: str) -> tuple[float, float]:
    errors = m.errors[layer]
    return m.cases["all"].gpu_ms.median, 0.0 if errors is None else errors.relmse
