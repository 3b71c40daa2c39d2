"""Joint bilateral upsampling of a coarse grid's light, and the list of pixels that the grid does not represent.

Kopf et al. 2007, "Joint Bilateral Upsampling". Departures: the guide compares surfaces instead of colours, by the
distance from the pixel's tangent plane and the angle of normals; weights, 8 bits each, are computed once for all light
of the same grid; pixels whose surface no coarse pixel shows are listed, and techniques compute them at full resolution
(Nichols and Wyman 2009, "Multiresolution Splatting for Indirect Illumination", refine at discontinuities of depth and
normal).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from ...gpu.formats import FOUR_FLOATS
from ...gpu.graph import Graph
from ...gpu.handles import Buffer, Resource
from .gbuffer import Gbuffer
from .scene_inputs import SceneInputs

SHADER, ONCE = "shared/upsample/upsample.wgsl", "shared/upsample/planes.wgsl"


@dataclass(frozen=True)
class Upsampled:
    """Light at all pixels: radiance (r, g, b, 1), W/(m2 sr); or (r, g, b, depth), packed normals, the coats' light."""

    light: Buffer
    normals: Buffer
    glossy: Buffer | None


@dataclass(frozen=True)
class Guide:
    """Weights by which coarse pixels, `stride` pixels apart, contribute to each pixel of the picture.

    centred: True: a coarse pixel samples its square's centre; False: its first pixel. weights: four of 8 bits per
    pixel. unrepresented: indices of pixels, at most `room`. groups: workgroups over them, then their number.
    """

    stride: int
    centred: bool
    weights: Buffer
    unrepresented: Buffer
    groups: Buffer

    @property
    def room(self) -> int:
        """The largest number of unrepresented pixels."""
        return self.unrepresented.count

    @property
    def list_reads(self) -> dict[str, Resource]:
        """The bindings of passes that import `shared/upsample/unrepresented.wgsl`."""
        return {"unrepresented": self.unrepresented, "unrepresented_groups": self.groups}

    @property
    def constants(self) -> dict[str, float]:
        """The constants of `wgsl/shared/upsample/weights.wgsl`."""
        return {"COARSE_STRIDE": self.stride, "COARSE_CENTRED": self.centred}


def declare_guide(
    graph: Graph,
    technique: str,
    reads: Mapping[str, Resource],
    *,
    stride: int,
    centred: bool,
    constants: Mapping[str, float] | None = None,
) -> Guide:
    """Declare the guide of a technique: its shader `guide.wgsl` reads the surfaces of fine and of coarse pixels."""
    width, height = graph.size
    room = width * height
    guide = Guide(
        stride,
        centred,
        graph.buffer(f"{technique}/guide", dtype=np.uint32, count=width * height, width=width),
        graph.buffer(f"{technique}/unrepresented", dtype=np.uint32, count=room),
        graph.buffer(f"{technique}/unrepresented_groups", dtype=np.uint32, count=4),
    )
    graph.compute(
        f"{technique}/guide",
        f"{technique}/guide.wgsl",
        over=(width, height),
        reads=reads,
        writes={
            "guide": guide.weights,
            "unrepresented": guide.unrepresented,
            "unrepresented_groups": guide.groups,
        },
        constants={**(constants or {}), **guide.constants},
        clear=[guide.groups],
    )
    return guide


def declare_upsampling(
    graph: Graph,
    scene: SceneInputs,
    name: str,
    gbuffer: Gbuffer,
    coarse: Buffer,
    guide: Guide,
    *,
    reflected: bool,
) -> Buffer:
    """Declare `coarse` light (r, g, b, -), upsampled to all pixels; `reflected`: irradiance becomes radiance."""
    width, height = graph.size
    fine = graph.buffer(f"{name}/fine", dtype=FOUR_FLOATS, count=width * height, width=width, nonnegative=True)
    graph.compute(
        f"{name}/upsample",
        SHADER,
        over=(width, height),
        reads={"surfaces": gbuffer.surfaces, "coarse": coarse, "guide": guide.weights},
        writes={"fine": fine},
        constants={**scene.constants(SHADER), **guide.constants, "REFLECTED": reflected},
    )
    return fine


def grid_constants(stride: int) -> dict[str, float]:
    """Return the constants of `wgsl/shared/upsample/grid_pixel.wgsl`, whose grid moves from frame to frame."""
    return {"STRIDE": stride, "MOVES": stride > 1}


def declare_upsampling_once(
    graph: Graph,
    scene: SceneInputs,
    name: str,
    gbuffer: Gbuffer,
    light: Buffer,
    normals: Buffer,
    glossy: Buffer | None,
    *,
    reflected: bool,
) -> Upsampled:
    """Declare the light of a grid of stride 2 at all pixels, without a stored guide.

    light: irradiance, W/m2, with the depth of `wgsl/shared/denoise/plane.wgsl`. normals: packed by that file. glossy:
    the coats' light over their tint, W/(m2 sr). reflected: the result is radiance.
    """
    width, height = graph.size
    layer = partial(graph.buffer, dtype=FOUR_FLOATS, count=width * height, width=width, nonnegative=True)
    fine = layer(f"{name}/fine")
    fine_glossy = layer(f"{name}/fine_glossy") if glossy is not None and not reflected else None
    fine_normals = graph.buffer(f"{name}/fine_normals", dtype=np.uint32, count=1 if reflected else width * height)
    nothing = graph.buffer(f"{name}/no_glossy", dtype=FOUR_FLOATS, count=1)
    graph.compute(
        f"{name}/upsample",
        ONCE,
        over=(width // 2 + 1, height // 2 + 1),
        reads={
            "light": light,
            "normals": normals,
            "glossy": glossy or graph.neutral("buffer"),
            "surfaces": gbuffer.surfaces,
            "distance": gbuffer.distance,
        },
        writes={"fine": fine, "fine_normals": fine_normals, "fine_glossy": fine_glossy or nothing},
        constants={**scene.constants(ONCE), **grid_constants(2), "REFLECTED": reflected},
    )
    return Upsampled(fine, fine_normals, fine_glossy)
