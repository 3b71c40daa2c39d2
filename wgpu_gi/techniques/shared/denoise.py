"""An edge-aware blur: removes noise and the pattern of interleaved sampling, and converts irradiance to radiance.

The geometry-aware blur of Linke 2016, "Design and Implementation of a Many-Light Method for Real-Time Dynamic Global
Illumination". Departures: depths are compared with the pixel's tangent plane, in pixel widths; taps beyond the picture
wrap back by the period; from the third frame of a still picture on, pixels whose mean light differs by more than its
noise are not averaged (variances of single pixels tell detail from noise, after Rousselle et al. 2012, "Adaptive
Rendering with Non-Local Means Filtering").
"""

from __future__ import annotations

from functools import partial

from ...gpu.formats import FOUR_FLOATS, TWO_FLOATS
from ...gpu.graph import Graph
from ...gpu.handles import Buffer, Handle
from ...gpu.wgsl.load import load
from .gbuffer import Gbuffer

SHADER = "shared/denoise/blur.wgsl"
GUIDED_FROM = int(load(SHADER).constants["GUIDED_FROM"])


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
    coat_lobes: bool = False,
    glossy: Buffer | None = None,
    reflected: bool = False,
    variances: Buffer | None = None,
    stride: int = 1,
    view: str = "view",
) -> Buffer:
    """Declare the average of `light` over squares of `radius` pixels: rows first, then columns.

    light: (r, g, b, depth of `shared/denoise/plane.wgsl`) per pixel. normals: packed by that file. reflected: light is
    irradiance, W/m2, `glossy` the coats' light, and the result is radiance, W/(m2 sr); otherwise light is divided by
    the average of `glossy`, if given. variances: of the luminance of `light`; then only first frames of still pictures
    are blurred. shares: light is a share, 0 to 1. lobes, coat_lobes: blur `light` or `glossy` by no more than the
    coats' lobes. frames: number per still picture. stride: distance of the grid's pixels; above 1, not with
    `reflected`. view: uniform of the picture's camera.
    """
    width, height = (-(-side // stride) for side in graph.size)
    guided = radius > 1 and (variances is not None or frames > GUIDED_FROM)
    guide = _declare_guide(graph, name, light, normals, variances, (width, height), stride, view, guided)
    layer = partial(graph.buffer, dtype=FOUR_FLOATS, count=light.count, width=width, nonnegative=True)
    nothing, absent = graph.buffer(f"{name}/nothing", dtype=FOUR_FLOATS, count=1), graph.neutral("buffer")
    reads = {"normals": normals, "surfaces": gbuffer.surfaces, "moments": guide}
    flags = dict(SHARES=shares, LOBES=lobes, COAT_LOBES=coat_lobes, HAS_COATS=glossy is not None)
    constants = {"RADIUS": radius, "STRIDE": stride, "GUIDED": guided, "FIRST": variances is not None, **flags}
    rows, glossy_rows, uniforms = light, glossy, {"view": view}
    if radius > 1:
        rows, glossy_rows = layer(f"{name}/rows"), layer(f"{name}/glossy_rows") if glossy else None
        graph.compute(
            f"{name}/rows",
            SHADER,
            over=(-(-width // 4), height),
            reads={"light": light, "glossy": glossy or absent, **reads},
            writes={"blurred": rows, "blurred_glossy": glossy_rows or nothing},
            constants=constants,
            uniforms=uniforms,
        )
    else:
        graph.skip(f"{name}/rows", "nothing is blurred")
    blurred = layer(f"{name}/columns")
    graph.compute(
        f"{name}/columns",
        SHADER,
        over=(width, -(-height // 4)),
        reads={"light": rows, "glossy": glossy_rows or absent, **reads},
        writes={"blurred": blurred, "blurred_glossy": nothing},
        constants={**constants, "VERTICAL": True, "LAST": reflected, "RATIO": glossy is not None and not reflected},
        uniforms=uniforms,
    )
    return blurred


def _declare_guide(
    graph: Graph,
    name: str,
    light: Buffer,
    normals: Buffer,
    variances: Buffer | None,
    size: tuple[int, int],
    stride: int,
    view: str,
    guided: bool,
) -> Handle:
    """Declare mean light and its variance: over the frames of a still picture, or of neighbours within one frame."""
    if variances is None:
        return _declare_moments(graph, name, light, size, stride, view, guided)
    return _declare_neighbours(graph, name, light, normals, variances, view)


def _declare_neighbours(
    graph: Graph, name: str, light: Buffer, normals: Buffer, variances: Buffer, view: str
) -> Buffer:
    """Declare the mean luminance of each pixel and its neighbours, and the variance of that mean."""
    guide = graph.buffer(f"{name}/guide", dtype=TWO_FLOATS, count=light.count, width=graph.size[0])
    graph.compute(
        f"{name}/guide",
        "shared/denoise/neighbours.wgsl",
        over=graph.size,
        reads={"light": light, "normals": normals, "variances": variances},
        writes={"guide": guide},
        uniforms={"view": view},
    )
    return guide


def _declare_moments(
    graph: Graph, name: str, light: Buffer, size: tuple[int, int], stride: int, view: str, guided: bool
) -> Handle:
    """Declare each pixel's mean luminance and mean squared luminance over the frames of a still picture."""
    if not guided:
        graph.skip(f"{name}/moments", "nothing is blurred, or the picture has too few frames")
        return graph.neutral("buffer")
    moments = graph.buffer(f"{name}/moments", dtype=TWO_FLOATS, count=light.count, width=size[0])
    graph.compute(
        f"{name}/moments",
        "shared/denoise/moments.wgsl",
        over=size,
        reads={"light": light},
        writes={"moments": moments},
        constants={"STRIDE": stride},
        uniforms={"view": view},
    )
    return moments
