"""One bounce of SSIL: irradiance from samples of every level, gathered by the pixels of the first.

Soler et al. 2010, "A Deferred Shading Algorithm for Real-Time Indirect Illumination", section 4. Departures: pixels of
the first level gather from all levels, not only from the next one, so shadows of far light are not blurred over coarse
pixels; of each four samples one is drawn by its light and tested for visibility; blocks of pixels rotate their
patterns; unrepresented pixels gather at full resolution; the default radius is twice the smallest that covers the
screen.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...gpu.graph import Graph
from ...gpu.handles import Buffer, Resource, Texture
from ...gpu.wgsl.load import load
from .inputs import SsilInputs
from .levels import Levels, level_buffer
from .light import SentLight
from .senders import declare_coarser_senders
from .shade import Upsampling
from .voxels import NO_GRID, Voxels

_CONSTANTS = load("ssil/interleaving.wgsl").constants
_INTERLEAVE, _PATTERNS, _CANDIDATES = (int(_CONSTANTS[name]) for name in ("INTERLEAVE", "PATTERNS", "CANDIDATES"))


@dataclass(frozen=True)
class GatherInputs:
    """Inputs that all bounces share.

    last: the coarsest level that samples can lie on. bounded: True for the point-to-disc form factor, False for that of
    a differential area. kept: the irradiance that the first bounce stores for the next frame, if bounces are amortised.
    """

    scene: SsilInputs
    seed: int
    levels: Levels
    last: int
    pattern: Buffer
    visibility: str
    bounded: bool
    voxels: Voxels | None
    fine: Upsampling | None
    kept: Buffer | None


def default_radius(size: tuple[int, int], levels: int) -> float:
    """Return the radius, pixels of a level, for a first level of `size`: twice the smallest that covers the screen.

    Then the second-coarsest ring already spans the picture, the coarsest is not needed, and far light is sampled on a
    finer level. Rays for visibility, 320x180, start half, 4 levels, one bounce, against the path tracer with
    `visible_only`: relMSE 0.015 instead of 0.098 on Cornell's spot, 0.020 instead of 0.047 with the point light, in the
    same run time.
    """
    return max(math.hypot(*size) / 2 ** (levels - 2), 1.0)


def last_level(levels: Levels, radius: float) -> int:
    """Return the coarsest level whose ring can begin within the picture; at least the second."""
    inner, diagonal = 0.5 * radius, math.hypot(*levels.size)
    return max(k for k in levels.gathered[1:] if k == levels.first + 1 or inner * 2 ** (k - levels.first) < diagonal)


def declare_pattern(graph: Graph, samples: int, radius: float, seed: int) -> Buffer:
    """Declare the offsets and areas of `samples` of each interleaved pattern, in the disc and in the ring."""
    groups = samples // _CANDIDATES
    count = 2 * _PATTERNS * _CANDIDATES * groups
    pattern = graph.buffer("ssil/pattern", dtype=np.dtype((np.uint32, 2)), count=count)
    graph.compute(
        "ssil/pattern",
        "ssil/pattern.wgsl",
        over=pattern,
        writes={"pattern": pattern},
        params={"radius": radius, "seed": seed, "groups": groups},
    )
    return pattern


def declare_gathering(
    graph: Graph, inputs: GatherInputs, light: SentLight, suffix: str, before: Buffer | None
) -> tuple[Buffer, Buffer]:
    """Declare the irradiance of the first level from the light of a bounce, W/m2, and its sum with `before`.

    Without `before` the sum is the irradiance itself. `suffix`: names the bounce in pass names.
    """
    levels = inputs.levels
    # Gather: the rings of the coarser levels, and the disc of the first.
    ring = level_buffer(graph, f"ssil/ring{suffix}", levels.size)
    disc = level_buffer(graph, f"ssil/disc{suffix}", levels.size)
    senders = declare_coarser_senders(graph, levels, light.senders, light.codes, inputs.last, inputs.seed, suffix)
    for k in reversed(range(levels.first, inputs.last + 1)):
        _declare_gather(graph, inputs, k, disc if k == levels.first else ring, light, senders[k], suffix)
    # Combine them, and with the previous bounces.
    combined = inputs.kept or level_buffer(graph, f"ssil/combined{suffix}", levels.size)
    total = combined if before is None else level_buffer(graph, f"ssil/total{suffix}", levels.size)
    graph.compute(
        f"ssil/combine{suffix}",
        "ssil/combine.wgsl",
        entry="main" if before is None else "with_total",
        over=levels.receivers,
        reads={
            "surfels": levels.receivers,
            "disc": disc,
            "ring": ring,
            **({} if before is None else {"before": before}),
        },
        writes={"combined": combined, **({} if before is None else {"total": total})},
    )
    return combined, total


def _declare_gather(
    graph: Graph, inputs: GatherInputs, k: int, irradiance: Buffer, light: SentLight, senders: Texture, suffix: str
) -> None:
    """Declare `irradiance` from samples of level `k`, added to that of coarser levels; also of unrepresented pixels."""
    levels, voxels, fine = inputs.levels, inputs.voxels, inputs.fine
    width, height = levels.size
    shader = f"ssil/gather_{inputs.visibility}.wgsl"
    reads: Mapping[str, Resource] = {
        "surfels": senders,
        "light": light.codes,
        "pattern": inputs.pattern,
        "peak": light.peak,
        **(inputs.scene.surfaces if inputs.visibility == "exact" else {}),
        **(voxels.reads(k) if voxels is not None else {}),
    }
    constants = {
        **inputs.scene.constants(shader),
        **(voxels.constants if voxels is not None else {}),
        "BOUNDED": inputs.bounded,
    }
    params = {
        **(NO_GRID if voxels is None else voxels.params(k)),
        "light_offset": levels.pixels_before(k),
        "level": k,
        "first": 0 if k == levels.first else _PATTERNS,
        "seed": inputs.seed,
    }
    # Each workgroup takes 8x8 pixels of one pattern, so a block of patterns is a row of workgroups.
    block = 8 * _INTERLEAVE
    graph.compute(
        f"ssil/gather_{k}{suffix}",
        shader,
        over=(-(-width // block) * 8, -(-height // block) * _PATTERNS * 8),
        reads={**reads, "receivers": levels.receivers},
        writes={"irradiance": irradiance},
        params={**params, "stride": 1 << levels.first},
        constants=constants,
        clear=[irradiance] if k in (levels.first, inputs.last) else [],
    )
    if fine is not None and fine.irradiance is not None:
        graph.compute(
            f"ssil/unrepresented_{k}{suffix}",
            shader,
            entry="listed",
            indirect=fine.guide.groups,
            reads={**reads, **fine.guide.list_reads, "receivers": levels.surfels[0]},
            writes={"irradiance": fine.irradiance},
            params={**params, "stride": 1},
            constants=constants,
            clear=[] if suffix or k < inputs.last else [fine.irradiance],
        )
