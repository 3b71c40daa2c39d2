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
from .levels import Levels, declare_levels, level_buffer
from .light import SentLight, declare_direct_light, declare_feedback, declare_reflected_light
from .voxels import NO_GRID, Voxels, VoxelSettings, declare_voxels

STARTS = ("full", "half", "quarter")
MOST_BOUNCES = 16
UNREPRESENTED_SHARE = 4  # unrepresented pixels take a share of their samples in a frame, one in so many. Chosen
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
    count = settings.bounces if bounces is None else min(bounces, MOST_BOUNCES)
    light, reflectors = declare_direct_light(graph, scene, gbuffer, levels, direct, count > 1)
    kept: Buffer | None = None
    if is_amortised(settings, bounces):
        kept = level_buffer(graph, f"ssil/combined_{levels.first}", levels.size, history=True)
        light = declare_feedback(graph, gbuffer, levels, light.codes, reflectors, motion, kept.previous)
        count = 1
    else:
        given = "one bounce" if count == 1 else "a number of bounces is given"
        graph.skip("ssil/feedback", given if settings.amortised else "ssil.amortised is off")
    fine = declare_fine(graph, levels, settings.unrepresented)
    last = _last_level(settings, levels)
    for k in range(last + 1, levels.gathered.stop):
        graph.skip(f"ssil/gather_{k}", "its ring begins beyond the picture")
    gathering = _Gathering(settings, scene, levels, last, pattern, voxels, fine, kept)
    irradiance, glossy_light = _declare_bounces(graph, gathering, light, reflectors, count)
    radius = _radius(settings, levels)
    glossy = declare_glossy(
        graph, scene, gbuffer, levels, voxels, glossy_light.codes, settings.glossy_samples, radius, seed
    )
    return declare_last(graph, temporal, scene, gbuffer, motion, levels, irradiance, glossy, fine)


def _declare_bounces(
    graph: Graph, gathering: _Gathering, first: SentLight, reflectors: Buffer, count: int
) -> tuple[Buffer, SentLight]:
    """Declare the irradiance of `count` bounces, the first of them of the light `first`; and what coats reflect.

    That is the light of all bounces but the last, for the coat is the last to scatter it.
    """
    settings, levels = gathering.settings, gathering.levels
    coated = gathering.scene.features["HAS_COATS"] and settings.glossy_samples > 0
    glossy_light = first
    total = got = _declare_bounce(graph, gathering, first, "", None)[0]
    if settings.visible_bounces == "first":
        gathering = replace(gathering, settings=replace(settings, visibility="none"), voxels=None)
    common = graph, levels, reflectors
    for bounce in range(2, count + 1):
        suffix = f"_bounce_{bounce}"
        limits = first.peak, settings.least_light
        if bounce == count and coated:
            glossy_light = declare_reflected_light(*common, total, *limits, "_all", first.codes)
        light = declare_reflected_light(*common, got, *limits, suffix)
        got, total = _declare_bounce(graph, gathering, light, suffix, total)
    return total, glossy_light


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


def _declare_bounce(
    graph: Graph, gathering: _Gathering, light: SentLight, suffix: str, before: Buffer | None
) -> tuple[Buffer, Buffer]:
    """Declare the irradiance of the first level by the light of a bounce, and the sum of it and of `before`.

    SentLight of a level is gathered by the pixels of the next finer one, four times as many, each with a quarter of the
    samples. Without `before` the sum is the irradiance itself.
    """
    levels = gathering.levels
    combined: Buffer | None = None
    total: Buffer | None = None
    for k in reversed(range(levels.first, gathering.last)):
        ring = _declare_gather(graph, gathering, k + 1, k, light, suffix)
        finest = k == levels.first
        finer = gathering.kept if finest else None
        finer = finer or level_buffer(graph, f"ssil/combined_{k}{suffix}", levels.surfels[k].size)
        disc = _declare_gather(graph, gathering, k, k, light, suffix) if finest else graph.neutral("buffer")
        added = finest and before is not None
        total = level_buffer(graph, f"ssil/total{suffix}", levels.size) if added else finer
        graph.compute(
            f"ssil/combine_{k}{suffix}",
            "ssil/combine.wgsl",
            entry="with_total" if added else "main",
            over=levels.surfels[k],
            reads={
                "surfels": levels.surfels[k],
                "coarse_surfels": levels.surfels[k + 1],
                "disc": disc,
                "ring": ring,
                "coarse": combined or ring,
                **({"before": before} if added else {}),
            },
            writes={"combined": finer, **({"total": total} if added else {})},
            constants={
                "HAS_DISC": finest,
                "HAS_COARSE": combined is not None,
                "COARSE_CENTRED": True,
            },
        )
        combined = finer
    assert combined is not None and total is not None
    return combined, total


def _declare_gather(
    graph: Graph,
    gathering: _Gathering,
    k: int,
    receivers: int,
    light: SentLight,
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
        "light": light.codes,
        "pattern": gathering.pattern,
        "peak": light.peak,
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
        "light_offset": levels.pixels_before(k),
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
