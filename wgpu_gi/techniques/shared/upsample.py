"""Light of a coarse grid for every pixel of the picture, and which pixels the grid does not represent.

Kopf et al. 2007, "Joint Bilateral Upsampling". Departures: the guide is not a picture but the surfaces: the distance
from the pixel's tangent plane and the angle of normals; weights are found once and kept in 8 bits each, for all light
that goes through the same grid; pixels whose surface no coarse pixel shows are listed, and techniques compute those at
full resolution (as Nichols and Wyman 2009, "Multiresolution Splatting for Indirect Illumination", refine where depths
and normals break off).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...gpu.formats import FOUR_FLOATS
from ...gpu.graph import Graph
from ...gpu.handles import Buffer, Resource
from .gbuffer import Gbuffer
from .scene_inputs import SceneInputs

SHADER = "shared/upsample/upsample.wgsl"


@dataclass(frozen=True)
class Guide:
    """How coarse pixels, `stride` pixels apart, count for each pixel of the picture.

    A coarse pixel lies at the centre of its square if `centred`, else at its first pixel. weights: four of 8 bits per
    pixel. unrepresented: indices of pixels; `room` at most. groups: workgroups that go through them; their number last.
    """

    stride: int
    centred: bool
    weights: Buffer
    unrepresented: Buffer
    groups: Buffer

    @property
    def room(self) -> int:
        """How many pixels can be unrepresented."""
        return self.unrepresented.count

    @property
    def list_reads(self) -> dict[str, Resource]:
        """What passes over the unrepresented pixels read, those that import `shared/upsample/unrepresented.wgsl`."""
        return {"unrepresented": self.unrepresented, "unrepresented_groups": self.groups}

    @property
    def constants(self) -> dict[str, float]:
        """Those of `wgsl/shared/upsample/weights.wgsl`."""
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
    coarse = -(-width // stride) * -(-height // stride)
    # Of each square one pixel is the coarse one's own, so the list is shorter than the picture by their number.
    room = max(width * height - coarse, 1)
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
    """Declare `coarse` light (r, g, b, -) for all pixels of the picture; `reflected`: irradiance becomes radiance."""
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
