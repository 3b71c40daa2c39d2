"""Shadow maps: all views of all lights in one depth atlas, redrawn only when lights or geometry change.

Williams 1978, "Casting Curved Shadows on Curved Surfaces"; filtering in `wgsl/deferred/shadow/lookup.wgsl`.
"""

from __future__ import annotations

from ...gpu.graph import Graph
from ...gpu.handles import Texture
from .inputs import DeferredInputs
from .shadow_draws import ShadowPart, slot_bits


def declare_shadow_maps(graph: Graph, scene: DeferredInputs) -> Texture | None:
    """Declare the atlas of all shadow views, depth reversed; return None if there are no views."""
    if not scene.direct.atlas_size:
        graph.skip("shadow/opaque", "no light casts shadows")
        return None
    size = scene.direct.atlas_size
    atlas = graph.texture("shadow/atlas", "depth32float", size=(size, size))
    for part, masked in (("opaque", False), ("masked", True)):
        if masked and not scene.draws.masked:
            graph.skip("shadow/masked", "no alpha-masked material")
            continue
        shader = "deferred/shadow/masked.wgsl" if masked else "deferred/shadow/map.wgsl"
        graph.raster(
            f"shadow/{part}",
            shader,
            draw=ShadowPart(scene.shadows, masked),
            index=scene.raster_indices,
            depth=atlas,
            reads={**scene.surfaces, **scene.raster, "shadow_views": scene.direct.views},
            constants={**scene.constants(shader), "SLOT_BITS": slot_bits(scene.draws)},
            load=masked,
        )
    return atlas
