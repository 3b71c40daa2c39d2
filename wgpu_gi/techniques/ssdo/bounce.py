"""Screen-space directional occlusion: the environment's light past what is near, and one bounce of all light.

Ritschel et al. 2009, "Approximating Dynamic Global Illumination in Image Space". Departures: several points along each
direction instead of one, of which the first that is hidden counts; directions drawn by the cosine; a sender's area is
what the direction's solid angle cuts out of it, so that there is no strength to set; pixels next to each other share
directions by the pattern of interleaved gathering (Segovia et al. 2006), whose blur serves.
"""

from __future__ import annotations

from dataclasses import dataclass

from ...gpu.graph import Graph
from ...gpu.handles import Buffer, Texture
from ..deferred.environment import Ambient
from ..deferred.inputs import DeferredInputs
from ..shared.denoise import declare_blur
from ..shared.gbuffer import FOUR_FLOATS, Gbuffer
from ..shared.temporal import TemporalSettings, declare_accumulate
from ..shared.upsample import declare_upsampling
from .search import (
    INTERLEAVE,
    SENDER_STRIDE,
    Asked,
    Search,
    declare_search,
    declare_unrepresented,
    grid_of,
    grid_reads,
    over_grid,
)
from .senders import declare_senders
from .sources import Sources, SsdoSettings


@dataclass
class Occlusion:
    """What directions meet: `share` of the environment that arrives, (r, g, b, -) per pixel, None without one."""

    share: Buffer | None
    search: Search


@dataclass
class History:
    """How light is averaged over frames, and where surfaces were in the frame before; none is kept of one frame."""

    settings: TemporalSettings
    motion: Buffer

    def declare(self, graph: Graph, scene: DeferredInputs, gbuffer: Gbuffer, light: Buffer, name: str) -> Buffer:
        """Declare the mean of light (r, g, b, -) per pixel, above 0 in the last where there is something to light."""
        if self.settings.frames == 1:
            return light
        return declare_accumulate(graph, self.settings, scene, gbuffer, self.motion, light, name).averaged


def declare_occlusion(
    graph: Graph,
    settings: SsdoSettings,
    scene: DeferredInputs,
    sources: Sources,
    ambient: Ambient,
    history: History,
    seed: int,
    frames: int,
    *,
    directional: bool = True,
) -> Occlusion:
    """Declare what the directions of each pixel meet, and the share of the environment's light that gets past it.

    `frames` make a still picture. Without `directional` it is a grey share: ambient occlusion.
    """
    gbuffer = sources.layers[0]
    asked = Asked(graph, settings, scene, sources, ambient, seed, directional=directional)
    search = declare_search(asked)
    if not ambient.features["HAS_ENVIRONMENT"]:
        graph.skip("ssdo/share", "there is no environment, or environment.ambient is off")
        declare_unrepresented(asked, search, None)
        return Occlusion(None, search)
    share = _declare_average(graph, "ssdo/share", settings, scene, gbuffer, search.light, search, frames)
    declare_unrepresented(asked, search, share)
    return Occlusion(history.declare(graph, scene, gbuffer, share, "ssdo/share"), search)


def declare_bounce(
    graph: Graph,
    settings: SsdoSettings,
    scene: DeferredInputs,
    sources: Sources,
    occlusion: Occlusion,
    direct: Buffer,
    atlas: Texture | None,
    ambient: Ambient,
    history: History,
    seed: int,
) -> Buffer:
    """Declare the light that the surfaces found reflect, (r, g, b, -) per pixel, W/(m2 sr)."""
    search, gbuffer = occlusion.search, sources.layers[0]
    senders = declare_senders(graph, settings, scene, sources, direct, atlas, ambient, seed)
    irradiance = declare_reflected(graph, settings, scene, sources, search, senders)
    name, reflected = "ssdo/bounce", history.settings.frames == 1
    light = _declare_average(graph, name, settings, scene, gbuffer, irradiance, search, reflected=reflected)
    declare_unrepresented_reflected(graph, settings, scene, sources, search, senders, light, reflected=reflected)
    if reflected:
        return light
    return _declare_reflection(graph, scene, gbuffer, history.declare(graph, scene, gbuffer, light, name))


def _declare_reflection(graph: Graph, scene: DeferredInputs, gbuffer: Gbuffer, irradiance: Buffer) -> Buffer:
    """Declare the radiance that irradiance makes."""
    width, height = graph.size
    radiance = graph.buffer("ssdo/radiance", dtype=FOUR_FLOATS, count=width * height, width=width, nonnegative=True)
    shader = "ssdo/reflect.wgsl"
    graph.compute(
        "ssdo/reflect",
        shader,
        over=(width, height),
        reads={"surfaces": gbuffer.surfaces, "irradiance": irradiance},
        writes={"radiance": radiance},
        constants=scene.constants(shader),
    )
    return radiance


def declare_reflected(
    graph: Graph,
    settings: SsdoSettings,
    scene: DeferredInputs,
    sources: Sources,
    search: Search,
    senders: Buffer,
) -> Buffer:
    """Declare the irradiance of the grid by what the surfaces found reflect, W/m2, not averaged yet."""
    width, height = grid_of(graph, search.stride)
    irradiance = graph.buffer("ssdo/irradiance", dtype=FOUR_FLOATS, count=width * height, width=width, nonnegative=True)
    shader = "ssdo/bounce.wgsl"
    graph.compute(
        "ssdo/bounce",
        shader,
        **over_grid(graph, sources, 0, search.stride),
        reads={
            **grid_reads(sources, 0, search.stride),
            "found": search.light,
            "hits": search.hits,
            "senders": senders,
        },
        writes={"irradiance": irradiance},
        constants=_bounce_constants(settings, scene, sources, search),
        clear=[irradiance],
    )
    return irradiance


def declare_unrepresented_reflected(
    graph: Graph,
    settings: SsdoSettings,
    scene: DeferredInputs,
    sources: Sources,
    search: Search,
    senders: Buffer,
    fine: Buffer,
    *,
    reflected: bool,
) -> None:
    """Declare the light that unrepresented pixels get, or with `reflected` reflect, into that of all pixels, `fine`."""
    if search.guide is None or search.unrepresented_hits is None:
        return
    graph.compute(
        "ssdo/unrepresented_bounce",
        "ssdo/bounce.wgsl",
        indirect=search.guide.groups,
        entry="listed",
        reads={
            "surfaces": sources.gbuffer(0).surfaces,
            "found": graph.neutral("buffer"),
            "hits": search.unrepresented_hits,
            "senders": senders,
            **search.guide.list_reads,
        },
        writes={"irradiance": fine},
        constants={**_bounce_constants(settings, scene, sources, search), "REFLECTED": reflected},
    )


def _bounce_constants(
    settings: SsdoSettings, scene: DeferredInputs, sources: Sources, search: Search
) -> dict[str, float]:
    return {
        **scene.constants("ssdo/bounce.wgsl"),
        **sources.constants,
        "DIRECTIONS": settings.directions,
        "STRIDE": search.stride,
        "SENDER_STRIDE": SENDER_STRIDE,
        "WEIGHT": 1.0 if search.sent is None else 2.0,
    }


def _declare_average(
    graph: Graph,
    name: str,
    settings: SsdoSettings,
    scene: DeferredInputs,
    gbuffer: Gbuffer,
    light: Buffer,
    search: Search,
    frames: int = 1,
    *,
    reflected: bool = False,
) -> Buffer:
    """Declare light of the grid averaged over squares, for all pixels; `reflected`: irradiance as radiance."""
    radius = INTERLEAVE if settings.blur else 1
    over = search.sent if light is search.light else None
    # Shadows of what is drawn by the picture have edges to keep; all else is soft.
    still = frames if over is not None else 1
    blurred = declare_blur(
        graph,
        name,
        gbuffer,
        light,
        search.normals,
        radius,
        frames=still,
        glossy=over,
        reflected=reflected and search.stride == 1,
        stride=search.stride,
    )
    if search.stride == 1:
        return blurred
    assert search.guide is not None
    return declare_upsampling(graph, scene, name, gbuffer, blurred, search.guide, reflected=reflected)
