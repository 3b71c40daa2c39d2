"""Screen-space directional occlusion: the environment's light past what is near, and one bounce of all light.

Ritschel et al. 2009, "Approximating Dynamic Global Illumination in Image Space". Departures: several points along each
direction instead of one, of which the first that is hidden counts; directions drawn by the cosine; a sender's area is
what the direction's solid angle cuts out of it, so that there is no strength to set; pixels next to each other share
directions by the pattern of interleaved gathering (Segovia et al. 2006), whose blur serves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..gpu.graph import Graph
from ..gpu.handles import Buffer, Handle, Texture
from ..gpu.wgsl import load
from .denoise import declare_blur
from .environment import Ambient
from .gbuffer import FOUR_FLOATS, SURFACE, Gbuffer
from .scene_inputs import SceneInputs
from .ssdo_sources import Sources, SsdoSettings, view_name

# Sources other than the picture are lit at one pixel in so many in each row and column; chosen.
SENDER_STRIDE = 2
INTERLEAVE = 4  # side of the squares of pixels that share directions; chosen
LAST_MAP = int(load("environment/maps.wgsl").constants["LAST_MAP"])


@dataclass
class Occlusion:
    """What directions meet: `share` of the environment that arrives, (r, g, b, -) per pixel, None without one.

    hits and normals: of the grid's pixels, as `wgsl/ssdo/hits.wgsl` and `wgsl/denoise/plane.wgsl` have them.
    """

    share: Buffer | None
    hits: Buffer
    normals: Buffer


def declare_occlusion(
    graph: Graph, settings: SsdoSettings, scene: SceneInputs, sources: Sources, ambient: Ambient, seed: int
) -> Occlusion:
    """Declare what the directions of each pixel meet, and the share of the environment's light that gets past it."""
    gbuffer, stride = sources.layers[0], _stride(settings)
    occlusion, hits, normals = _declare_search(graph, settings, scene, sources, ambient, seed, 0)
    if not ambient.features["HAS_ENVIRONMENT"]:
        graph.skip("ssdo/share", "there is no environment, or environment.ambient is off")
        return Occlusion(None, hits, normals)
    radius = INTERLEAVE if settings.blur else 1
    share = declare_blur(graph, "ssdo/share", gbuffer, occlusion, normals, radius, stride=stride)
    if settings.half:
        share = _declare_upsampling(graph, scene, "ssdo/share", gbuffer, share, normals, reflected=False)
    return Occlusion(share, hits, normals)


def declare_bounce(
    graph: Graph,
    settings: SsdoSettings,
    scene: SceneInputs,
    sources: Sources,
    occlusion: Occlusion,
    direct: Buffer,
    atlas: Texture | None,
    ambient: Ambient,
    seed: int,
) -> Buffer:
    """Declare the light that the surfaces found reflect, (r, g, b, -) per pixel, W/(m2 sr)."""
    stride = _stride(settings)
    width, height = _grid(graph, stride)
    gbuffer = sources.layers[0]
    senders = _declare_senders(graph, settings, scene, sources, direct, atlas, ambient, seed)
    irradiance = graph.buffer("ssdo/irradiance", dtype=FOUR_FLOATS, count=width * height, width=width, nonnegative=True)
    shader = "ssdo/bounce.wgsl"
    graph.compute(
        "ssdo/bounce",
        shader,
        **_extent(graph, stride, gbuffer),
        reads={
            **(gbuffer.tiles if stride == 1 else {}),
            **sources.reads(graph),
            "surfaces": gbuffer.surfaces,
            "distance": gbuffer.distance,
            "hits": occlusion.hits,
            "senders": senders,
        },
        writes={"irradiance": irradiance},
        params={"pictures": settings.reach},
        constants={
            **scene.constants(shader),
            **_constants(settings, sources, shader),
            "SENDER_STRIDE": SENDER_STRIDE,
        },
        uniforms=sources.uniforms(),
        clear=[irradiance],
    )
    radius = INTERLEAVE if settings.blur else 1
    if not settings.half:
        return declare_blur(graph, "ssdo/bounce", gbuffer, irradiance, occlusion.normals, radius, reflected=True)
    light = declare_blur(graph, "ssdo/bounce", gbuffer, irradiance, occlusion.normals, radius, stride=2)
    return _declare_upsampling(graph, scene, "ssdo/bounce", gbuffer, light, occlusion.normals, reflected=True)


def _declare_search(
    graph: Graph,
    settings: SsdoSettings,
    scene: SceneInputs,
    sources: Sources,
    ambient: Ambient,
    seed: int,
    number: int,
) -> tuple[Buffer, Buffer, Buffer]:
    """Declare what hides the environment from a source, and for the picture itself, number 0, which surfaces do."""
    is_picture = number == 0
    gbuffer = [*sources.layers, *sources.cameras][number]
    stride = _stride(settings) if is_picture else SENDER_STRIDE
    width, height = _grid(graph, stride)
    name = f"ssdo/occlusion_{number}" if number else "ssdo/occlusion"
    count = width * height
    occlusion = graph.buffer(name, dtype=FOUR_FLOATS, count=count, width=width, nonnegative=True)
    normals = graph.buffer(f"{name}_normals", dtype=np.uint32, count=count, width=width)
    hits = graph.buffer(f"{name}_hits", dtype=np.uint32, count=count * settings.directions if is_picture else 1)
    directions = settings.directions if is_picture else 1
    # The map whose lobe has about the solid angle of one of a square's directions: 4 pi alpha^2, alpha = 2^-k.
    lobe = round(0.5 * math.log2(2 * directions * INTERLEAVE**2))
    shader = "ssdo/occlusion.wgsl"
    graph.compute(
        name,
        shader,
        **_extent(graph, stride, gbuffer),
        reads={
            **(gbuffer.tiles if stride == 1 else {}),
            **ambient.reads,
            **sources.reads(graph),
            "surfaces": gbuffer.surfaces,
            "distance": gbuffer.distance,
        },
        writes={"occlusion": occlusion, "normals": normals, "hits": hits},
        params={"seed": seed, "pictures": settings.reach},
        constants={
            **scene.constants(shader),
            **ambient.constants(shader),
            **_constants(settings, sources, shader),
            "DIRECTIONS": directions,
            "STRIDE": stride,
            "INTERLEAVE": INTERLEAVE,
            "DIRECTIONAL": settings.occlusion == "directional",
            "OUTWARD": 0 < number < len(sources.layers),
            "HITS": is_picture,
            "LOBE": min(lobe, LAST_MAP),
        },
        uniforms={**sources.uniforms(), "view": _view_of(sources, number)},
        clear=[occlusion],
    )
    return occlusion, hits, normals


def _declare_senders(
    graph: Graph,
    settings: SsdoSettings,
    scene: SceneInputs,
    sources: Sources,
    direct: Buffer,
    atlas: Texture | None,
    ambient: Ambient,
    seed: int,
) -> Buffer:
    """Declare what the pixels of all sources reflect of light scattered once, one source after the other."""
    assert scene.direct is not None
    width, height = graph.size
    gbuffers = [*sources.layers, *sources.cameras]
    grid = _grid(graph, SENDER_STRIDE)
    further = grid[0] * grid[1]
    senders = graph.buffer("ssdo/senders", dtype=SURFACE, count=width * height + further * (len(gbuffers) - 1))
    graph.compute(
        "ssdo/senders",
        "ssdo/shown.wgsl",
        over=(width, height),
        reads={"surfaces": gbuffers[0].surfaces, "direct": direct},
        writes={"senders": senders},
    )
    shader = "ssdo/senders.wgsl"
    for number, gbuffer in enumerate(gbuffers[1:], 1):
        sky: Handle = graph.neutral("buffer")
        if ambient.features["HAS_ENVIRONMENT"]:
            sky = _declare_further_sky(graph, settings, scene, sources, ambient, seed, number)
        graph.compute(
            f"ssdo/senders_{number}",
            shader,
            over=grid,
            reads={
                **ambient.reads,
                "surfaces": gbuffer.surfaces,
                "distance": gbuffer.distance,
                "sky": sky,
                "light_table": scene.direct.lights,
                "shadow_atlas": atlas if atlas is not None else graph.neutral("texture_depth_2d"),
                "shadow_sampler": graph.sampler("linear", "clamp", "greater-equal"),
            },
            writes={"senders": senders},
            params={"first": width * height + further * (number - 1)},
            constants={
                **scene.constants(shader),
                **ambient.constants(shader),
                "OUTWARD": number < len(sources.layers),
                "STRIDE": SENDER_STRIDE,
            },
            uniforms={"view": _view_of(sources, number)},
        )
    return senders


def _declare_further_sky(
    graph: Graph,
    settings: SsdoSettings,
    scene: SceneInputs,
    sources: Sources,
    ambient: Ambient,
    seed: int,
    number: int,
) -> Buffer:
    """Declare the share of the environment's light that the grid of a source other than the picture gets."""
    gbuffer, view = [*sources.layers, *sources.cameras][number], _view_of(sources, number)
    sky, _, normals = _declare_search(graph, settings, scene, sources, ambient, seed, number)
    radius = INTERLEAVE if settings.blur else 1
    return declare_blur(graph, f"ssdo/share_{number}", gbuffer, sky, normals, radius, stride=SENDER_STRIDE, view=view)


def _declare_upsampling(
    graph: Graph,
    scene: SceneInputs,
    name: str,
    gbuffer: Gbuffer,
    coarse: Buffer,
    normals: Buffer,
    *,
    reflected: bool,
) -> Buffer:
    """Declare light of every other pixel for all of them; `reflected`: as radiance."""
    width, height = graph.size
    fine = graph.buffer(f"{name}/fine", dtype=FOUR_FLOATS, count=width * height, width=width, nonnegative=True)
    shader = "ssdo/upsample.wgsl"
    graph.compute(
        f"{name}/upsample",
        shader,
        over=(width, height),
        reads={"surfaces": gbuffer.surfaces, "distance": gbuffer.distance, "coarse": coarse, "normals": normals},
        writes={"fine": fine},
        constants={**scene.constants(shader), "REFLECTED": reflected},
    )
    return fine


def _stride(settings: SsdoSettings) -> int:
    """Return how far apart the pixels are that are searched for."""
    return 2 if settings.half else 1


def _grid(graph: Graph, stride: int) -> tuple[int, int]:
    """Return how many of them there are in a row and in a column."""
    return -(-graph.size[0] // stride), -(-graph.size[1] // stride)


def _extent(graph: Graph, stride: int, gbuffer: Gbuffer) -> dict[str, Any]:
    """Return which threads a pass over them has."""
    return {"indirect": gbuffer.tile_groups} if stride == 1 else {"over": _grid(graph, stride), "entry": "coarse"}


def _view_of(sources: Sources, number: int) -> str:
    """Return the uniform with the view of a source."""
    return view_name(max(number - len(sources.layers) + 1, 0))


def _constants(settings: SsdoSettings, sources: Sources, shader: str) -> dict[str, int]:
    """Return what all passes share, as far as `shader` declares it."""
    values = {
        "DIRECTIONS": settings.directions,
        "STEPS": settings.steps,
        "LAYERS": len(sources.layers),
        "CAMERAS": len(sources.cameras),
        "STRIDE": _stride(settings),
    }
    return {name: value for name, value in values.items() if name in load(shader).overrides}
