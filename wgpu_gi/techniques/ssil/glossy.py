"""Reflections of coats: the last bounce of SSIL, along directions drawn from the coat.

Soler et al. 2010, "A Deferred Shading Algorithm for Real-Time Indirect Illumination", section 4, "Screen-space
importance sampling". Departure: the paper draws pixels around the projected mirror direction. Few of them lie in a
narrow lobe, and their discs widen it; so directions are drawn from the BRDF instead, and SSDO's march through the
picture finds what they hit.
"""

from __future__ import annotations

from ...gpu.formats import FOUR_FLOATS
from ...gpu.graph import Graph
from ...gpu.handles import Buffer
from ..deferred.environment import Ambient
from ..deferred.inputs import DeferredInputs
from ..shared.denoise import declare_blur
from ..shared.gbuffer import SURFACE, Gbuffer
from ..shared.upsample import declare_upsampling
from ..ssdo.bounce import coat_buffer, declare_gathered, declare_gathered_unrepresented
from ..ssdo.search import declare_search, declare_unrepresented
from ..ssdo.search_request import INTERLEAVE, SearchRequest
from ..ssdo.senders import declare_first_layer_senders
from ..ssdo.settings import SsdoSettings
from ..ssdo.sources import Sources


def declare_glossy(
    graph: Graph,
    scene: DeferredInputs,
    gbuffer: Gbuffer,
    ambient: Ambient,
    direct: Buffer,
    irradiance: Buffer | None,
    directions: int,
    seed: int,
    *,
    full: bool,
) -> Buffer | None:
    """Declare the coats' reflection of all pixels, W/(m2 sr) over their tint; None without coats or directions.

    Senders reflect `direct` light, W/(m2 sr), and the `irradiance` of the bounces before, W/m2, of all pixels. full:
    directions start from every pixel, not from every second one of every second row.
    """
    if not scene.features["HAS_COATS"] or not directions:
        graph.skip("ssil/glossy", "every material is Lambert" if directions else "ssil.glossy_samples is 0")
        return None
    # Find what the directions hit; the environment is not part of the bounces.
    settings = SsdoSettings(directions=directions, half_resolution=not full)
    sources = Sources([gbuffer], [])
    dark = Ambient(ambient.reads, dict.fromkeys(ambient.features, False))
    request = SearchRequest(graph, settings, scene, sources, dark, seed, coats=True, base=False)
    search = declare_search(request)
    declare_unrepresented(request, search, None)
    # Gather, and average over the squares of pixels that share a set of directions.
    width, height = graph.size
    senders = graph.buffer("ssdo/senders", dtype=SURFACE, count=width * height)
    declare_first_layer_senders(graph, scene, gbuffer, direct, senders, irradiance)
    coats = coat_buffer(graph, search)
    declare_gathered(graph, settings, scene, sources, search, senders, coats)
    glossy = declare_blur(graph, "ssil/glossy", gbuffer, coats, search.normals, INTERLEAVE, stride=search.stride)
    if search.guide is not None:
        glossy = declare_upsampling(graph, scene, "ssil/glossy", gbuffer, glossy, search.guide, reflected=False)
        nothing = graph.buffer("ssil/no_irradiance", dtype=FOUR_FLOATS, count=1)
        declare_gathered_unrepresented(
            graph, settings, scene, sources, search, senders, nothing, glossy, reflected=False
        )
    return glossy
