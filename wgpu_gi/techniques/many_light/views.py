"""Debug views of many-light: one pass per view, which runs only if the view is shown."""

from __future__ import annotations

from ...gpu.formats import FOUR_FLOATS
from ...gpu.graph import Graph
from ...gpu.handles import Buffer
from ..shared.gbuffer import Gbuffer
from .gather import Gathered
from .inputs import ManyLightInputs
from .ism import Ism
from .lobes import Lobes
from .rsm import Rsm
from .vpl import Vpls

RSM_KINDS = ("position", "normal", "flux")


def _picture(graph: Graph, name: str) -> Buffer:
    width, height = graph.size
    return graph.buffer(f"debug/{name}", dtype=FOUR_FLOATS, count=width * height, width=width)


def declare_rsm_views(graph: Graph, scene: ManyLightInputs, lobes: Lobes, rsm: Rsm) -> dict[str, Buffer]:
    """Declare the maps of all lights side by side: position in m relative to the scene's origin, normal, flux in W."""
    views = {}
    for number, kind in enumerate(RSM_KINDS):
        picture = views[f"rsm/{kind}"] = _picture(graph, f"rsm_{kind}")
        graph.compute(
            f"debug/rsm_{kind}",
            "many_light/views/rsm.wgsl",
            over=graph.size,
            reads={"rsm_lights": scene.vpl.rsm_lights, "rsm": rsm.buffer},
            writes={"picture": picture},
            constants={"KIND": number, **lobes.constants},
        )
    return views


def declare_vpl_view(graph: Graph, vpls: Vpls) -> dict[str, Buffer]:
    """Declare the flux of the virtual point lights as squares in the picture, W."""
    picture = _picture(graph, "vpl_flux")
    graph.compute(
        "debug/vpl_flux",
        "many_light/views/vpls.wgsl",
        over=vpls.count,
        reads={"vpl_table": vpls.table},
        writes={"picture": picture},
        params={"vpl_count": vpls.count},
        constants=vpls.constants,
        clear=[picture],
    )
    return {"vpl/flux": picture}


def declare_list_view(graph: Graph, gbuffer: Gbuffer, gathered: Gathered, vpls: Vpls) -> dict[str, Buffer]:
    """Declare the number of lights in each pixel's list; return no view without culling."""
    clusters = gathered.clusters
    if not clusters.constants["CULLED"]:
        return {}
    picture = _picture(graph, "gather_lists")
    graph.compute(
        "debug/gather_lists",
        "many_light/views/lists.wgsl",
        over=graph.size,
        reads={"lists": clusters.reads["lists"], "distance": gbuffer.distance},
        writes={"picture": picture},
        params={"vpl_count": vpls.count},
        constants={
            **gbuffer.constants("many_light/views/lists.wgsl"),
            "INTERLEAVE": gathered.interleave,
            "STRIDE": gathered.stride,
            "SLICES": clusters.constants["SLICES"],
        },
    )
    return {"gather/lists": picture}


def declare_ism_views(graph: Graph, ism: Ism) -> dict[str, Buffer]:
    """Declare the distances in the atlas of imperfect shadow maps, and in its samples, metres."""
    views = {}
    for kind in ("atlas", "samples"):
        picture = views[f"ism/{kind}"] = _picture(graph, f"ism_{kind}")
        graph.compute(
            f"debug/ism_{kind}",
            "many_light/views/ism.wgsl",
            over=graph.size,
            reads={"atlas": ism.reads["ism_atlas"], "samples": ism.samples, "ray_hits": ism.ray_hits},
            writes={"picture": picture},
            constants={**ism.constants, "SAMPLES": kind == "samples", "RAY_SPACING": ism.ray_spacing},
        )
    return views


def declare_rejected_view(graph: Graph, rejected: Buffer) -> dict[str, Buffer]:
    """Declare the rejected share of each pixel's history, 0 to 1."""
    picture = _picture(graph, "temporal_rejected")
    graph.compute(
        "debug/temporal_rejected",
        "many_light/views/rejected.wgsl",
        over=graph.size,
        reads={"rejected": rejected},
        writes={"picture": picture},
    )
    return {"temporal/rejected": picture}
