"""One bounce of indirect light from the surfaces that the search for occluders found.

Ritschel et al. 2009, "Approximating Dynamic Global Illumination in Image Space", section 3. Departure: a sender's area
is the part that the direction's solid angle cuts out of it, so there is no strength to set; coats reflect what
directions drawn from them find.
"""

from __future__ import annotations

from ...gpu.formats import FOUR_FLOATS
from ...gpu.graph import Graph
from ...gpu.handles import Buffer
from ..deferred.environment import Ambient
from ..deferred.inputs import DeferredInputs
from ..deferred.shadow import ShadowMaps
from ..shared.denoise import DenoiseSettings
from ..shared.gbuffer import Gbuffer
from .occlusion import History, Occlusion, declare_full_resolution
from .search import SENDER_STRIDE, grid_dispatch, grid_reads, grid_size
from .search_request import SearchResult, moves
from .senders import declare_senders
from .settings import SsdoSettings
from .slices import declare_slices_bounce, declare_unrepresented_slices_bounce
from .sources import Sources

SHADER = "ssdo/bounce.wgsl"
COATS = "ssdo/coats_"  # names of the passes of coats beside a search by slices


def declare_bounce(
    graph: Graph,
    settings: SsdoSettings,
    denoise: DenoiseSettings,
    scene: DeferredInputs,
    sources: Sources,
    occlusion: Occlusion,
    direct: Buffer,
    maps: ShadowMaps | None,
    ambient: Ambient,
    history: History,
    seed: int,
) -> Buffer:
    """Declare the indirect light of one bounce off the surfaces found: (r, g, b, -) per pixel, W/(m2 sr)."""
    search, gbuffer = occlusion.search, sources.layers[0]
    # Gather the radiance that each source reflects, along the directions of the search.
    senders = declare_senders(graph, settings, scene, sources, direct, maps, ambient, seed)
    by_coats = occlusion.coats or search
    coats = coat_buffer(graph, by_coats) if by_coats.lobes else None
    if search.request is None:
        irradiance = declare_gathered(graph, settings, scene, sources, search, senders, coats)
    else:
        irradiance = declare_slices_bounce(search, senders)
        if coats is not None:
            declare_gathered(graph, settings, scene, sources, by_coats, senders, coats, prefix=COATS)
    # Upsample to all pixels: to radiance, or to irradiance if it is accumulated over frames or if coats add to it.
    name, reflected = "ssdo/bounce", history.settings.frames == 1 and coats is None
    light = declare_full_resolution(
        graph,
        name,
        settings,
        scene,
        gbuffer,
        irradiance,
        search,
        frames=scene.frames,
        levels=denoise.levels,
        reflected=reflected,
    )
    if coats is not None:
        coats = declare_full_resolution(graph, "ssdo/coats", settings, scene, gbuffer, coats, by_coats, lobes=True)
    if search.request is None:
        declare_gathered_unrepresented(
            graph, settings, scene, sources, search, senders, light, coats, reflected=reflected
        )
    else:
        declare_unrepresented_slices_bounce(search, senders, light, reflected=reflected)
        if coats is not None:
            nothing = _nothing(graph, f"{COATS}unrepresented_irradiance")
            declare_gathered_unrepresented(
                graph, settings, scene, sources, by_coats, senders, nothing, coats, reflected=False, prefix=COATS
            )
    if reflected:
        return light
    averaged = history.declare(graph, scene, gbuffer, light, name)
    if coats is not None:
        coats = history.declare(graph, scene, gbuffer, coats, "ssdo/coats", coat=True)
    return _declare_reflection(graph, scene, gbuffer, averaged, coats, by_coats.lobes)


def declare_gathered(
    graph: Graph,
    settings: SsdoSettings,
    scene: DeferredInputs,
    sources: Sources,
    search: SearchResult,
    senders: Buffer,
    coats: Buffer | None = None,
    *,
    prefix: str = "ssdo/",
) -> Buffer:
    """Declare the irradiance of the search grid from the surfaces found, W/m2, before any blur.

    `coats`: is written with what coats reflect, over their tint, W/(m2 sr); needed if the search has lobes.
    `prefix`: of names.
    """
    width, height = grid_size(graph, search.stride)
    irradiance = graph.buffer(
        f"{prefix}irradiance", dtype=FOUR_FLOATS, count=width * height, width=width, nonnegative=True
    )
    graph.compute(
        f"{prefix}bounce",
        SHADER,
        **grid_dispatch(graph, sources, 0, search.stride),
        reads={
            **grid_reads(sources, 0, search.stride),
            "occlusion": search.light,
            "hits": search.hits,
            "senders": senders,
        },
        writes={"irradiance": irradiance, "coat": coats or _nothing(graph, f"{prefix}no_coats")},
        constants=_gather_constants(settings, scene, sources, search),
        clear=[irradiance] if coats is None else [irradiance, coats],
    )
    return irradiance


def declare_gathered_unrepresented(
    graph: Graph,
    settings: SsdoSettings,
    scene: DeferredInputs,
    sources: Sources,
    search: SearchResult,
    senders: Buffer,
    light: Buffer,
    coats: Buffer | None = None,
    *,
    reflected: bool,
    prefix: str = "ssdo/",
) -> None:
    """Declare the irradiance (`reflected`: radiance) of unrepresented pixels, written into `light` of all pixels.

    `coats`, of all pixels: is written with what their coats reflect, over their tint, W/(m2 sr).
    """
    if search.guide is None or search.unrepresented_hits is None:
        return
    graph.compute(
        f"{prefix}unrepresented_bounce",
        SHADER,
        indirect=search.guide.groups,
        entry="listed",
        reads={
            "surfaces": sources.gbuffer(0).surfaces,
            "occlusion": graph.neutral("buffer"),
            "hits": search.unrepresented_hits,
            "senders": senders,
            **search.guide.list_reads,
        },
        writes={"irradiance": light, "coat": coats or _nothing(graph, f"{prefix}no_unrepresented_coats")},
        constants={**_gather_constants(settings, scene, sources, search), "REFLECTED": reflected},
    )


def _gather_constants(
    settings: SsdoSettings, scene: DeferredInputs, sources: Sources, search: SearchResult
) -> dict[str, float]:
    """Return the constants of both gathering passes."""
    return {
        **scene.constants(SHADER),
        **sources.constants,
        "DIRECTIONS": search.directions,
        "LOBES": search.lobes,
        "STRIDE": search.stride,
        "MOVES": moves(search.stride),
        "SENDER_STRIDE": SENDER_STRIDE,
        "SAMPLE_ENVIRONMENT": search.unoccluded is not None,
        "BY_RAYS": search.by_rays,
    }


def coat_buffer(graph: Graph, search: SearchResult) -> Buffer:
    """Return a buffer for what coats reflect, (r, g, b, depth) of the search grid."""
    width, height = grid_size(graph, search.stride)
    return graph.buffer("ssdo/coats", dtype=FOUR_FLOATS, count=width * height, width=width, nonnegative=True)


def _nothing(graph: Graph, name: str) -> Buffer:
    """Return a buffer that no pass writes to."""
    return graph.buffer(name, dtype=FOUR_FLOATS, count=1)


def _declare_reflection(
    graph: Graph, scene: DeferredInputs, gbuffer: Gbuffer, irradiance: Buffer, coats: Buffer | None, lobes: int
) -> Buffer:
    """Declare the radiance that surfaces reflect: from `irradiance`, and that of `coats`, W/(m2 sr)."""
    width, height = graph.size
    radiance = graph.buffer("ssdo/radiance", dtype=FOUR_FLOATS, count=width * height, width=width, nonnegative=True)
    shader = "ssdo/reflect.wgsl"
    graph.compute(
        "ssdo/reflect",
        shader,
        over=(width, height),
        reads={
            "surfaces": gbuffer.surfaces,
            "irradiance": irradiance,
            "coat": graph.neutral("buffer") if coats is None else coats,
        },
        writes={"radiance": radiance},
        constants={**scene.constants(shader), "LOBES": lobes},
    )
    return radiance
