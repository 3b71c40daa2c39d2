"""The frame: every technique in order, and what can be shown of it. The first page to read."""

from __future__ import annotations

from .buffers import Absent, Source, views_of
from .gpu.graph import Graph
from .gpu.handles import Buffer
from .options import POINTS, Settings, picture_count
from .techniques.deferred.direct import declare_direct
from .techniques.deferred.environment import Ambient, declare_environment
from .techniques.deferred.shadow import ShadowDraws, declare_shadow_maps
from .techniques.deferred.sky import declare_sky_occlusion
from .techniques.many_light.compensation import declare_compensation
from .techniques.many_light.filters import declare_denoise, declare_temporal
from .techniques.many_light.gather import declare_gather
from .techniques.many_light.ism import declare_ism
from .techniques.many_light.near import declare_near, declare_near_shares
from .techniques.many_light.points import declare_points
from .techniques.many_light.rsm import declare_rsm
from .techniques.many_light.views import (
    declare_ism_views,
    declare_list_view,
    declare_rejected_view,
    declare_rsm_views,
    declare_vpl_view,
)
from .techniques.many_light.vpl import declare_vpls, declare_walk
from .techniques.reference import declare_primary, declare_reference, path_runs
from .techniques.shared.composite import declare_display, declare_mean, declare_sum
from .techniques.shared.gbuffer import Gbuffer, declare_gbuffer, declare_motion
from .techniques.shared.scene_inputs import SceneInputs
from .techniques.ssdo.bounce import History, Occlusion, declare_bounce, declare_occlusion
from .techniques.ssdo.sources import Sources, declare_sources
from .techniques.ssil.ssil import declare_ssil


def declare_frame(
    graph: Graph, settings: Settings, scene: SceneInputs, shadows: ShadowDraws, extra_runs: int = 0
) -> dict[str, Source]:
    """Declare the passes of a frame; return what can be shown, by the names of BUFFERS.

    `extra_runs` are for pixels whose paths are too long to be done in the runs planned.
    """
    declare = _declare_path if settings.gi == "path" else _declare_deferred
    shown = declare(graph, settings, scene, shadows, extra_runs)
    radiance = shown["radiance"].handle
    assert isinstance(radiance, Buffer)
    primary = declare_primary(graph, scene)
    return shown | {
        "display": Source(declare_display(graph, radiance, settings.exposure)),
        "albedo": Source(primary.albedo),
        "normal": Source(primary.normal),
        "depth": Source(primary.normal, 3, 1),
        "position": Source(primary.position),
        "instance": Source(primary.position, 3, 1),
    }


def _declare_path(
    graph: Graph, settings: Settings, scene: SceneInputs, shadows: ShadowDraws, extra_runs: int
) -> dict[str, Source]:
    runs = path_runs(settings.path, settings.spp) + extra_runs
    reference = declare_reference(
        graph, settings.path, scene, spp=settings.spp, runs=runs, bounces=settings.bounces, seed=settings.seed
    )
    layers = ("radiance", "direct", "indirect", "emission", "standard_error")
    return {name: Source(getattr(reference, name)) for name in layers}


def _declare_deferred(
    graph: Graph, settings: Settings, scene: SceneInputs, shadows: ShadowDraws, extra_runs: int
) -> dict[str, Source]:
    sources: Sources | None = declare_sources(graph, scene) if settings.gi == "ssdo" else None
    gbuffer = declare_gbuffer(graph, scene)[0] if sources is None else sources.layers[0]
    motion = declare_motion(graph, scene, gbuffer)
    reflects = settings.gi == "many-light" and settings.bounces != 0
    ambient = declare_environment(graph, settings.environment, scene, lobes=settings.gi == "ssdo", albedo=reflects)
    atlas = declare_shadow_maps(graph, scene, shadows)
    frames = picture_count(settings)
    history = History(settings.temporal, motion)
    sky: Buffer | None = None
    occlusion: Occlusion | None = None
    if sources is not None:
        occlusion = declare_occlusion(graph, settings.ssdo, scene, sources, ambient, history, settings.seed, frames)
        sky = occlusion.share
    elif settings.gi != "none":
        sky = declare_sky_occlusion(graph, settings.environment, scene, gbuffer, settings.seed, frames)
    layers_shown = sources.layers if sources is not None else ()
    direct = declare_direct(graph, settings.direct, scene, gbuffer, atlas, ambient, sky, layers_shown)
    indirect: Buffer | None = None
    views: dict[str, Buffer] = {}
    if reflects:
        indirect, views = _declare_many_light(graph, settings, scene, gbuffer, motion, direct, ambient)
    if sources is not None and occlusion is not None and settings.bounces != 0 and settings.ssdo.bounce:
        indirect = declare_bounce(
            graph, settings.ssdo, scene, sources, occlusion, direct, atlas, ambient, history, settings.seed
        )
    if settings.gi == "ssil" and settings.bounces != 0:
        indirect = _declare_ssil(graph, settings, scene, gbuffer, motion, direct)
    radiance = declare_sum(graph, gbuffer.emission, direct, indirect)
    layers = {"radiance": radiance, "direct": direct, "indirect": indirect, "emission": gbuffer.emission}
    if frames > 1:
        layers = {name: declare_mean(graph, name, layer) if layer else None for name, layer in layers.items()}
    shown = {name: Source(layer) for name, layer in (layers | {"motion": motion} | views).items()}
    return {name: Absent(name) for name in views_of(settings.gi)} | shown


def _declare_ssil(
    graph: Graph, settings: Settings, scene: SceneInputs, gbuffer: Gbuffer, motion: Buffer, direct: Buffer
) -> Buffer:
    """Declare light from all that the picture shows (Soler 2010)."""
    s = settings
    return declare_ssil(graph, s.ssil, s.voxels, s.temporal, scene, gbuffer, motion, direct, s.bounces, s.seed)


def _declare_many_light(
    graph: Graph,
    settings: Settings,
    scene: SceneInputs,
    gbuffer: Gbuffer,
    motion: Buffer,
    direct: Buffer,
    ambient: Ambient,
) -> tuple[Buffer | None, dict[str, Buffer]]:
    """Declare light from virtual point lights (Linke 2016), None where none can be reflected; and its debug views."""
    albedo = ambient.reads["ambient_albedo"]
    points = declare_points(graph, scene, POINTS, albedo)
    rsm = declare_rsm(graph, settings.rsm, scene, albedo, settings.seed)
    walk = declare_walk(graph, settings.vpl, scene, points, albedo, settings.bounces, settings.seed)
    if rsm is None and walk is None:
        return None, {}
    vpls = declare_vpls(graph, settings.vpl, rsm, walk, gbuffer, settings.seed)
    ism = declare_ism(graph, settings.ism, scene, points, vpls) if settings.gather.visibility == "ism" else None
    near = declare_near_shares(graph, settings.ssdo, gbuffer, vpls)
    gathered = declare_gather(graph, settings.gather, scene, gbuffer, vpls, ism, settings.seed, near)
    views = declare_vpl_view(graph, vpls) | declare_list_view(graph, settings.gather, gbuffer, gathered.clusters, vpls)
    if rsm is not None:
        views |= declare_rsm_views(graph, scene, rsm)
    if ism is not None:
        views |= declare_ism_views(graph, ism)
    gathered = declare_compensation(graph, scene, gbuffer, direct, gathered, settings.bounces, settings.seed)
    if near is not None:
        gathered = declare_near(
            graph, settings.ssdo, scene, gbuffer, ambient, direct, gathered, settings.bounces, settings.seed
        )
    if settings.temporal.frames > 1:
        accumulated = declare_temporal(graph, settings.temporal, scene, gbuffer, motion, gathered)
        gathered = accumulated.gathered
        views |= declare_rejected_view(graph, accumulated.rejected)
    return declare_denoise(graph, settings.denoise, gbuffer, gathered, picture_count(settings)), views
