"""The light that each level sends in a bounce: from direct light, the previous bounce or the previous frame.

Soler et al. 2010, "A Deferred Shading Algorithm for Real-Time Indirect Illumination", section 4. Departures: light is
summed over pixels, not averaged, so no energy is lost where surfaces do not survive the vote; one pass stores the light
of all levels.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...gpu.graph import Graph
from ...gpu.handles import Buffer, Texture, View
from ...gpu.wgsl.load import load
from ..shared.gbuffer import Gbuffer
from ..shared.scene_inputs import SceneInputs
from .levels import Levels
from .senders import declare_first_senders

LIGHT = np.dtype((np.uint32, 2))  # codes of wgsl/common/light_code.wgsl
TILE_THREADS = int(load("ssil/light_levels.wgsl").constants["TILE_THREADS"])


@dataclass(frozen=True)
class SentLight:
    """codes: light of all levels, W/sr, from the first on. senders: surfels of the first level that send it.

    peak: two floats, the brightest light of the bounce and the value below which the bounce is skipped.
    """

    codes: Buffer
    peak: Buffer
    senders: Texture


def declare_sent_light(
    graph: Graph,
    scene: SceneInputs,
    gbuffer: Gbuffer,
    levels: Levels,
    direct: Buffer,
    has_reflectors: bool,
    shines: Buffer | None,
    seed: int,
) -> tuple[SentLight, Buffer]:
    """Declare the light that surfaces send from `direct` light, and the reflectors.

    shines: shiny surfaces send no light here; its value becomes 1 if the picture shows one.

    A reflector is reflectance times area over pi, m2/sr: light = reflector x irradiance.

    Without `has_reflectors` the reflectors are empty.
    """
    split = shines is not None
    senders = declare_first_senders(graph, scene, gbuffer, levels, direct, seed, split=split)
    light = _light(graph, levels, senders, "", history=False)
    width, height = levels.size
    reflectors = graph.buffer("ssil/reflectors", dtype=LIGHT, count=width * height if has_reflectors else 1)
    shader = "ssil/light.wgsl"
    graph.compute(
        "ssil/light",
        shader,
        over=_threads(levels),
        reads={"surfaces": gbuffer.surfaces, "distance": gbuffer.distance, "direct": direct},
        writes={
            "light": light.codes,
            "peak": light.peak,
            "reflectors": reflectors,
            "shines": graph.buffer("ssil/no_shines", dtype=np.uint32, count=1) if shines is None else shines,
        },
        constants={
            **scene.constants(shader),
            **_constants(levels),
            "SQUARE": 1 << levels.first,
            "HAS_REFLECTORS": has_reflectors,
            "SPLIT": split,
        },
        clear=[light.peak] if shines is None else [light.peak, shines],
    )
    return light, reflectors


def declare_reflected_light(
    graph: Graph,
    levels: Levels,
    reflectors: Buffer,
    irradiance: Buffer,
    first_peak: Buffer,
    bounce_threshold: float,
    suffix: str,
) -> SentLight:
    """Declare the light that surfaces send from the `irradiance` of a bounce.

    The bounce counts as dark if its brightest light is at most `bounce_threshold` times the first bounce's.
    """
    light = _light(graph, levels, levels.surfels[levels.first], suffix, history=False)
    graph.compute(
        f"ssil/reflect{suffix}",
        "ssil/reflect.wgsl",
        over=_threads(levels),
        reads={
            "reflectors": reflectors,
            "irradiance": irradiance,
            "first_peak": first_peak,
        },
        writes={"light": light.codes, "peak": light.peak},
        params={"size": levels.size, "bounce_threshold": bounce_threshold},
        constants=_constants(levels),
        clear=[light.peak],
    )
    return light


def declare_feedback(
    graph: Graph, gbuffer: Gbuffer, levels: Levels, sent: SentLight, reflectors: Buffer, motion: Buffer, previous: View
) -> SentLight:
    """Declare the light `sent` from direct light plus the light from the `previous` frame's irradiance."""
    # A pixel lit on one of its surfaces reflects earlier light from others, too: the vote chooses its sender.
    light = _light(graph, levels, levels.surfels[levels.first], "_feedback", history=True)
    graph.compute(
        "ssil/feedback",
        "ssil/feedback.wgsl",
        over=_threads(levels),
        reads={
            "surfels": levels.receivers,
            "distance": gbuffer.distance,
            "reflectors": reflectors,
            "sent": sent.codes,
            "motion": motion,
            "previous": previous,
            "previous_peak": light.peak.previous,
        },
        writes={"light": light.codes, "peak": light.peak},
        constants={**_constants(levels), "SQUARE": 1 << levels.first},
        clear=[light.peak],
    )
    return light


def _light(graph: Graph, levels: Levels, senders: Texture, suffix: str, history: bool) -> SentLight:
    codes = graph.buffer(f"ssil/light{suffix}", dtype=LIGHT, count=levels.pixels_before(levels.gathered.stop))
    peak = graph.buffer(f"ssil/light_peak{suffix}", dtype=np.uint32, count=2, history=history)
    return SentLight(codes, peak, senders)


def _threads(levels: Levels) -> tuple[int, int]:
    """Return the threads that store the light of all levels: whole workgroups, four pixels per thread."""
    width, height = (-(-side // (2 * TILE_THREADS)) * TILE_THREADS for side in levels.size)
    return width, height


def _constants(levels: Levels) -> dict[str, float]:
    return {"COARSER_LEVELS": len(levels.gathered) - 1}
