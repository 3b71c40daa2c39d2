"""Denoising of gathered light: accumulation over frames and the edge-aware blur of interleaved sampling.

Linke 2016, section 3.4, for the blur; `shared/denoise.py` and `shared/temporal.py` name sources and departures.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

from ...gpu.graph import Graph
from ...gpu.handles import Buffer
from ..shared.denoise import DenoiseSettings, Filtered, declare_filter
from ..shared.gbuffer import Gbuffer
from ..shared.scene_inputs import SceneInputs
from ..shared.temporal import TemporalSettings, declare_accumulate
from ..shared.upsample import declare_upsampling_once
from .gather import Gathered

# Pixels between neighbours of the mean over frames: 16 of them see all virtual lights. The blur of a coarse grid
# reaches as far as the other.
STEP, COARSE_STEP = 3, 7
UNFILTERED = DenoiseSettings(radius=1, levels=0)


@dataclass
class History:
    """Accumulation of light over frames."""

    settings: TemporalSettings
    motion: Buffer

    def declare(
        self, graph: Graph, scene: SceneInputs, gbuffer: Gbuffer, gathered: Gathered, step: int
    ) -> tuple[Gathered, Buffer]:
        """Declare the means over frames of irradiance and of what coats reflect; return also the rejected shares."""
        accumulate = partial(declare_accumulate, graph, self.settings, scene, gbuffer, self.motion, step=step)
        found, glossy = accumulate(irradiance=gathered.irradiance), gathered.glossy
        if glossy is not None:
            glossy = accumulate(irradiance=glossy, name="temporal/glossy", coat=True).averaged
        return replace(gathered, irradiance=found.averaged, glossy=glossy), found.rejected


def declare_denoise(
    graph: Graph,
    settings: DenoiseSettings,
    scene: SceneInputs,
    gbuffer: Gbuffer,
    gathered: Gathered,
    frames: int,
    history: History | None = None,
) -> tuple[Buffer, Buffer | None]:
    """Declare the indirect light, averaged over frames and neighbours: (r, g, b, 1) per pixel, W/(m2 sr).

    Return it and the rejected share of each pixel's history, 0 to 1; None without a history. `frames`: number per still
    picture.
    """
    rejected = None
    if gathered.stride == 1:
        if history is not None:
            gathered, rejected = history.declare(graph, scene, gbuffer, gathered, STEP)
        return _declare_filter(graph, settings, gbuffer, gathered, frames, reflected=True).light, rejected
    # Blur light of a coarse grid before it is upsampled: the average over frames is that of all pixels.
    blurred = _declare_filter(graph, settings, gbuffer, gathered, frames, reflected=False)
    fine = declare_upsampling_once(
        graph, scene, "gather", gbuffer, blurred.light, gathered.normals, blurred.glossy, reflected=history is None
    )
    if history is None:
        return fine.light, None
    gathered = replace(gathered, irradiance=fine.light, normals=fine.normals, glossy=fine.glossy, stride=1)
    gathered, rejected = history.declare(graph, scene, gbuffer, gathered, COARSE_STEP)
    return _declare_filter(graph, UNFILTERED, gbuffer, gathered, frames, "denoise/fine", reflected=True).light, rejected


def _declare_filter(
    graph: Graph,
    settings: DenoiseSettings,
    gbuffer: Gbuffer,
    gathered: Gathered,
    frames: int,
    name: str = "denoise",
    *,
    reflected: bool,
) -> Filtered:
    """Declare the blur of irradiance; `frames`: number per still picture. `reflected`: the result is radiance."""
    return declare_filter(
        graph,
        name,
        gbuffer,
        gathered.irradiance,
        gathered.normals,
        max(settings.radius, gathered.interleave) if settings.radius > 1 else 1,
        settings.levels,
        frames=frames,
        glossy=gathered.glossy,
        reflected=reflected,
        stride=gathered.stride,
        moves=gathered.stride > 1,
    )
