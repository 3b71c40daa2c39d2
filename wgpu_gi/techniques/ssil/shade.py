"""The indirect radiance of the picture: irradiance of the first level, denoised, upsampled, averaged, and reflected.

Soler et al. 2010, "A Deferred Shading Algorithm for Real-Time Indirect Illumination", section 4. Departures:
unrepresented pixels have their own irradiance, averaged over such pixels nearby; coats' reflections depend on the view
and are not averaged over frames (a = 0 in eq. 6).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...gpu.formats import FOUR_FLOATS
from ...gpu.graph import Graph
from ...gpu.handles import Buffer, Handle
from ..shared.bounds import ELSEWHERE, MOVES
from ..shared.denoise import GUIDED_FROM, DenoiseSettings, declare_filter
from ..shared.gbuffer import Gbuffer
from ..shared.scene_inputs import SceneInputs
from ..shared.temporal import TemporalSettings, declare_accumulate
from ..shared.upsample import Guide, declare_guide
from .levels import Levels, level_buffer

UNREPRESENTED = "ssil/denoise_unrepresented.wgsl"

# Radius of the denoiser's blur, pixels of the first level. Single frames, 160x90, one bounce, against the light of
# visible surfaces, relMSE without / 2 / 4: Cornell, point light 0.32 / 0.21 / 0.11, spot 0.25 / 0.27 / 0.54, area light
# 0.082 / 0.058 / 0.048.
BLUR = 2

STEP = 5  # pixels between neighbours of the mean over frames: half resolution and levels share noise up to there


@dataclass(frozen=True)
class Upsampling:
    """Upsampling of the first level's light to pixels of the picture.

    irradiance: gathered by unrepresented pixels at full resolution, W/m2, and 1, of the pixels of the picture; 0 of all
    others; None: unrepresented pixels keep the upsampled light.
    """

    guide: Guide
    irradiance: Buffer | None


def declare_guides(graph: Graph, levels: Levels, unrepresented: bool) -> Upsampling | None:
    """Declare the upsampling from the first level to the picture; None if the first level is the picture."""
    if not unrepresented or levels.first == 0:
        reason = "gathering starts at full resolution" if unrepresented else "ssil.unrepresented is off"
        graph.skip("ssil/unrepresented", reason, ELSEWHERE)
    if levels.first == 0:
        return None
    reads = {"surfels": levels.surfels[0], "coarse_surfels": levels.receivers}
    guide = declare_guide(graph, "ssil", reads, stride=1 << levels.first, centred=True)
    if not unrepresented:
        return Upsampling(guide, None)
    return Upsampling(guide, _picture_buffer(graph, "ssil/unrepresented_irradiance"))


def _picture_buffer(graph: Graph, name: str) -> Buffer:
    """Declare (r, g, b, 1) per pixel of the picture."""
    width, height = graph.size
    return graph.buffer(name, dtype=FOUR_FLOATS, count=width * height, width=width, nonnegative=True)


def declare_denoised(
    graph: Graph, settings: DenoiseSettings, gbuffer: Gbuffer, levels: Levels, irradiance: Buffer, frames: int
) -> Buffer:
    """Declare the denoised irradiance of the first level, W/m2; `frames`: number per still picture."""
    stride = 1 << levels.first
    if not settings.levels:
        graph.skip("ssil/denoise_input", "denoise.levels is 0", MOVES)
        return irradiance
    width, height = levels.size
    light = level_buffer(graph, "ssil/denoise_input", levels.size)
    normals = graph.buffer("ssil/denoise_normals", dtype=np.uint32, count=width * height, width=width)
    graph.compute(
        "ssil/denoise_input",
        "ssil/denoise_input.wgsl",
        over=levels.receivers,
        reads={"surfels": levels.receivers, "irradiance": irradiance},
        writes={"light": light, "normals": normals},
        constants={"STRIDE": stride},
    )
    return declare_filter(
        graph, "ssil/denoise", gbuffer, light, normals, BLUR, settings.levels, frames=frames, stride=stride
    ).light


def declare_denoised_unrepresented(
    graph: Graph, settings: DenoiseSettings, levels: Levels, fine: Upsampling | None, frames: int
) -> Upsampling | None:
    """Declare the denoised irradiance of unrepresented pixels; `frames`: number per still picture."""
    if fine is None or fine.irradiance is None:
        return fine
    if not settings.levels:
        graph.skip("ssil/denoise_unrepresented", "denoise.levels is 0", MOVES)
        return fine
    guided = frames > GUIDED_FROM
    moments: Handle = graph.neutral("buffer")
    if guided:
        moments = _picture_buffer(graph, "ssil/unrepresented_moments")
        graph.compute(
            "ssil/unrepresented_moments",
            UNREPRESENTED,
            entry="find_moments",
            over=graph.size,
            reads={"irradiance": fine.irradiance},
            writes={"moments": moments},
        )
    else:
        graph.skip("ssil/unrepresented_moments", "the picture has too few frames", MOVES)
    denoised = _picture_buffer(graph, "ssil/denoised_unrepresented")
    graph.compute(
        "ssil/denoise_unrepresented",
        UNREPRESENTED,
        entry="listed",
        indirect=fine.guide.groups,
        reads={
            **fine.guide.list_reads,
            "surfels": levels.surfels[0],
            "irradiance": fine.irradiance,
            "known_moments": moments,
        },
        writes={"denoised": denoised},
        constants={"GUIDED": guided},
    )
    return Upsampling(fine.guide, denoised)


def declare_shading(
    graph: Graph,
    temporal: TemporalSettings,
    scene: SceneInputs,
    gbuffer: Gbuffer,
    motion: Buffer,
    levels: Levels,
    irradiance: Buffer,
    glossy: Buffer | None,
    fine: Upsampling | None,
) -> Buffer:
    """Declare the picture's indirect radiance, W/(m2 sr).

    It is made from the `irradiance` of the first level, W/m2, and, if given, the reflection of coats over their tint,
    `glossy`, of all pixels.
    """
    if temporal.frames == 1:
        graph.skip("temporal/accumulate", "temporal.frames is 1", MOVES)
        return _declare_full(graph, scene, gbuffer, levels, irradiance, "indirect", glossy, fine, {})
    full = _declare_full(graph, scene, gbuffer, levels, irradiance, "irradiance", None, fine, {"REFLECTED": False})
    mean = declare_accumulate(graph, temporal, scene, gbuffer, motion, full, step=STEP).averaged
    if glossy is not None:
        coats = declare_accumulate(
            graph, temporal, scene, gbuffer, motion, glossy, "temporal/glossy", step=STEP, coat=True
        )
        glossy = coats.averaged
    return _declare_full(graph, scene, gbuffer, levels, mean, "indirect", glossy, fine, {"UPSAMPLED": True})


def _declare_full(
    graph: Graph,
    scene: SceneInputs,
    gbuffer: Gbuffer,
    levels: Levels,
    coarse: Buffer,
    name: str,
    glossy: Buffer | None,
    fine: Upsampling | None,
    variant: dict[str, bool],
) -> Buffer:
    """Declare the irradiance or the radiance of the picture from `coarse` irradiance; `variant`: constants."""
    width, height = graph.size
    full = _picture_buffer(graph, f"ssil/{name}")
    shader = "ssil/shade.wgsl"
    reads = {
        "surfaces": gbuffer.surfaces,
        "distance": gbuffer.distance,
        "guide": graph.neutral("buffer") if fine is None else fine.guide.weights,
        "coarse": coarse,
        "glossy": graph.neutral("buffer") if glossy is None else glossy,
    }
    constants: dict[str, float] = {
        **scene.constants(shader),
        **({"COARSE_STRIDE": 1} if fine is None else fine.guide.constants),
        "HAS_GLOSSY": glossy is not None,
        **variant,
    }
    graph.compute(f"ssil/{name}", shader, over=(width, height), reads=reads, writes={"full": full}, constants=constants)
    if fine is not None and fine.irradiance is not None and not variant.get("UPSAMPLED"):
        graph.compute(
            f"ssil/{name}_unrepresented",
            shader,
            entry="listed",
            indirect=fine.guide.groups,
            reads={**reads, **fine.guide.list_reads, "unrepresented_irradiance": fine.irradiance},
            writes={"full": full},
            constants=constants,
        )
    return full
