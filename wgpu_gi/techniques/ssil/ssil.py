"""Indirect light in screen space: each pixel gathers from all that the picture shows, far pixels from coarse levels.

Soler et al. 2010, "A Deferred Shading Algorithm for Real-Time Indirect Illumination". Departures: eq. 4 with the factor
of pi that it lacks; light of a level is gathered by the pixels of the next finer one, each of which takes a quarter of
its samples in a frame; patterns of samples are dealt out to interleaved classes of pixels and go round from frame to
frame; light is summed over pixels and not averaged, so that none is lost where surfaces do not survive the vote; the
default radius is twice the least that covers the screen. Amortised bounces are not two on alternate frames: a frame
gathers once, of direct light and of what the frame before got, so that light passes on by a bounce each, without end.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ...gpu.graph import Graph
from ...gpu.handles import Buffer
from ...gpu.wgsl.load import load
from ...settings import setting
from ..shared.gbuffer import Gbuffer
from ..shared.scene_inputs import SceneInputs
from ..shared.temporal import TemporalSettings
from .full import Fine, declare_fine, declare_last
from .glossy import declare_glossy
from .inputs import SsilInputs
from .levels import (
    Levels,
    declare_again,
    declare_levels,
    declare_light_levels,
    declare_reflected,
    declare_sent,
    level_buffer,
)
from .voxels import NO_GRID, Voxels, VoxelSettings, declare_voxels

STARTS = ("full", "half", "quarter")
MOST_BOUNCES = 16
UNREPRESENTED_SHARE = 4  # unrepresented pixels take a share of their samples in a frame, one in so many. Chosen
ADD_ROW = int(load("ssil/add.wgsl").constants["ROW"])
_SIDE, _CLASSES = (int(load("ssil/classes.wgsl").constants[name]) for name in ("SIDE", "CLASSES"))


@dataclass
class SsilSettings:
    """How light is gathered from what the picture shows."""

    start: str = setting("half", "Resolution that gathering starts at.", choices=STARTS, presets={"low": "quarter"})
    levels: int = setting(4, "Levels that are gathered at, each of half the resolution.", "levels", range=(3, 6))
    samples: int = setting(
        64,
        "Samples of each pixel at each level.",
        "samples",
        range=(1, 1024),
        presets={"low": 32, "high": 128},
    )
    radius: float | None = setting(
        None,
        "Radius of the samples about a pixel of their level; none for twice the least that covers the screen.",
        "pixels",
        range=(1, 8192),
    )
    visibility: str = setting(
        "voxels",
        "What tells whether a pixel sees a sample: voxels, the picture's depths, rays, or nothing.",
        choices=("voxels", "depth", "exact", "none"),
    )
    visible_bounces: str = setting(
        "first",
        "Bounces that visibility is found for; in the others light passes through all.",
        choices=("first", "all"),
        presets={"high": "all"},
    )
    form_factor: str = setting(
        "disc", "Form factor of a sample: a disc of its area, bounded, or the plain one.", choices=("disc", "plain")
    )
    unrepresented: bool = setting(
        True, "Gather at full resolution for pixels whose surface no pixel of the start's resolution shows."
    )
    glossy_samples: int = setting(
        16,
        "Samples of each coated pixel at each level for what its coat reflects.",
        "samples",
        range=(0, 256),
        presets={"low": 8, "high": 64},
    )
    bounces: int = setting(
        2, "Bounces where all are asked for.", "bounces", range=(1, MOST_BOUNCES), presets={"high": 4}
    )
    amortised: bool = setting(
        False, "Where all bounces are asked for, gather one a frame, of direct light and what the frame before got."
    )
    least_light: float = setting(
        0.001, "Later bounces whose brightest light is this share of the first's are left out.", range=(0, 1)
    )


@dataclass(frozen=True)
class _Gathering:
    """What every bounce shares."""

    settings: SsilSettings
    scene: SceneInputs
    levels: Levels
    last: int  # the coarsest level that any sample can lie at
    pattern: Buffer
    voxels: Voxels | None
    fine: Fine | None
    kept: Buffer | None  # where the irradiance goes round to the next frame, it


def is_amortised(settings: SsilSettings, bounces: int | None) -> bool:
    """Tell whether bounces are spread over frames: a given number of them is not."""
    return settings.amortised and bounces is None and settings.bounces > 1


def declare_bounces(
    graph: Graph,
    settings: SsilSettings,
    voxel_settings: VoxelSettings,
    temporal: TemporalSettings,
    scene: SsilInputs,
    gbuffer: Gbuffer,
    motion: Buffer,
    direct: Buffer,
    bounces: int | None,
    seed: int,
) -> Buffer:
    """Declare the indirect light: (r, g, b, 1) per pixel, W/(m2 sr), of `bounces` bounces of the light `direct`.

    None stands for as many as the settings say. Each has passes of its own: beyond MOST_BOUNCES there are none.
    """
    levels = declare_levels(graph, scene, gbuffer, STARTS.index(settings.start), settings.levels)
    pattern = _declare_pattern(graph, settings, levels, seed)
    voxels: Voxels | None = None
    if settings.visibility == "voxels":
        voxels = declare_voxels(graph, voxel_settings, scene, levels)
    else:
        graph.skip("voxels", f"ssil.visibility is {settings.visibility}")
    light, peak = declare_sent(graph, scene, gbuffer, levels, direct)
    count = settings.bounces if bounces is None else min(bounces, MOST_BOUNCES)
    if count == 1:
        graph.skip("ssil/reflectors", "one bounce")
    else:
        reflectors = declare_sent(graph, scene, gbuffer, levels, None)[0]
    kept: Buffer | None = None
    if is_amortised(settings, bounces):
        kept = level_buffer(graph, f"ssil/combined_{levels.first}", levels.surfels[levels.first].size, history=True)
        light, peak = declare_again(graph, gbuffer, levels, light, reflectors, motion, kept.previous)
        count = 1
    else:
        given = "one bounce" if count == 1 else "a number of bounces is given"
        graph.skip("ssil/again", given if settings.amortised else "ssil.amortised is off")
    fine = declare_fine(graph, levels, settings.unrepresented)
    last = _last_level(settings, levels)
    for k in range(last + 1, levels.gathered.stop):
        graph.skip(f"ssil/gather_{k}", "its ring begins beyond the picture")
    gathering = _Gathering(settings, scene, levels, last, pattern, voxels, fine, kept)
    lights = declare_light_levels(graph, levels, light, "")
    total = got = _declare_bounce(graph, gathering, lights, peak, "")
    if settings.visible_bounces == "first":
        gathering = replace(gathering, settings=replace(settings, visibility="none"), voxels=None)
    first_peak, least = peak, settings.least_light
    coated = scene.features["HAS_COATS"] and settings.glossy_samples > 0
    for bounce in range(2, count + 1):
        suffix = f"_bounce_{bounce}"
        if bounce == count and coated:
            # What coats reflect has been scattered by all bounces but the last.
            sent = declare_reflected(graph, reflectors, total, first_peak, least, "_all", light)[0]
            lights = declare_light_levels(graph, levels, sent, "_all")
        sent, peak = declare_reflected(graph, reflectors, got, first_peak, least, suffix)
        got = _declare_bounce(graph, gathering, declare_light_levels(graph, levels, sent, suffix), peak, suffix)
        total = _declare_sum(graph, total, got, suffix)
    radius = _radius(settings, levels)
    glossy = declare_glossy(graph, scene, gbuffer, levels, voxels, lights, settings.glossy_samples, radius, seed)
    return declare_last(graph, temporal, scene, gbuffer, motion, levels, total, glossy, fine)


def default_radius(size: tuple[int, int], levels: int) -> float:
    """Return the radius, in pixels of a level, for a first level of `size`: twice the least that covers the screen.

    With it the last ring but one reaches from corner to corner, the last is left out, and light from afar is found at a
    finer level. Measured with rays for visibility, 320x180, start half, 4 levels, one bounce against the truth of what
    the picture shows: relMSE 0.015 instead of 0.098 on Cornell's spot, 0.020 instead of 0.047 with the point light, at
    the same time.
    """
    return max(math.hypot(*size) / 2 ** (levels - 2), 1.0)


def _radius(settings: SsilSettings, levels: Levels) -> float:
    return settings.radius or default_radius(levels.surfels[levels.first].size, settings.levels)


def _last_level(settings: SsilSettings, levels: Levels) -> int:
    """Return the coarsest level whose ring begins within the picture, wherever its middle is; at least the second."""
    inner, reach = 0.5 * _radius(settings, levels), math.hypot(*levels.surfels[levels.first].size)
    return max(k for k in levels.gathered[1:] if k == levels.first + 1 or inner * 2 ** (k - levels.first) < reach)


def _declare_pattern(graph: Graph, settings: SsilSettings, levels: Levels, seed: int) -> Buffer:
    """Declare where samples lie about a pixel, for each class of pixels: in the disc, then in the ring."""
    pattern = graph.buffer("ssil/pattern", dtype=np.dtype((np.uint32, 2)), count=2 * _CLASSES * settings.samples)
    graph.compute(
        "ssil/pattern",
        "ssil/pattern.wgsl",
        over=pattern,
        writes={"pattern": pattern},
        params={"radius": _radius(settings, levels), "seed": seed, "samples": settings.samples},
    )
    return pattern


def _declare_bounce(graph: Graph, gathering: _Gathering, lights: list[Buffer], peak: Buffer, suffix: str) -> Buffer:
    """Declare the irradiance of the first level by the light that it sends: gathered at all levels, and combined.

    Light of a level is gathered by the pixels of the next finer one, four times as many, each with a quarter of the
    samples.
    """
    levels = gathering.levels
    combined: Buffer | None = None
    for k in reversed(range(levels.first, gathering.last)):
        ring = _declare_gather(graph, gathering, k + 1, k, lights[k + 1 - levels.first], peak, suffix)
        finest = k == levels.first
        finer = gathering.kept if finest else None
        finer = finer or level_buffer(graph, f"ssil/combined_{k}{suffix}", levels.surfels[k].size)
        disc = _declare_gather(graph, gathering, k, k, lights[0], peak, suffix) if finest else graph.neutral("buffer")
        graph.compute(
            f"ssil/combine_{k}{suffix}",
            "ssil/combine.wgsl",
            over=levels.surfels[k],
            reads={
                "surfels": levels.surfels[k],
                "coarse_surfels": levels.surfels[k + 1],
                "disc": disc,
                "ring": ring,
                "coarse": combined or ring,
            },
            writes={"combined": finer},
            constants={"HAS_DISC": finest, "HAS_COARSE": combined is not None, "COARSE_CENTRED": True},
        )
        combined = finer
    assert combined is not None
    return combined


def _declare_gather(
    graph: Graph,
    gathering: _Gathering,
    k: int,
    receivers: int,
    light: Buffer,
    peak: Buffer,
    suffix: str,
) -> Buffer:
    """Declare the irradiance of pixels of the level `receivers` by the disc or ring of level `k`.

    That of unrepresented pixels is added to.
    """
    settings, levels, voxels, fine = gathering.settings, gathering.levels, gathering.voxels, gathering.fine
    width, height = levels.surfels[receivers].size
    irradiance = level_buffer(graph, f"ssil/irradiance_{k}{suffix}", (width, height))
    shader = f"ssil/gather_{settings.visibility}.wgsl"
    rays = settings.visibility == "exact"
    reads = {
        "surfels": levels.surfels[k],
        "light": light,
        "pattern": gathering.pattern,
        "peak": peak,
        **(gathering.scene.surfaces if rays else {}),
        **(voxels.reads(k) if voxels is not None else {}),
    }
    constants = {
        **gathering.scene.constants(shader),
        **(voxels.constants if voxels is not None else {}),
        "BOUNDED": settings.form_factor == "disc",
    }
    params = {
        **(NO_GRID if voxels is None else voxels.params(k)),
        "first": 0 if k == levels.first else _CLASSES,
    }
    # Whole workgroups of 8x8 pixels of each class, a band of the picture after the other.
    block = 8 * _SIDE
    graph.compute(
        f"ssil/gather_{k}{suffix}",
        shader,
        over=(-(-width // block) * 8, -(-height // block) * _CLASSES * 8),
        reads={**reads, "receivers": levels.surfels[receivers]},
        writes={"irradiance": irradiance},
        params={
            **params,
            "shift": k - receivers,
            "parts": 4 ** (k - receivers),
        },
        constants=constants,
    )
    if fine is not None and fine.irradiance is not None:
        graph.compute(
            f"ssil/unrepresented_{k}{suffix}",
            shader,
            entry="listed",
            indirect=fine.guide.groups,
            reads={**reads, **fine.guide.list_reads, "receivers": levels.surfels[0]},
            writes={"irradiance": fine.irradiance},
            params={**params, "shift": k, "parts": UNREPRESENTED_SHARE},
            constants=constants,
            clear=[] if suffix or k < gathering.last else [fine.irradiance],
        )
    return irradiance


def _declare_sum(graph: Graph, before: Buffer, irradiance: Buffer, suffix: str) -> Buffer:
    total = level_buffer(graph, f"ssil/total{suffix}", (before.width, before.count // before.width))
    graph.compute(
        f"ssil/add{suffix}",
        "ssil/add.wgsl",
        over=(ADD_ROW, -(-total.count // ADD_ROW)),
        reads={"before": before, "irradiance": irradiance},
        writes={"total": total},
    )
    return total
