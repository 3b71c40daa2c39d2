"""Shadow maps: all views of all lights in one depth atlas, redrawn only when lights or geometry change.

See-through surfaces have an atlas of their own: behind one, a shadow ray finds how much light passes.

Williams 1978, "Casting Curved Shadows on Curved Surfaces"; filtering in `wgsl/deferred/shadow/lookup.wgsl`.
"""

from __future__ import annotations

from dataclasses import dataclass

from ...gpu.graph import Graph
from ...gpu.handles import Handle, Texture
from ..shared.bounds import NOTHING
from .inputs import DeferredInputs
from .shadow_draws import ShadowPart, slot_bits


@dataclass
class ShadowMaps:
    """Atlases of all shadow views, depth reversed: of what stops light, and of see-through surfaces (None: none)."""

    depth: Texture
    see_through: Texture | None


def shadow_reads(graph: Graph, maps: ShadowMaps | None) -> dict[str, Handle]:
    """Return the atlases as `wgsl/deferred/shadow/lookup.wgsl` binds them."""
    empty = graph.neutral("texture_depth_2d")
    see_through = maps.see_through if maps else None
    return {"shadow_atlas": maps.depth if maps else empty, "see_through_atlas": see_through or empty}


def declare_shadow_maps(graph: Graph, scene: DeferredInputs) -> ShadowMaps | None:
    """Declare the atlases of all shadow views; return None if there are no views."""
    if not scene.direct.atlas_size:
        graph.skip("shadow/opaque", "no light casts shadows", NOTHING)
        return None
    size = scene.direct.atlas_size
    atlas = graph.texture("shadow/atlas", "depth32float", size=(size, size))
    glass = None
    if scene.tints_shadows:
        glass = graph.texture("shadow/see_through_atlas", "depth32float", size=(size, size))
    else:
        graph.skip("shadow/see_through", "no see-through material", NOTHING)
    for part, target in (("opaque", atlas), ("masked", atlas), ("see_through", glass)):
        masked = part != "opaque"
        if target is None:
            continue
        if part == "masked" and not scene.features["HAS_CUT_OUTS"]:
            graph.skip("shadow/masked", "no alpha-masked material", NOTHING)
            continue
        shader = "deferred/shadow/masked.wgsl" if masked else "deferred/shadow/map.wgsl"
        graph.raster(
            f"shadow/{part}",
            shader,
            draw=ShadowPart(scene.shadows, masked),
            index=scene.raster_indices,
            depth=target,
            reads={**scene.surfaces, **scene.raster, "shadow_views": scene.direct.views},
            constants={
                **scene.constants(shader),
                "SLOT_BITS": slot_bits(scene.draws),
                **({"SEE_THROUGH_ONLY": part == "see_through"} if masked else {}),
            },
            load=part == "masked",
        )
    return ShadowMaps(atlas, glass)
