"""The denoiser: an edge-aware blur and a variance-guided a-trous filter; converts irradiance to radiance.

The blur removes noise and the pattern of interleaved sampling: the geometry-aware blur of Linke 2016, "Design and
Implementation of a Many-Light Method for Real-Time Dynamic Global Illumination". Departures: depths are compared with
the pixel's tangent plane, in pixel widths; taps beyond the picture wrap back by the period; from the third frame of a
still picture on, pixels whose mean light differs by more than its noise are not averaged (variances of single pixels
tell detail from noise, after Rousselle et al. 2012, "Adaptive Rendering with Non-Local Means Filtering").

The a-trous filter widens the blur where light differs by no more than its noise: Dammertz et al. 2010, "Edge-Avoiding
A-Trous Wavelet Transform for fast Global Illumination Filtering"; Schied et al. 2017, "Spatiotemporal Variance-Guided
Filtering". Departures: `wgsl/shared/denoise/atrous.wgsl` names them; the first steps are those of the blur; variance is
that over the frames of a still picture, in its first two frames that over the blur's rows.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

from ...gpu.formats import FOUR_FLOATS, TWO_FLOATS
from ...gpu.graph import Graph
from ...gpu.handles import Buffer, Handle
from ...gpu.wgsl.load import load
from ...records import KnownAttributes
from ...settings import setting
from .bounds import MOVES
from .gbuffer import Gbuffer

SHADER = "shared/denoise/blur.wgsl"
FILTER = "shared/denoise/atrous.wgsl"
GUIDED_FROM = int(load("shared/denoise/guide.wgsl").constants["GUIDED_FROM"])
# Distance of the taps of the a-trous filter's first level; it doubles with each level. A tent of half-width 4 and steps
# of 3 and 6 pixels let no pattern of period 4 through; steps of 4 and 8 keep it. tools/README.md, "Constants".
FIRST_STEP = 3


@dataclass(repr=False, slots=True)
class DenoiseSettings(KnownAttributes):
    """The denoiser of indirect light."""

    radius: int = setting(
        4,
        "With --gi many-light: radius of the edge-aware blur, at least gather.interleave; 1: no blur.",
        "pixels",
        range=(1, 8),
    )
    levels: int = setting(
        2,
        "Levels of the variance-guided a-trous filter that follows the blur, one fewer at half resolution; 0: none.",
        "levels",
        range=(0, 4),
    )


@dataclass(frozen=True)
class Filtered:
    """Filtered light, (r, g, b, depth) per pixel, or radiance; the mean luminance of the blur and its variance.

    glossy: the coats' light over their tint, W/(m2 sr), unless the light is radiance.
    """

    light: Buffer
    guide: Buffer | None
    glossy: Buffer | None = None


@dataclass(frozen=True)
class _Blurred:
    light: Buffer
    glossy: Buffer | None


def declare_blur(
    graph: Graph,
    name: str,
    gbuffer: Gbuffer,
    light: Buffer,
    normals: Buffer,
    radius: int,
    *,
    frames: int = 1,
    shares: bool = False,
    lobes: bool = False,
    glossy: Buffer | None = None,
    variances: Buffer | None = None,
    stride: int = 1,
    view: str = "view",
) -> Buffer:
    """Declare the average of `light` over squares of `radius` pixels: rows first, then columns.

    light: (r, g, b, depth of `shared/denoise/plane.wgsl`) per pixel. normals: packed by that file. glossy: its average
    divides that of `light`. variances: of the luminance of `light`; then only first frames of still pictures are
    blurred. shares: light is a share, 0 to 1. lobes: blur by no more than the coats' lobes. frames: number per still
    picture. stride: distance of the grid's pixels. view: uniform of the picture's camera.
    """
    size = grid_size(graph, stride)
    guided = radius > 1 and (variances is not None or frames > GUIDED_FROM)
    neighbours = _declare_neighbours(graph, name, light, normals, variances, stride, view, guided=guided, shares=shares)
    constants = {
        **_constants(radius, stride, guided, glossy),
        "FIRST": variances is not None,
        "LOBES": lobes,
        "RATIO": glossy is not None,
    }
    return _declare_tent(graph, name, gbuffer, size, light, normals, neighbours, None, constants, view, glossy).light


def declare_filter(
    graph: Graph,
    name: str,
    gbuffer: Gbuffer,
    light: Buffer,
    normals: Buffer,
    radius: int,
    levels: int,
    *,
    frames: int = 1,
    glossy: Buffer | None = None,
    reflected: bool = False,
    stride: int = 1,
    moves: bool = False,
) -> Filtered:
    """Declare the blur of irradiance, W/m2, over squares of `radius` pixels, and `levels` of the a-trous filter.

    A grid of stride 2 has one level fewer, for the same reach. light, normals, frames, stride: as in `declare_blur`.
    glossy: the coats' light over their tint, W/(m2 sr), blurred by no more than their lobes. reflected: the result is
    radiance, W/(m2 sr); needs a stride of 1. moves: the grid is that of `wgsl/shared/upsample/grid_pixel.wgsl`.
    """
    size = grid_size(graph, stride)
    levels = max(levels + 1 - stride.bit_length(), 0) if radius > 1 else 0
    guided = radius > 1 and frames > GUIDED_FROM
    neighbours = _declare_neighbours(graph, name, light, normals, None, stride, "view", guided=guided, moves=moves)
    guide: Buffer | None = None
    if levels:
        # Two more values per pixel are the blur's own: `blur.wgsl`.
        guide = graph.buffer(f"{name}/guide", dtype=TWO_FLOATS, count=3 * light.count, width=size[0])
    else:
        graph.skip(f"{name}/atrous", "nothing is blurred, or denoise.levels is low", MOVES)
    constants = {
        **_constants(radius, stride, guided, glossy),
        "COAT_LOBES": glossy is not None,
        "FILTERED": guide is not None,
        "LAST": reflected and guide is None,
        "MOVES": moves,
    }
    blurred = _declare_tent(graph, name, gbuffer, size, light, normals, neighbours, guide, constants, "view", glossy)
    if guide is None:
        return Filtered(blurred.light, None, blurred.glossy)
    result = _declare_levels(graph, name, gbuffer, blurred, normals, guide, levels, constants, reflected=reflected)
    return Filtered(result, guide, blurred.glossy)


def _declare_levels(
    graph: Graph,
    name: str,
    gbuffer: Gbuffer,
    blurred: _Blurred,
    normals: Buffer,
    guide: Buffer,
    levels: int,
    constants: Mapping[str, float],
    *,
    reflected: bool,
) -> Buffer:
    """Declare the levels of the a-trous filter; each reads the light and the guide of the one before."""
    light = blurred.light
    size = grid_size(graph, int(constants["STRIDE"]))
    for k in range(levels):
        found = graph.buffer(
            f"{name}/atrous_{k}", dtype=FOUR_FLOATS, count=light.count, width=size[0], nonnegative=True
        )
        after = graph.buffer(f"{name}/guide_{k}", dtype=TWO_FLOATS, count=light.count, width=size[0])
        graph.compute(
            f"{name}/atrous_{k}",
            FILTER,
            over=size,
            reads={
                "light": light,
                "normals": normals,
                "guide": guide,
                "glossy": blurred.glossy or graph.neutral("buffer"),
                "surfaces": gbuffer.surfaces,
            },
            writes={"filtered": found, "filtered_guide": after},
            constants={
                **gbuffer.constants(FILTER),
                "STEP": FIRST_STEP << k,
                "LAST": reflected and k == levels - 1,
                **{key: constants[key] for key in ("STRIDE", "MOVES", "GUIDED", "HAS_COATS")},
            },
        )
        light, guide = found, after
    return light


def grid_size(graph: Graph, stride: int) -> tuple[int, int]:
    """Return (width, height) of a grid of every `stride`-th pixel of every `stride`-th row."""
    width, height = graph.size
    return -(-width // stride), -(-height // stride)


def _constants(radius: int, stride: int, guided: bool, glossy: Buffer | None) -> dict[str, float]:
    """Return the constants of both passes of every blur."""
    return {"RADIUS": radius, "STRIDE": stride, "GUIDED": guided, "HAS_COATS": glossy is not None}


def _declare_tent(
    graph: Graph,
    name: str,
    gbuffer: Gbuffer,
    size: tuple[int, int],
    light: Buffer,
    normals: Buffer,
    neighbours: Handle,
    guide: Buffer | None,
    constants: Mapping[str, float],
    view: str,
    glossy: Buffer | None,
) -> _Blurred:
    """Declare both passes of the blur; `guide` receives that of the a-trous filter."""
    (width, height), absent = size, graph.neutral("buffer")
    layer = partial(graph.buffer, dtype=FOUR_FLOATS, count=light.count, width=width, nonnegative=True)
    nothing = graph.buffer(f"{name}/nothing", dtype=FOUR_FLOATS, count=1)
    no_guide = graph.buffer(f"{name}/no_guide", dtype=TWO_FLOATS, count=1)
    reads = {"normals": normals, "surfaces": gbuffer.surfaces, "neighbours": neighbours}
    given = {**gbuffer.constants(SHADER), **constants}
    rows, glossy_rows, uniforms = light, glossy, {"view": view}
    if constants["RADIUS"] > 1:
        rows, glossy_rows = layer(f"{name}/rows"), layer(f"{name}/glossy_rows") if glossy else None
        graph.compute(
            f"{name}/rows",
            SHADER,
            over=(-(-width // 4), height),
            reads={"light": light, "glossy": glossy or absent, **reads},
            writes={"blurred": rows, "blurred_glossy": glossy_rows or nothing, "guide": guide or no_guide},
            constants={**given, "LAST": False, "RATIO": False},
            uniforms=uniforms,
        )
    else:
        graph.skip(f"{name}/rows", "nothing is blurred", MOVES)
    blurred = layer(f"{name}/columns")
    # Ratios and radiance contain the coats' light.
    separate = glossy is not None and not (constants.get("LAST") or constants.get("RATIO"))
    kept = layer(f"{name}/glossy_columns") if separate else None
    graph.compute(
        f"{name}/columns",
        SHADER,
        over=(width, -(-height // 4)),
        reads={"light": rows, "glossy": glossy_rows or absent, **reads},
        writes={"blurred": blurred, "blurred_glossy": kept or nothing, "guide": guide or no_guide},
        constants={**given, "VERTICAL": True},
        uniforms=uniforms,
    )
    return _Blurred(blurred, kept)


def _declare_neighbours(
    graph: Graph,
    name: str,
    light: Buffer,
    normals: Buffer,
    variances: Buffer | None,
    stride: int,
    view: str,
    *,
    guided: bool,
    shares: bool = False,
    moves: bool = False,
) -> Handle:
    """Declare the guide of the blur: mean light and its variance, of each pixel and of the 3x3 pixels around it.

    They are those of the frames of a still picture so far or, given `variances`, of neighbours within one frame.
    """
    if not guided:
        graph.skip(f"{name}/moments", "nothing is blurred, or the picture has too few frames", MOVES)
        return graph.neutral("buffer")
    size, uniforms = grid_size(graph, stride), {"view": view}
    moments: Handle = graph.neutral("buffer")
    if variances is None:
        moments = graph.buffer(f"{name}/moments", dtype=TWO_FLOATS, count=light.count, width=size[0])
        graph.compute(
            f"{name}/moments",
            "shared/denoise/moments.wgsl",
            over=size,
            reads={"light": light},
            writes={"moments": moments},
            constants={"STRIDE": stride},
            uniforms=uniforms,
        )
    neighbours = graph.buffer(f"{name}/neighbours", dtype=FOUR_FLOATS, count=light.count, width=size[0])
    graph.compute(
        f"{name}/neighbours",
        "shared/denoise/neighbours.wgsl",
        over=size,
        reads={
            "light": light,
            "normals": normals,
            "variances": variances or graph.neutral("buffer"),
            "moments": moments,
        },
        writes={"neighbours": neighbours},
        constants={"FIRST": variances is not None, "SHARES": shares, "STRIDE": stride, "MOVES": moves},
        uniforms=uniforms,
    )
    return neighbours
