"""Reports of `wgpu-gi bench --attribute`: tables and sentences for the terminal, a JSON file, a plot.

The plot has a row for each technique: the picture, and stacked bars of the parts in percent of the whole error, which
stands beside each bar. Solid: noise; hatched: squared bias. Parts that an exchange makes larger lie left of 0.
"""

from __future__ import annotations

import importlib
import json
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from typing import Any

from rich.table import Table

from ..options import TECHNIQUES, Settings
from ..pictures.atomic_file import atomic_file
from ..pictures.color import srgb_from_linear
from .attribute import Attribution
from .attribute_raise import Raise, best
from .attribute_study import REMAINDER, Bar, Part
from .metrics import display_scale
from .plot import COLORS, DOTS_PER_INCH, require_matplotlib

SCHEMA, VERSION = "wgpu_gi.attribution", 1
LAYERS = {"full": "full image", "indirect": "indirect part"}
ALL_BOUNCES = [name for name, technique in TECHNIQUES.items() if technique.bounces_found(Settings()) is None]
BAR_CELLS = 20  # characters of 100 % in the terminal
ROW_INCHES = (12.0, 3.4)
MOST_FLOOR = 0.1  # of the error: a noisier truth has pixels too dark, which weigh too much
PALETTE = (*COLORS, "#f0e442", "#44546a", "#999933")  # as many as a technique has stages, and more
LABEL_SHARE = 0.06  # narrower parts have no label in the plot; the table has them all


@dataclass(frozen=True)
class Entry:
    """The attribution of one technique in one scene."""

    scene: str
    gi: str
    quality: str
    size: tuple[int, int]
    found: Attribution

    @property
    def title(self) -> str:
        """Scene, size, technique and quality, in words."""
        return f"{self.scene}, {self.size[0]}x{self.size[1]}: {self.gi}, {self.quality}"


def save_json(path: str | Path, machine: dict[str, Any], entries: list[Entry]) -> None:
    """Write all numbers; errors are parts of relMSE, times milliseconds. Raises GiError if it cannot be written."""
    document = {"schema": SCHEMA, "version": VERSION, "machine": machine, "entries": [_as_dict(e) for e in entries]}
    with atomic_file(path) as temporary:
        temporary.write_text(json.dumps(document, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def _as_dict(entry: Entry) -> dict[str, Any]:
    return {
        "scene": entry.scene,
        "gi": entry.gi,
        "quality": entry.quality,
        "size": entry.size,
        "frame_ms": entry.found.frame_ms,
        "bars": [
            {
                "layer": bar.layer,
                "frames": bar.frames,
                "whole": vars(bar.whole),
                "parts": [{"name": part.name, **vars(part.split)} for part in bar.parts],
            }
            for bar in entry.found.bars
        ],
        "raises": [
            {
                "setting": one.setting,
                "stage": one.stage,
                "time": one.time,
                "errors": {str(frames): vars(split) for frames, split in one.errors.items()},
            }
            for one in entry.found.raises
        ],
    }


def tables(entry: Entry) -> list[tuple[str, Table]]:
    """Return a table for each bar, and one of the settings that were tried, each with its title."""
    found = [(_bar_title(entry, bar), _bar_table(bar)) for bar in entry.found.bars]
    if entry.found.raises:
        layer = LAYERS[entry.found.bars[0].layer]
        found.append((f"{entry.title}: settings for the largest parts, {layer}", _raise_table(entry.found)))
    return found


def advice(entry: Entry) -> list[str]:
    """Return a sentence for each kind of picture: which setting to raise, and what it costs.

    More if the truth is noisy.
    """
    bars = entry.found.bars
    sentences = [_advice(bar, entry.found.raises) for bar in bars if bar.layer == bars[0].layer]
    sentences += [
        f"{_picture(bar)}, {LAYERS[bar.layer]}: no error exceeds the noise of the truth; raise --truth-spp"
        for bar in entry.found.hidden
    ]
    noisy = [bar for bar in bars if (bar.floor or 0.0) > MOST_FLOOR * bar.whole.total]
    if noisy:
        worst = max(noisy, key=lambda bar: (bar.floor or 0.0) / max(bar.whole.total, 1e-12))
        sentences.append(
            f"the truth is noisy: its own relMSE is {worst.floor:.2g} in {LAYERS[worst.layer]}, so squared bias and"
            " remainder come out too large; raise --truth-spp"
        )
    return sentences


def _advice(bar: Bar, raises: list[Raise]) -> str:
    picture, whole = _picture(bar), bar.whole.total
    one = best(raises, bar)
    if one is not None:
        after = one.errors[bar.frames].total
        return (
            f"{picture}: {one.setting} lowers relMSE from {whole:.3g} to {after:.3g} for {one.time:.2g} times the time"
        )
    largest = max(bar.parts, key=lambda part: part.split.total)
    share = f"{largest.name} is {_percent(largest, bar)} of the error"
    if largest.stage is not None and largest.stage.kind == "bounces":
        share += f", and {' and '.join(ALL_BOUNCES)} find all of them"
    return f"{picture}: no setting that was tried lowers relMSE, {whole:.3g}, for sure; {share}"


def _picture(bar: Bar) -> str:
    return "a single frame" if bar.frames == 1 else f"a still picture of {bar.frames} frames"


def _bar_title(entry: Entry, bar: Bar) -> str:
    whole = f"relMSE {bar.whole.total:.4g} +- {bar.whole.error:.1g}"
    return f"{entry.title}, {_picture(bar)}, {LAYERS[bar.layer]}: {whole}"


def _bar_table(bar: Bar) -> Table:
    table = Table("due to", box=None, pad_edge=False)
    for column in ("share", "noise", "squared bias", "+-"):
        table.add_column(column, justify="right")
    table.add_column("")
    for part in bar.parts:
        split = part.split
        cells = max(0, round(BAR_CELLS * split.total / bar.whole.total))
        table.add_row(
            part.name, _percent(part, bar), f"{split.noise:.5f}", f"{split.bias:.5f}", f"{split.error:.5f}", "#" * cells
        )
    whole = bar.whole
    table.add_row("sum", "100 %", f"{whole.noise:.5f}", f"{whole.bias:.5f}", f"{whole.error:.5f}", style="bold")
    return table


def _raise_table(found: Attribution) -> Table:
    bars = [bar for bar in found.bars if bar.layer == found.bars[0].layer]
    table = Table("setting", "for", box=None, pad_edge=False)
    table.add_column("time", justify="right")
    for bar in bars:
        table.add_column(f"relMSE, {_picture(bar)}", justify="right")
    table.add_row("as it is", "", "1.00 x", *(f"{bar.whole.total:.5f}" for bar in bars))
    for one in found.raises:
        errors = [one.errors.get(bar.frames) for bar in bars]
        texts = ["" if e is None else f"{e.total:.5f} +- {e.error:.5f}" for e in errors]
        table.add_row(one.setting, one.stage, f"{one.time:.2f} x", *texts)
    return table


def _percent(part: Part, bar: Bar) -> str:
    return f"{part.split.total / bar.whole.total:.0%}".replace("%", " %")


# The plot.


def save_plot(path: str | Path, entries: list[Entry]) -> None:
    """Write the pictures and their bars to a .png, .svg or .pdf. Raises GiError without matplotlib."""
    require_matplotlib()
    figure_module = importlib.import_module("matplotlib.figure")
    size = (ROW_INCHES[0], ROW_INCHES[1] * len(entries))
    figure = figure_module.Figure(figsize=size, layout="constrained")
    panels = figure.subplots(len(entries), 2, squeeze=False, width_ratios=(2, 3))
    # A part has the same colour in all rows.
    names = dict.fromkeys(part.name for entry in entries for bar in entry.found.bars for part in bar.parts)
    colors = dict(zip([name for name in names if name != REMAINDER], cycle(PALETTE), strict=False)) | {
        REMAINDER: "0.65"
    }
    for entry, (picture, chart) in zip(entries, panels, strict=True):
        radiance = entry.found.picture
        picture.imshow(srgb_from_linear(radiance * display_scale(radiance)), interpolation="nearest")
        picture.set_title(entry.title, fontsize="small")
        picture.set_axis_off()
        _draw_bars(chart, entry.found.bars, colors)
    with atomic_file(path) as temporary:
        figure.savefig(temporary, format=Path(path).suffix.lower()[1:], dpi=DOTS_PER_INCH)


def _draw_bars(chart: Any, bars: list[Bar], colors: dict[str, str]) -> None:
    """Draw a stacked bar for each layer and number of frames, the first on top."""
    names = {part.name for bar in bars for part in bar.parts}
    for row, bar in enumerate(bars):
        ends = [0.0, 0.0]  # of the parts below and above 0
        for part in bar.parts:
            for value, hatch in ((part.split.noise, ""), (part.split.bias, "////")):
                width = 100.0 * value / bar.whole.total
                side = int(width > 0)
                chart.barh(row, width, left=ends[side], color=colors[part.name], hatch=hatch, edgecolor="white")
                ends[side] += width
            width = 100.0 * part.split.total / bar.whole.total
            if width > 100.0 * LABEL_SHARE:
                label = f"{width:.0f}"
                box = {"boxstyle": "round", "facecolor": "white", "linewidth": 0.0}
                chart.text(ends[1] - width / 2, row, label, ha="center", va="center", fontsize="x-small", bbox=box)
    chart.set_yticks(range(len(bars)), [f"{_picture(b)}\n{LAYERS[b.layer]}\nrelMSE {b.whole.total:.3g}" for b in bars])
    chart.tick_params(axis="y", labelsize="x-small")
    chart.invert_yaxis()
    chart.axvline(0.0, color="black", linewidth=0.8)
    chart.set_xlabel("% of relMSE; solid: noise, hatched: squared bias", fontsize="small")
    chart.spines[["top", "right", "left"]].set_visible(False)
    patches = importlib.import_module("matplotlib.patches")
    handles = [patches.Patch(color=color, label=name) for name, color in colors.items() if name in names]
    chart.legend(
        handles=handles, loc="upper center", bbox_to_anchor=(0.5, 1.22), ncols=4, frameon=False, fontsize="x-small"
    )
