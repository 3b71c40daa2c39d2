"""The blur that removes the pattern of interleaved gathering, aware of edges, and turns irradiance into radiance.

Linke 2016, "Design and Implementation of a Many-Light Method for Real-Time Dynamic Global Illumination", its
geometry-aware blur. Departures: depths are compared with the pixel's tangent plane, in widths of a pixel; taps beyond
the picture wrap back by the period.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..gpu.graph import Graph
from ..gpu.handles import Buffer
from ..settings import setting
from .gather import Gathered
from .gbuffer import FOUR_FLOATS, Gbuffer

SHADER = "denoise/blur.wgsl"


@dataclass
class DenoiseSettings:
    """How the light of neighbouring pixels is averaged."""

    blur: bool = setting(True, "Average over the squares of pixels that share the VPLs among them, up to edges.")


def declare_denoise(graph: Graph, settings: DenoiseSettings, gbuffer: Gbuffer, gathered: Gathered) -> Buffer:
    """Declare the indirect light: (r, g, b, 1) per pixel, W/(m2 sr)."""
    radius = gathered.interleave if settings.blur else 1
    return declare_blur(
        graph,
        "denoise",
        gbuffer,
        gathered.irradiance,
        gathered.normals,
        radius,
        glossy=gathered.glossy,
        reflected=True,
    )


def declare_blur(
    graph: Graph,
    name: str,
    gbuffer: Gbuffer,
    light: Buffer,
    normals: Buffer,
    radius: int,
    *,
    glossy: Buffer | None = None,
    reflected: bool = False,
) -> Buffer:
    """Declare the average of `light` over squares of `radius` pixels: rows first, then columns.

    Light is (r, g, b, depth of `wgsl/denoise/plane.wgsl`) per pixel, `normals` as the gathering pass leaves them. With
    `reflected` it is irradiance in W/m2, `glossy` what coats add, and both become radiance, W/(m2 sr).
    """
    width, height = graph.size
    nothing = graph.buffer(f"{name}/nothing", dtype=FOUR_FLOATS, count=1)
    has_coats = glossy is not None
    guides = {"normals": normals, "surfaces": gbuffer.surfaces}

    def layer(part: str) -> Buffer:
        return graph.buffer(f"{name}/{part}", dtype=FOUR_FLOATS, count=light.count, width=width, nonnegative=True)

    if radius > 1:
        rows, glossy_rows = layer("rows"), layer("glossy_rows") if has_coats else nothing
        graph.compute(
            f"{name}/rows",
            SHADER,
            over=(-(-width // 4), height),
            reads={"light": light, "glossy": glossy or graph.neutral("buffer"), **guides},
            writes={"blurred": rows, "blurred_glossy": glossy_rows},
            constants={"HAS_COATS": has_coats, "RADIUS": radius, "VERTICAL": False, "LAST": False},
        )
        light, glossy = rows, glossy_rows if has_coats else None
    else:
        graph.skip(f"{name}/rows", "pixels share nothing, or denoise.blur is off")
    blurred = layer("columns")
    graph.compute(
        f"{name}/columns",
        SHADER,
        over=(width, -(-height // 4)),
        reads={"light": light, "glossy": glossy or graph.neutral("buffer"), **guides},
        writes={"blurred": blurred, "blurred_glossy": nothing},
        constants={"HAS_COATS": has_coats and reflected, "RADIUS": radius, "VERTICAL": True, "LAST": reflected},
    )
    return blurred
