"""Light that rough walls and solid glass transmit to the eye: by paths from the pixels that show them.

A path follows the BRDF through such surfaces (Walter et al. 2007, "Microfacet Models for Refraction through Rough
Surfaces") and takes what the picture shows of the first other surface. The light is added after all filters, which
would blur what is seen through glass. Thin smooth walls need no paths: pixels pass them.

Left out: caustics. Shadow rays pass glass straight on, tinted (`wgsl/scene/see_through.wgsl`).
"""

from __future__ import annotations

from dataclasses import replace

from ...gpu.formats import FOUR_FLOATS
from ...gpu.graph import Graph
from ...scene.scene import Scene
from ...upload.layers import is_clear
from ..shared.bounds import NOTHING
from ..shared.gbuffer import Gbuffer
from ..shared.technique import Light
from .inputs import DeferredInputs

MOST_BOUNCES = 3  # of light at points that the picture does not show
SHADER = "deferred/transmission/transmission.wgsl"


def draws_transmission(scene: Scene, *, diffuse: bool) -> bool:
    """Return whether each frame draws other paths through a material; `diffuse`: all materials are Lambert."""
    return not diffuse and any(m.transmission > 0 and not m.unlit for m in scene.materials)


def finds_light_in_picture(scene: Scene, *, diffuse: bool) -> bool:
    """Return whether pixels show the light of others through rough or solid glass; `diffuse`: as above."""
    materials = [m for m in scene.materials if m.transmission > 0 and not m.unlit]
    return not diffuse and any(not is_clear(m) or m.metallic_roughness_texture is not None for m in materials)


def with_transmission(
    graph: Graph, scene: DeferredInputs, gbuffer: Gbuffer, light: Light, bounces: int | None, seed: int
) -> Light:
    """Return the light of a technique, with that of transmitting surfaces among its indirect light.

    `bounces`: of the technique's indirect light; 0: surfaces behind glass reflect direct light only.
    """
    if not scene.features["HAS_TRANSMISSION"]:
        graph.skip("transmission", "no material transmits light", NOTHING)
        return light
    width, height = graph.size
    total = graph.buffer("transmission", dtype=FOUR_FLOATS, count=width * height, width=width, nonnegative=True)
    graph.compute(
        "transmission",
        SHADER,
        over=(width, height),
        reads={
            **scene.surfaces,
            **scene.lights,
            "visibility": gbuffer.visibility,
            "distance": gbuffer.distance,
            "direct": light.direct,
            "indirect": light.indirect or graph.neutral("buffer"),
        },
        writes={"sum": total},
        params={"seed": seed},
        constants={
            **scene.constants(SHADER),
            "HAS_INDIRECT": light.indirect is not None,
            "BOUNCES": MOST_BOUNCES if bounces is None else min(bounces, MOST_BOUNCES),
        },
    )
    return replace(light, indirect=total)
