"""The environment's light that reaches each pixel past the occluders in screen space.

Ritschel et al. 2009, "Approximating Dynamic Global Illumination in Image Space", section 3. Departures: those of
`search.py`; a share of the unoccluded irradiance, per colour, scales the prefiltered environment's light.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from ...gpu.graph import Graph
from ...gpu.handles import Buffer
from ..deferred.environment import Ambient
from ..deferred.inputs import DeferredInputs
from ..deferred.sky import declare_sky_light
from ..shared.bounds import scattered_more, sky_at_most
from ..shared.denoise import declare_blur, declare_filter
from ..shared.gbuffer import Gbuffer
from ..shared.radiance_cache import RadianceCache, declare_cache
from ..shared.temporal import TemporalSettings, declare_accumulate
from ..shared.upsample import declare_upsampling
from .search import declare_search, declare_unrepresented
from .search_request import INTERLEAVE, SearchRequest, SearchResult
from .settings import SsdoSettings
from .sky_coat import declare_sky_coat, declare_unrepresented_sky_coat
from .slices import declare_slices, declare_unrepresented_slices
from .sources import Sources

STEP = 7  # pixels between neighbours of the mean over frames: the blur at half resolution reaches as far


@dataclass
class Occlusion:
    """sky: the environment's light, occluded, (r, g, b, 1) per pixel, W/(m2 sr); None: no environment.

    coats: the search along directions drawn from coats, if it is not part of `search`; None: there are no coats.
    """

    sky: Buffer | None
    search: SearchResult
    coats: SearchResult | None = None


@dataclass
class History:
    """Accumulation of light over frames; `settings.frames` = 1 turns it off."""

    settings: TemporalSettings
    motion: Buffer

    def declare(
        self, graph: Graph, scene: DeferredInputs, gbuffer: Gbuffer, light: Buffer, name: str, *, coat: bool = False
    ) -> Buffer:
        """Declare the mean of light (r, g, b, w) per pixel; w above 0 marks pixels with a surface to light.

        coat: the light is what coats reflect.
        """
        if self.settings.frames == 1:
            return light
        return declare_accumulate(
            graph, self.settings, scene, gbuffer, self.motion, light, name, step=STEP, coat=coat
        ).averaged


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
    reflects: bool = True,
    one_bounce: bool = False,
) -> Occlusion:
    """Declare the search from each pixel, and the environment's light past the occluders.

    `frames`: number per still picture. `directional`: False makes the share grey (ambient occlusion). `reflects`: find
    the light that the occluders reflect, too; `one_bounce`: only of sources.
    """
    gbuffer = sources.layers[0]
    rays = settings.undecided == "rays"
    request = SearchRequest(
        graph,
        settings,
        scene,
        sources,
        ambient,
        seed,
        directional=directional,
        coats=directional,
        rays=rays,
        reflects=reflects,
        cache=_declare_cache(graph, settings, scene, needed=rays and reflects),
        one_bounce=one_bounce,
        sliced=settings.sampling == "slices",
    )
    search = declare_slices(request) if request.sliced else declare_search(request)
    coats = _declare_coats(request, search)
    finish = declare_unrepresented_slices if request.sliced else declare_unrepresented
    if not ambient.features["HAS_ENVIRONMENT"]:
        graph.skip("ssdo/share", "there is no environment, or environment.ambient is off", sky_at_most(scene))
        finish(request, search, None)
        return Occlusion(None, search, coats)
    # Shadows of the sky have edges beside walls, so guide the blur along them.
    share = declare_full_resolution(
        graph,
        "ssdo/share",
        settings,
        scene,
        gbuffer,
        search.light,
        search,
        frames=frames,
        divisor=search.unoccluded,
    )
    finish(request, search, share)
    averaged = history.declare(graph, scene, gbuffer, share, "ssdo/share")
    sky = _declare_sky(graph, settings, scene, sources, ambient, coats or search, averaged)
    return Occlusion(sky, search, coats)


def _declare_cache(
    graph: Graph, settings: SsdoSettings, scene: DeferredInputs, *, needed: bool
) -> RadianceCache | None:
    """Declare the radiance cache if the settings ask for it; `needed`: rays look for reflected light."""
    if settings.offscreen == "cache" and needed:
        return declare_cache(graph)
    # Without the cache, rays find what surfaces out of view reflect of direct light, but not of further bounces.
    chosen = settings.offscreen == "cache"
    reason = "no ray looks for reflected light" if chosen else "ssdo.offscreen is none"
    graph.skip("ssdo/offscreen", reason, scattered_more(scene, 2 if needed else 1))
    return None


def _declare_sky(
    graph: Graph,
    settings: SsdoSettings,
    scene: DeferredInputs,
    sources: Sources,
    ambient: Ambient,
    search: SearchResult,
    share: Buffer,
) -> Buffer:
    """Declare the environment's light, occluded, (r, g, b, 1) per pixel, W/(m2 sr).

    search: along directions drawn from coats. share: of the base's light.
    """
    gbuffer = sources.layers[0]
    if not (search.by_rays and search.lobes):
        # Coats take the base's share.
        return declare_sky_light(graph, scene, gbuffer, ambient, share, share)
    # Coats reflect what their directions find. That depends on the view and is not accumulated.
    coat, whole = declare_sky_coat(graph, scene, sources, ambient, search)
    coat = declare_full_resolution(
        graph, "ssdo/sky_coat", settings, scene, gbuffer, coat, search, divisor=whole, lobes=True
    )
    declare_unrepresented_sky_coat(graph, scene, sources, ambient, search, coat)
    return declare_sky_light(graph, scene, gbuffer, ambient, share, coat, coat_light=whole is None)


def _declare_coats(request: SearchRequest, search: SearchResult) -> SearchResult | None:
    """Declare the search along directions drawn from coats, beside a search by slices."""
    if not (request.sliced and request.coats and request.scene.features["HAS_COATS"]):
        return None
    coats = replace(request, sliced=False, base=False, prefix="ssdo/coats_")
    result = declare_search(coats, search.guide)
    declare_unrepresented(coats, result, None)
    return result


def declare_full_resolution(
    graph: Graph,
    name: str,
    settings: SsdoSettings,
    scene: DeferredInputs,
    gbuffer: Gbuffer,
    light: Buffer,
    search: SearchResult,
    *,
    frames: int = 1,
    divisor: Buffer | None = None,
    levels: int = 0,
    reflected: bool = False,
    lobes: bool = False,
) -> Buffer:
    """Declare light of the search grid, blurred over its squares and upsampled to all pixels.

    divisor: its blurred values divide the blurred light. levels: of the a-trous filter, without a divisor. reflected:
    irradiance becomes radiance, W/(m2 sr). lobes: light of coats, blurred by no more than their lobes.
    """
    radius, arguments = INTERLEAVE if settings.blur else 1, (graph, name, gbuffer, light, search.normals)
    if divisor is None and not lobes:
        reflects = reflected and search.guide is None
        filtered = declare_filter(*arguments, radius, levels, frames=frames, reflected=reflects, stride=search.stride)
        blurred = filtered.light
    else:
        blurred = declare_blur(*arguments, radius, frames=frames, lobes=lobes, glossy=divisor, stride=search.stride)
    if search.guide is None:
        return blurred
    return declare_upsampling(graph, scene, name, gbuffer, blurred, search.guide, reflected=reflected)
