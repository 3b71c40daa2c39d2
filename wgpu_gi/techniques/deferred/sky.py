"""The environment's light at each pixel, occluded: the unoccluded light times its visible share.

A few rays and a blur find the share, of the base's light and of the coat's: a lobe sees another part of the environment
than the hemisphere does. Interleaved like the gathering of virtual point lights (Segovia et al. 2006), so both have one
blur.
"""

from __future__ import annotations

import numpy as np

from ...gpu.formats import FOUR_FLOATS
from ...gpu.graph import Graph
from ...gpu.handles import Buffer, Handle
from ..shared.bounds import NOTHING, sky_unoccluded
from ..shared.denoise import declare_blur
from ..shared.gbuffer import Gbuffer
from ..shared.sampling import STILL_SEQUENCE
from ..shared.scene_inputs import SceneInputs
from .environment import Ambient, EnvironmentSettings

# Side of the squares of pixels that share directions, and of the blur: tools/README.md, "Constants".
INTERLEAVE = 4


def declare_sky(
    graph: Graph,
    settings: EnvironmentSettings,
    scene: SceneInputs,
    gbuffer: Gbuffer,
    ambient: Ambient,
    seed: int,
    frames: int,
) -> Buffer | None:
    """Declare the environment's reflected light, occluded, (r, g, b, 1) per pixel, W/(m2 sr); None: occlusion is off.

    frames: number per still picture.
    """
    if not (settings.ambient and settings.rays and scene.features["HAS_ENVIRONMENT"]):
        absent = not scene.features["HAS_ENVIRONMENT"]
        reason = "there is no environment" if absent else "environment.rays is 0 or ambient off"
        graph.skip("sky/occlusion", reason, NOTHING if absent else sky_unoccluded(scene))
        return None
    base = _declare_share(graph, "sky", settings.rays, scene, gbuffer, ambient, seed, frames, coat=False)
    coat: Handle = graph.neutral("buffer")
    if scene.features["HAS_COATS"]:
        coat = _declare_share(graph, "sky_coat", settings.rays, scene, gbuffer, ambient, seed, frames, coat=True)
    return declare_sky_light(
        graph, scene, gbuffer, ambient, base, coat, coat_light=scene.features["HAS_PICTURED_ENVIRONMENT"]
    )


def declare_sky_light(
    graph: Graph,
    scene: SceneInputs,
    gbuffer: Gbuffer,
    ambient: Ambient,
    base: Handle,
    coat: Handle,
    *,
    coat_light: bool = False,
) -> Buffer:
    """Declare the environment's reflected light, (r, g, b, 1) per pixel, W/(m2 sr), of given unoccluded shares.

    base, coat: shares of the base's and the coat's light, (r, g, b, -) per pixel; `coat` is read if there are coats.
    coat_light: `coat` has the light that the coat reflects, over its tint, instead of a share.
    """
    width, height = graph.size
    light = graph.buffer("sky/light", dtype=FOUR_FLOATS, count=width * height, width=width, nonnegative=True)
    shader = "deferred/sky/light.wgsl"
    graph.compute(
        "sky/light",
        shader,
        indirect=gbuffer.tile_groups,
        reads={
            **gbuffer.tiles,
            **ambient.reads,
            "surfaces": gbuffer.surfaces,
            "distance": gbuffer.distance,
            "base_share": base,
            "coat_share": coat,
        },
        writes={"light": light},
        constants={**scene.constants(shader), **ambient.constants(shader), "COAT_LIGHT": coat_light},
        clear=[light],
    )
    return light


def _declare_share(
    graph: Graph,
    name: str,
    rays: int,
    scene: SceneInputs,
    gbuffer: Gbuffer,
    ambient: Ambient,
    seed: int,
    frames: int,
    *,
    coat: bool,
) -> Buffer:
    """Declare the unoccluded share of the environment's light of the base or the coat, (r, g, b, -) per pixel.

    Of a coat under a picture: the light that it reflects, over its tint, W/(m2 sr).
    """
    width, height = graph.size
    # Under a picture, coats take the light itself: the prefiltered light is too far from it at glancing angles. Under a
    # constant environment, the light that arrives at a base is the share itself.
    pictured = scene.features["HAS_PICTURED_ENVIRONMENT"]
    relative = not pictured
    divided = coat != pictured
    arriving = graph.buffer(f"{name}/arriving", dtype=FOUR_FLOATS, count=width * height, width=width, nonnegative=True)
    sent = graph.buffer(
        f"{name}/sent", dtype=FOUR_FLOATS, count=width * height if divided else 1, width=width, nonnegative=True
    )
    normals = graph.buffer(f"{name}/normals", dtype=np.uint32, count=width * height, width=width)
    shader = "deferred/sky/occlusion.wgsl"
    graph.compute(
        f"{name}/occlusion",
        shader,
        indirect=gbuffer.tile_groups,
        reads={
            **scene.surfaces,
            **gbuffer.tiles,
            **scene.lights,
            **ambient.reads,
            "visibility": gbuffer.visibility,
            "surfaces": gbuffer.surfaces,
            "distance": gbuffer.distance,
        },
        writes={"arriving": arriving, "normals": normals, "sent": sent},
        params={"seed": seed, "rays": rays},
        constants={**scene.constants(shader), **ambient.constants(shader), "INTERLEAVE": INTERLEAVE, "COAT": coat},
        uniforms=STILL_SEQUENCE,
        clear=[arriving, sent],
    )
    whole = sent if divided else None
    return declare_blur(
        graph, name, gbuffer, arriving, normals, INTERLEAVE, frames=frames, shares=relative, lobes=coat, glossy=whole
    )
