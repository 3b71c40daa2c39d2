"""Indirect light in screen space: pixels gather from all visible surfaces, far light from coarse levels.

Soler et al. 2010, "A Deferred Shading Algorithm for Real-Time Indirect Illumination". Departures: those of the modules
beside this one. With amortised bounces, Soler computes two bounces on alternate frames; here each frame adds one bounce
to the previous frame's irradiance, without limit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from ...gpu.graph import Graph
from ...gpu.handles import Buffer
from ...records import KnownAttributes
from ...settings import setting
from ..shared.bounds import ELSEWHERE, NOTHING, scattered_more
from ..shared.denoise import DenoiseSettings
from ..shared.gbuffer import Gbuffer
from ..shared.temporal import TemporalSettings
from ..shared.upsample import declare_upsampling
from .gather import GatherInputs, declare_gathering, declare_pattern, default_radius, last_level
from .glossy import declare_glossy
from .inputs import SsilInputs
from .levels import declare_levels, level_buffer
from .light import SentLight, declare_feedback, declare_reflected_light, declare_sent_light
from .offscreen import declare_offscreen
from .shade import Upsampling, declare_denoised, declare_denoised_unrepresented, declare_guides, declare_shading
from .shiny import declare_shines, declare_shiny
from .voxels import Voxels, VoxelSettings, declare_voxels

STARTS = ("full", "half", "quarter")
MOST_BOUNCES = 16
BOUNCE_SEED = 0x85EBCA6B  # an odd constant that sets the bounces' random numbers apart


@dataclass(repr=False, slots=True)
class SsilSettings(KnownAttributes):
    """Gathering of light from visible surfaces."""

    start: str = setting(
        "half", "Resolution of the first level that gathers light.", choices=STARTS, presets={"low": "quarter"}
    )
    levels: int = setting(4, "Levels that gather light, each at half the previous resolution.", "levels", range=(3, 6))
    samples: int = setting(
        64,
        "Samples per pixel and level, in groups of four; one of each group is drawn and tested for visibility.",
        "samples",
        range=(4, 1024),
        presets={"low": 32, "high": 128},
    )
    radius: float | None = setting(
        None,
        "Radius of the disc and rings, in pixels of their level; none: automatic, so that the second-coarsest ring"
        " spans the picture.",
        "pixels",
        range=(1, 8192),
    )
    visibility: str = setting(
        "exact",
        "Visibility of samples: by rays (exact), by voxels, by the picture's depths, or none.",
        choices=("exact", "voxels", "depth", "none"),
    )
    visibility_bounces: str = setting(
        "first",
        "Bounces with visibility; in other bounces light passes through all surfaces.",
        choices=("first", "all"),
        presets={"high": "all"},
    )
    form_factor: str = setting(
        "disc",
        "Form factor of a sample: point to disc (bounded), or point to differential area.",
        choices=("disc", "differential"),
    )
    unrepresented: bool = setting(
        True, "Gather at full resolution for pixels whose surface no pixel of the first level shows."
    )
    glossy_samples: int = setting(
        1,
        "Rays along directions drawn from the coat, per coated pixel and frame.",
        "rays",
        range=(0, 64),
        presets={"high": 4},
    )
    offscreen: str = setting(
        "none",
        "Light from surfaces that no pixel shows: none, or by rays and a radiance cache in world space (cache).",
        choices=("none", "cache"),
    )
    offscreen_rays: int = setting(
        2,
        "Rays per pixel of the first level and frame for ssil.offscreen, at most as many as fit a buffer of the GPU.",
        "rays",
        range=(1, 16),
        presets={"low": 1, "high": 4},
    )
    bounces: int = setting(
        2, "Bounces if the number is unlimited.", "bounces", range=(1, MOST_BOUNCES), presets={"high": 4}
    )
    amortised: bool = setting(
        False, "If bounces are unlimited, gather one per frame, from direct light and the previous frame's light."
    )
    bounce_threshold: float = setting(
        0.001, "Skip bounces whose brightest light is at most this share of the first bounce's.", range=(0, 1)
    )


def is_amortised(settings: SsilSettings, bounces: int | None) -> bool:
    """Return whether bounces are spread over frames; a given number of bounces is not."""
    return settings.amortised and bounces is None and settings.bounces > 1


def declare_bounces(
    graph: Graph,
    settings: SsilSettings,
    voxel_settings: VoxelSettings,
    temporal: TemporalSettings,
    denoise: DenoiseSettings,
    scene: SsilInputs,
    gbuffer: Gbuffer,
    motion: Buffer,
    direct: Buffer,
    bounces: int | None,
    seed: int,
) -> Buffer:
    """Declare the indirect light of `bounces` bounces of the light `direct`: (r, g, b, 1) per pixel, W/(m2 sr).

    None: as many bounces as the settings say. Each bounce has its own passes; bounces beyond MOST_BOUNCES are left out.
    """
    # Declare the stages that do not depend on light: surfels, samples, voxels.
    levels = declare_levels(graph, scene, gbuffer, STARTS.index(settings.start), settings.levels, seed)
    radius = settings.radius or default_radius(levels.size, settings.levels)
    pattern = declare_pattern(graph, settings.samples, radius, seed)
    voxels: Voxels | None = None
    if settings.visibility == "voxels":
        voxels = declare_voxels(graph, voxel_settings, scene, levels)
    else:
        graph.skip("voxels", f"ssil.visibility is {settings.visibility}", NOTHING)

    # Declare the light of the first bounce, plus the previous frame's light if amortised.
    count = settings.bounces if bounces is None else min(bounces, MOST_BOUNCES)
    shines = declare_shines(graph, scene, settings.glossy_samples)
    light, reflectors = declare_sent_light(graph, scene, gbuffer, levels, direct, count > 1, shines, seed)
    kept: Buffer | None = None
    if is_amortised(settings, bounces):
        kept = level_buffer(graph, "ssil/combined", levels.size, history=True)
        light = declare_feedback(graph, gbuffer, levels, light, reflectors, motion, kept.previous)
        count = 1
    else:
        given = "one bounce" if count == 1 else "a number of bounces is given"
        graph.skip("ssil/feedback", given if settings.amortised else "ssil.amortised is off", ELSEWHERE)

    # Gather.
    fine = declare_guides(graph, levels, settings.unrepresented)
    last = last_level(levels, radius)
    for k in range(last + 1, levels.gathered.stop):
        graph.skip(f"ssil/gather_{k}", "its ring begins beyond the picture", NOTHING)
    bounded = settings.form_factor == "disc"
    inputs = GatherInputs(scene, seed, levels, last, pattern, settings.visibility, bounded, voxels, fine, kept)
    first = _declare_first_bounce(graph, settings, inputs, gbuffer, light, seed, one_bounce=bounces == 1)
    irradiance, before = _declare_further_bounces(graph, settings, inputs, light, reflectors, first, count)
    before = irradiance if kept is not None else before

    # Shade the picture.
    glossy = _declare_coats(graph, settings, scene, gbuffer, before, fine, seed)
    denoised = declare_denoised(graph, denoise, gbuffer, levels, irradiance, scene.frames)
    fine = declare_denoised_unrepresented(graph, denoise, levels, fine, scene.frames)
    indirect = declare_shading(graph, temporal, scene, gbuffer, motion, levels, denoised, glossy, fine)
    if shines is not None:
        declare_shiny(graph, scene, gbuffer, shines, settings.glossy_samples, seed, indirect, denoise.levels)
    return indirect


def _declare_coats(
    graph: Graph,
    settings: SsilSettings,
    scene: SsilInputs,
    gbuffer: Gbuffer,
    before: Buffer | None,
    fine: Upsampling | None,
    seed: int,
) -> Buffer | None:
    """Declare the coats' reflection of all bounces but the last, `before`, since coats are the last scattering."""
    rays = settings.glossy_samples
    if before is not None and fine is not None and scene.features["HAS_COATS"] and rays:
        before = declare_upsampling(graph, scene, "ssil/before", gbuffer, before, fine.guide, reflected=False)
    return declare_glossy(graph, scene, gbuffer, before, rays, seed, offscreen=settings.offscreen == "cache")


def _declare_first_bounce(
    graph: Graph,
    settings: SsilSettings,
    inputs: GatherInputs,
    gbuffer: Gbuffer,
    light: SentLight,
    seed: int,
    *,
    one_bounce: bool,
) -> Buffer:
    """Declare the irradiance from visible surfaces and, by the settings, from all others, W/m2."""
    irradiance = declare_gathering(graph, inputs, light, "", None)[0]
    if settings.offscreen == "cache":
        scene, levels = inputs.scene, inputs.levels
        declare_offscreen(
            graph, scene, gbuffer, levels, irradiance, inputs.fine, settings.offscreen_rays, seed, one_bounce=one_bounce
        )
    else:
        graph.skip("ssil/offscreen", "ssil.offscreen is none", scattered_more(inputs.scene, 1))
    return irradiance


def _declare_further_bounces(
    graph: Graph,
    settings: SsilSettings,
    inputs: GatherInputs,
    sent: SentLight,
    reflectors: Buffer,
    irradiance: Buffer,
    count: int,
) -> tuple[Buffer, Buffer | None]:
    """Declare the irradiance of `count` bounces, the first of which is `irradiance`, and that of all but the last.

    sent: the light of the first bounce.
    """
    total = irradiance
    before: Buffer | None = None
    if settings.visibility_bounces == "first":
        inputs = replace(inputs, visibility="none", voxels=None)
    common = graph, inputs.levels, reflectors
    limits = sent.peak, settings.bounce_threshold
    for bounce in range(2, count + 1):
        before = total
        suffix = f"_bounce_{bounce}"
        inputs = replace(inputs, seed=(inputs.seed + BOUNCE_SEED) & 0xFFFFFFFF)
        light = declare_reflected_light(*common, irradiance, *limits, suffix)
        irradiance, total = declare_gathering(graph, inputs, light, suffix, total)
    return total, before
