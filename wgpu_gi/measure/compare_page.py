"""The page of a comparison: one HTML file with both pictures, their difference, a heat map and the table of errors.

`compare_page.html` is its template. The page fetches nothing: pictures are PNG data URIs, and the values for sliders
and probe are half floats, deflated, in base64. Without scripts the four pictures and the table remain.
"""

from __future__ import annotations

import base64
import json
import math
import zlib
from html import escape
from importlib.resources import files
from io import BytesIO
from string import Template

import numpy as np
from numpy.typing import NDArray

from ..pictures.color import REC709_LUMINANCE, srgb_from_linear
from ..pictures.image import Array
from .metrics import display_scale, in_color, relative_error

Colors = tuple[tuple[int, int, int], ...]

# sRGB, evenly spaced from the lower to the upper end. DIVERGING: blue to red over a light middle, distinguishable with
# any colour vision. HEAT: nine samples of matplotlib's "magma" (CC0), whose lightness rises evenly.
DIVERGING: Colors = ((5, 48, 120), (60, 130, 210), (245, 245, 245), (225, 100, 70), (120, 10, 20))
HEAT: Colors = (
    *((0, 0, 4), (29, 17, 71), (81, 18, 124), (131, 38, 129), (183, 55, 121)),
    *((231, 82, 99), (252, 137, 97), (254, 196, 136), (252, 253, 191)),
)
HEAT_DECADES = (-3, 0)  # 0.001 to 1; fixed, so that the maps of two pages can be compared
DIFFERENCE_EXTENT = 4.0  # end of the scale in mean absolute differences: 98 % of an exponential distribution
TICKS = (-1.0, -0.5, 0.0, 0.5, 1.0)  # ticks of the difference scale, relative to its ends
SMALL_WIDTH = 800  # pixels: narrower pictures are enlarged with visible pixels


def comparison_page(
    image: tuple[str, Array], truth: tuple[str, Array], cells: list[list[str]], remarks: list[str]
) -> str:
    """Return the page as text. `image` and `truth`: name and values, (h, w, 3) or (h, w); `cells`: header and rows."""
    # Scales: exposure, difference, relative error.
    x, t = (np.asarray(values, np.float64) for _, values in (image, truth))
    scale, mean = display_scale(t), float(t.mean())
    height, width = t.shape[:2]
    difference = (in_color(x) - in_color(t)) @ REC709_LUMINANCE
    extent = rounded_up(DIFFERENCE_EXTENT * float(np.abs(difference).mean()) or mean)
    low, high = HEAT_DECADES
    decades = np.log10(np.maximum(relative_error(x, t), 10.0 ** (low - 1)))

    # The four pictures, and the numbers that the page's script needs.
    pictures = {
        "png_a": srgb_from_linear(in_color(x) * scale) * 255.0,
        "png_b": srgb_from_linear(in_color(t) * scale) * 255.0,
        "png_difference": colored(difference / (2.0 * extent) + 0.5, DIVERGING),
        "png_heat": colored((decades - low) / (high - low), HEAT),
    }
    facts = {
        "width": width,
        "height": height,
        "channels": 1 if t.ndim == 2 else 3,
        "scale": scale,
        "mean": mean,
        "extent": extent,
        "diverging": DIVERGING,
    }

    # Fill in the template.
    page = files("wgpu_gi.measure").joinpath("compare_page.html").read_text(encoding="utf-8")
    return Template(page).substitute(
        {name: png_uri(values) for name, values in pictures.items()},
        a=escape(image[0]),
        b=escape(truth[0]),
        facts=json.dumps(facts),
        half_a=packed_halves(x * scale),
        half_b=packed_halves(t * scale),
        half_difference=packed_halves(difference / extent),
        table=html_table(cells),
        remarks="".join(f"<p>{escape(remark)}</p>" for remark in remarks),
        bar_difference=color_bar(DIVERGING, [f"{part * extent:+.3g}" if part else "0" for part in TICKS]),
        bar_heat=color_bar(HEAT, [f"{10.0**decade:g}" for decade in range(low, high + 1)]),
        mean=f"{mean:.4g}",
        size=f"{width} x {height}",
        ratio=f"{width} / {height}",
        rendering="pixelated" if width < SMALL_WIDTH else "auto",
    )


def rounded_up(value: float) -> float:
    """Round a positive `value` up to 1, 2 or 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(value))
    return next(step * power for step in (1, 2, 5, 10) if step * power >= value * (1 - 1e-9))


def colored(position: NDArray[np.floating], colors: Colors) -> NDArray[np.float64]:
    """Return sRGB values 0 to 255 (h, w, 3) of positions 0 to 1 (h, w) between `colors`; clamps other positions."""
    stops = np.linspace(0.0, 1.0, len(colors))
    return np.stack([np.interp(position, stops, channel) for channel in zip(*colors, strict=True)], axis=-1)


def png_uri(values: NDArray[np.floating]) -> str:
    """Return values 0 to 255 (h, w, 3) as the data URI of a PNG."""
    from PIL import Image

    file = BytesIO()
    Image.fromarray(np.round(values).astype(np.uint8)).save(file, format="PNG")
    return "data:image/png;base64," + base64.b64encode(file.getvalue()).decode("ascii")


def packed_halves(values: NDArray[np.floating]) -> str:
    """Return values as little-endian half floats, deflated, in base64; clamps values out of range."""
    limit = float(np.finfo(np.float16).max)
    halves = np.clip(values, -limit, limit).astype("<f2")
    return base64.b64encode(zlib.compress(halves.tobytes(), 6)).decode("ascii")


def html_table(cells: list[list[str]]) -> str:
    """Return an HTML table. The first of `cells` is the header; the first column names the rows."""
    header, *rows = cells
    head = "".join(f"<th>{escape(cell)}</th>" for cell in header)
    body = "".join(
        f"<tr><th>{escape(name)}</th>{''.join(f'<td>{escape(cell)}</td>' for cell in numbers)}</tr>"
        for name, *numbers in rows
    )
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def color_bar(colors: Colors, ticks: list[str]) -> str:
    """Return a bar of the colours over evenly spaced ticks."""
    gradient = ", ".join(f"rgb{color}" for color in colors)
    labels = "".join(f"<span>{escape(tick)}</span>" for tick in ticks)
    bar = f'<div class="bar" style="background: linear-gradient(to right, {gradient})"></div>'
    return f'{bar}<div class="ticks">{labels}</div>'
