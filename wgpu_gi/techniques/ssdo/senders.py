"""What the pixels of all sources reflect: those of the picture are lit already, those of others are lit here."""

from __future__ import annotations

from ...gpu.graph import Graph
from ...gpu.handles import Buffer, Handle, Texture
from ..deferred.environment import Ambient
from ..deferred.inputs import DeferredInputs
from ..shared.denoise import declare_blur
from ..shared.gbuffer import SURFACE, Gbuffer
from .search import INTERLEAVE, SENDER_STRIDE, SKY_STRIDE, Asked, declare_search, grid_of
from .sources import Sources, SsdoSettings


def declare_senders(
    graph: Graph,
    settings: SsdoSettings,
    scene: DeferredInputs,
    sources: Sources,
    direct: Buffer,
    atlas: Texture | None,
    ambient: Ambient,
    seed: int,
) -> Buffer:
    """Declare what the pixels of all sources reflect of light scattered once, one source after the other."""
    width, height = graph.size
    grid = grid_of(graph, SENDER_STRIDE)
    further = grid[0] * grid[1]
    senders = graph.buffer("ssdo/senders", dtype=SURFACE, count=width * height + further * (sources.count - 1))
    declare_shown(graph, scene, sources.layers[0], direct, senders)
    for number in range(1, sources.count):
        first = width * height + further * (number - 1)
        sky: dict[str, Handle] = {"coarse": graph.neutral("buffer")}
        if ambient.features["HAS_ENVIRONMENT"]:
            sky = _declare_sky(graph, settings, scene, sources, ambient, seed, number)
        _declare_further(graph, scene, sources, number, atlas, ambient, sky, senders, first)
    return senders


def declare_shown(
    graph: Graph,
    scene: DeferredInputs,
    gbuffer: Gbuffer,
    direct: Buffer,
    senders: Buffer,
    gathered: Buffer | None = None,
) -> None:
    """Declare what the picture's pixels reflect, the first of `senders`: light scattered once, and that `gathered`."""
    shader = "ssdo/shown.wgsl"
    graph.compute(
        "ssdo/senders",
        shader,
        over=graph.size,
        reads={
            "surfaces": gbuffer.surfaces,
            "direct": direct,
            "gathered": gathered if gathered is not None else graph.neutral("buffer"),
        },
        writes={"senders": senders},
        constants={**scene.constants(shader), "FURTHER": gathered is not None},
    )


def _declare_further(
    graph: Graph,
    scene: DeferredInputs,
    sources: Sources,
    number: int,
    atlas: Texture | None,
    ambient: Ambient,
    sky: dict[str, Handle],
    senders: Buffer,
    first: int,
) -> None:
    """Declare what the grid of another source reflects, from `first` on."""
    gbuffer, shader = sources.gbuffer(number), "ssdo/senders.wgsl"
    graph.compute(
        f"ssdo/senders_{number}",
        shader,
        over=grid_of(graph, SENDER_STRIDE),
        reads={
            **ambient.reads,
            "surfaces": gbuffer.surfaces,
            "distance": gbuffer.distance,
            **sky,
            "light_table": scene.direct.lights,
            "shadow_atlas": atlas if atlas is not None else graph.neutral("texture_depth_2d"),
            "shadow_sampler": graph.sampler("linear", "clamp", "greater-equal"),
        },
        writes={"senders": senders},
        params={"first": first},
        constants={
            **scene.constants(shader),
            **ambient.constants(shader),
            "OUTWARD": sources.is_outward(number),
            "STRIDE": SENDER_STRIDE,
            "COARSE_STRIDE": SKY_STRIDE,
        },
        uniforms={"view": sources.view_of(number)},
    )


def _declare_sky(
    graph: Graph,
    settings: SsdoSettings,
    scene: DeferredInputs,
    sources: Sources,
    ambient: Ambient,
    seed: int,
    number: int,
) -> dict[str, Handle]:
    """Declare the share of the environment's light that another source gets, at every SKY_STRIDE-th pixel."""
    found = declare_search(Asked(graph, settings, scene, sources, ambient, seed, number))
    share = declare_blur(
        graph,
        f"ssdo/share_{number}",
        sources.gbuffer(number),
        found.light,
        found.normals,
        INTERLEAVE if settings.blur else 1,
        stride=found.stride,
        view=sources.view_of(number),
    )
    return {"coarse": share}
