"""Direct light: shadow maps, with rays where a shadow's edge crosses a pixel; emitters; and the environment's light.

Hertel et al. 2009, "A Hybrid GPU Rendering Pipeline for Alias-Free Hard Shadows". Departure: only pixels whose filter
finds both lit and shadowed texels trace rays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...gpu.formats import FOUR_FLOATS
from ...gpu.graph import Graph
from ...gpu.handles import Buffer
from ...gpu.wgsl.load import load
from ...records import KnownAttributes
from ...scene.scene import Scene
from ...settings import setting
from ...upload.light_values import emitted_radiance
from ..shared.bounds import ELSEWHERE, NOTHING, SAVES
from ..shared.gbuffer import Gbuffer
from .emitters import declare_emitters
from .environment import Ambient
from .inputs import DeferredInputs, DirectInputs
from .shadow import ShadowMaps, shadow_reads

TILE = int(load("deferred/direct/tile.wgsl").constants["TILE"])
UNROLLED = 3  # up to this many lights, the shader has no loop
# Lights per pass of shadow rays where drivers cut loops: a ray takes about a hundred iterations; llvmpipe (Mesa 22)
# allows 65,535 per invocation.
EDGE_LIGHTS = 64
TILED_FROM = 8  # number of bounded lights from which lists save time: tools/README.md, "Constants"


@dataclass(repr=False, slots=True)
class DirectSettings(KnownAttributes):
    """Direct light."""

    samples: int = setting(
        16,
        "Lights sampled on all emitters together, with emitters `maps`.",
        "lights",
        range=(1, 4096),
        presets={"low": 8, "high": 64},
    )
    emitters: str = setting(
        "rays",
        "Direct light of emitters: by rays to other points in each frame (rays), or by fixed sample lights with shadow"
        " maps (maps).",
        choices=("rays", "maps"),
    )
    rays: int = setting(
        4,
        "Rays per pixel and frame to emitters, with emitters `rays`; rounded up to an even number.",
        "rays",
        range=(2, 64),
        presets={"low": 2, "high": 8},
    )
    edges: bool = setting(
        True,
        "Trace shadow rays where shadow maps are undecided, instead of filtering. Scenes with see-through surfaces"
        " always do.",
    )
    tiles: bool = setting(True, "Cull lights by tiles of 16x16 pixels if there are many.")
    contacts: int = setting(
        0,
        "Steps of a screen-space shadow ray across a shadow map's bias; 0: none. Has no effect with direct.edges.",
        "points",
        range=(0, 64),
    )
    range: bool = setting(False, "End lights at the range given in the file; physical lights have none.")


def draws_emitters(settings: DirectSettings, scene: Scene) -> bool:
    """Return whether each frame draws other points of emitters."""
    return settings.emitters == "rays" and any(emitted_radiance(m).any() and not m.unlit for m in scene.materials)


def declare_direct(
    graph: Graph,
    settings: DirectSettings,
    scene: DeferredInputs,
    gbuffer: Gbuffer,
    maps: ShadowMaps | None,
    ambient: Ambient,
    seed: int,
    sky: Buffer | None = None,
    layers: Sequence[Gbuffer] = (),
) -> Buffer:
    """Declare direct light reflected to the eye: (r, g, b, 1) per pixel, W/(m2 sr).

    `sky`: light of the environment at each pixel, occluded, (r, g, b, 1); None: it is not occluded. `layers`: at most
    four layers of depth peeling; `gbuffer` is the first.
    """
    direct = _declare_mapped(graph, settings, scene, gbuffer, maps, ambient, sky, layers)
    if not scene.emitters.leaves:
        by_maps = settings.emitters == "maps"
        reason = "direct.emitters is maps" if by_maps else "nothing emits light"
        graph.skip("emitters", reason, ELSEWHERE if by_maps else NOTHING)
        return direct
    return declare_emitters(graph, scene, gbuffer, direct, settings.rays, seed)


def _declare_mapped(
    graph: Graph,
    settings: DirectSettings,
    scene: DeferredInputs,
    gbuffer: Gbuffer,
    maps: ShadowMaps | None,
    ambient: Ambient,
    sky: Buffer | None,
    layers: Sequence[Gbuffer],
) -> Buffer:
    """Declare the light of the sources with shadow maps, and of the environment; arguments as in `declare_direct`."""
    width, height = graph.size
    direct = graph.buffer("direct/light", dtype=FOUR_FLOATS, count=width * height, width=width, nonnegative=True)
    # How much light passes see-through surfaces, only rays find.
    traced = maps is not None and (settings.edges or scene.tints_shadows)
    edges = graph.buffer("direct/edges", dtype=np.uint32, count=width * height if traced else 1)
    edge_groups = graph.buffer("direct/edge_groups", dtype=np.uint32, count=4)
    tiles = _declare_tiles(graph, settings, scene.direct, gbuffer)
    inputs = {
        "surfaces": gbuffer.surfaces,
        "distance": gbuffer.distance,
        "light_table": scene.direct.lights,
        **shadow_reads(graph, maps),
        "shadow_sampler": graph.sampler("linear", "clamp", "greater-equal"),
        "gather_sampler": graph.sampler("nearest"),
        "sky": sky or graph.neutral("buffer"),
        **ambient.reads,
    }
    shader = "deferred/direct/light.wgsl"
    few = scene.direct.count if scene.direct.count <= UNROLLED else 0
    occluded = {"SKY": sky is not None}
    shown = layers or (gbuffer,)
    contacts = {"CONTACTS": settings.contacts > 0, "CONTACT_POINTS": settings.contacts, "LAYERS": len(shown)}
    variant = {"TILED": tiles is not None, "EDGES": traced, "FEW": few, **occluded, **contacts}
    graph.compute(
        "direct/light",
        shader,
        indirect=gbuffer.tile_groups,
        reads={
            **inputs,
            **gbuffer.tiles,
            "tile_lights": tiles or graph.neutral("buffer"),
            **{f"depth_{k}": graph.neutral("texture_depth_2d") for k in range(4)},
            **{f"depth_{k}": layer.depth for k, layer in enumerate(shown)},
        },
        writes={"direct": direct, "edges": edges, "edge_groups": edge_groups},
        constants={**scene.constants(shader), **ambient.constants(shader), **variant},
        uniforms={"view_0": "view"},
        clear=[direct, edge_groups],
    )
    if traced:
        inputs_of_edges = {**inputs, "visibility": gbuffer.visibility, "edges": edges}
        constants = {**ambient.constants("deferred/direct/edges.wgsl"), **occluded}
        _declare_edges(graph, scene, constants, inputs_of_edges, edge_groups, direct)
    else:
        reason = "no light casts shadows" if maps is None else "direct.edges is off"
        graph.skip("direct/edges", reason, NOTHING if maps is None else ELSEWHERE)
    return direct


def _declare_tiles(graph: Graph, settings: DirectSettings, lights: DirectInputs, gbuffer: Gbuffer) -> Buffer | None:
    """Declare one bit per tile and light: the light can reach the tile. None where lists cost more than they save."""
    if not settings.tiles or lights.bounded < TILED_FROM:
        reason = f"fewer than {TILED_FROM} lights have a cone or a range" if settings.tiles else "direct.tiles is off"
        graph.skip("direct/tiles", reason, SAVES)
        return None
    width, height = graph.size
    columns, rows = -(-width // TILE), -(-height // TILE)
    words = -(-lights.count // 32)
    tiles = graph.buffer("direct/tiles", dtype=np.uint32, count=columns * rows * words)
    graph.compute(
        "direct/tiles",
        "deferred/direct/tiles.wgsl",
        over=(width, height),
        reads={"light_table": lights.lights, "distance": gbuffer.distance},
        writes={"tile_lights": tiles},
    )
    return tiles


def _declare_edges(
    graph: Graph,
    scene: DeferredInputs,
    ambient: dict[str, bool],
    inputs: dict[str, Any],
    edge_groups: Buffer,
    direct: Buffer,
) -> None:
    """Declare the passes that light listed pixels by rays: one per EDGE_LIGHTS lights if the driver cuts loops."""
    shader = "deferred/direct/edges.wgsl"
    cuts_loops = graph.device.capabilities.cuts_loops
    per_pass = EDGE_LIGHTS if cuts_loops else scene.direct.count
    for first in range(0, scene.direct.count, per_pass):
        graph.compute(
            f"direct/edges_{first}" if first else "direct/edges",
            shader,
            indirect=edge_groups,
            reads={**scene.surfaces, **inputs, "edge_groups": edge_groups},
            writes={"direct": direct},
            params={"first": first, "end": first + per_pass},
            constants={**scene.constants(shader), **ambient, "CUTS_LOOPS": cuts_loops},
        )
