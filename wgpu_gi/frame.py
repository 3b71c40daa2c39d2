"""The frame: every technique in order, and what can be shown of it. The first page to read."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cache

from .errors import GiError
from .gpu.device import Device
from .gpu.graph import Graph
from .gpu.handles import Buffer, Handle
from .scene.sequences import GOLDEN, R2
from .settings import setting
from .techniques.compensation import declare_compensation
from .techniques.composite import declare_display, declare_mean, declare_sum
from .techniques.debug import (
    declare_ism_views,
    declare_list_view,
    declare_rejected_view,
    declare_rsm_views,
    declare_vpl_view,
)
from .techniques.denoise import DenoiseSettings, declare_denoise
from .techniques.direct import DirectSettings, declare_direct
from .techniques.environment import Ambient, EnvironmentSettings, declare_environment
from .techniques.gather import GatherSettings, declare_gather
from .techniques.gbuffer import Gbuffer, declare_gbuffer, declare_motion
from .techniques.ism import IsmSettings, declare_ism
from .techniques.near import declare_near, declare_near_shares
from .techniques.points import declare_points
from .techniques.reference import PathSettings, declare_primary, declare_reference, path_runs
from .techniques.rsm import RsmSettings, declare_rsm
from .techniques.scene_inputs import SceneInputs
from .techniques.shadow import ShadowDraws, declare_shadow_maps
from .techniques.shadow_views import ShadowSettings
from .techniques.sky import declare_sky_occlusion
from .techniques.ssdo import History, Occlusion, declare_bounce, declare_occlusion
from .techniques.ssdo_sources import Sources, SsdoSettings, declare_sources
from .techniques.ssil import MOST_BOUNCES, SsilSettings, declare_ssil, is_amortised
from .techniques.temporal import TemporalSettings, declare_temporal
from .techniques.voxels import VoxelSettings
from .techniques.vpl import VplSettings, declare_vpls, declare_walk

MAX_SIDE = 8192  # the default limit of WebGPU for a texture's side
MAX_PIXELS = 2**25  # 96 bytes of running means and results each: 3 GiB
PIXEL_BYTES = 16  # of the largest buffer per pixel, array<vec4f>


@dataclass(frozen=True)
class Technique:
    """What a technique promises: `bounces` of indirect light at most (None: as many as are asked for).

    If it draws random numbers, each frame of a still picture draws others, and their mean settles.
    """

    sentence: str
    bounces: int | None
    is_random: bool


POINTS = 1 << 17  # on all surfaces, for many-light; chosen

# Everything that takes any technique (the command line, benchmarks, tests of invariance) reads this list.
TECHNIQUES = {
    "path": Technique("progressive path tracer, the truth", None, True),
    "none": Technique("direct light only, deferred", 0, False),
    "many-light": Technique("virtual point lights with imperfect shadow maps", None, True),
    "ssdo": Technique("directional occlusion and one bounce in screen space", 1, True),
    "ssil": Technique("from what the picture shows, at several scales, with visibility by voxels", None, True),
}

# What can be read back and shown. All but the last two are there for every technique.
BUFFERS = (
    "radiance",
    "direct",
    "indirect",
    "emission",
    "albedo",
    "normal",
    "depth",
    "position",
    "instance",
    "standard_error",  # of the path tracer
    "motion",  # of all others
)


# What a technique works with, shown over the whole picture when asked for by name.
VIEWS = {
    "many-light": (
        "rsm/position",
        "rsm/normal",
        "rsm/flux",
        "vpl/flux",
        "ism/atlas",
        "ism/drawn",
        "gather/lists",
        "temporal/rejected",
    )
}
# Why a run may have none of them, by the first part of their names.
ABSENT = {
    "rsm": "there is no reflective shadow map, because no point, spot or directional light is reflected",
    "vpl": "there are no virtual point lights, because no light is reflected",
    "ism": "there are no imperfect shadow maps; they need --set gather.visibility=ism and light that is reflected",
    "gather": "there are no lists of lights; they need --set gather.culling=tiled or clustered and light to reflect",
    "temporal": "no history is kept; it needs --set temporal.frames=2 or more and light that is reflected",
}


def views_of(gi: str) -> tuple[str, ...]:
    """Return the names of the debug views of a technique."""
    return VIEWS.get(gi, ())


def buffers_of(gi: str) -> tuple[str, ...]:
    """Return the names of what a technique can show."""
    missing = "motion" if gi == "path" else "standard_error"
    return tuple(name for name in BUFFERS if name != missing)


@dataclass
class CameraSettings:
    """How pixels are sampled."""

    jitter: bool = setting(True, "Average over the pixel's square (box filter) instead of sampling its centre.")
    frames: int = setting(
        24,
        "Frames that a still picture averages; not of the path tracer, which averages samples.",
        "frames",
        range=(1, 65536),
        presets={"low": 4, "high": 64},
    )


@dataclass
class Settings:
    """What to render and how well. Sections are reached as `section.name` by `--set`."""

    gi: str = setting(
        "path",
        "Technique for light: path (path tracer), none (direct only), many-light, ssdo or ssil.",
        choices=(*TECHNIQUES,),
    )
    bounces: int | None = setting(None, "Indirect bounces; none for all of them.", "bounces", range=(0, 10_000))
    spp: int = setting(64, "Samples per pixel of the path tracer.", "samples", range=(1, 10_000_000))
    seed: int = setting(0, "Seed of all random numbers.", range=(0, 2**32 - 1))
    exposure: float = setting(0.0, "Brighten what is displayed by 2^exposure.", "EV", range=(-60, 60))
    diffuse: bool = setting(False, "Treat every material as Lambert with its base colour.")
    camera: CameraSettings = field(default_factory=CameraSettings)
    path: PathSettings = field(default_factory=PathSettings)
    direct: DirectSettings = field(default_factory=DirectSettings)
    shadow: ShadowSettings = field(default_factory=ShadowSettings)
    environment: EnvironmentSettings = field(default_factory=EnvironmentSettings)
    rsm: RsmSettings = field(default_factory=RsmSettings)
    vpl: VplSettings = field(default_factory=VplSettings)
    ism: IsmSettings = field(default_factory=IsmSettings)
    gather: GatherSettings = field(default_factory=GatherSettings)
    temporal: TemporalSettings = field(default_factory=TemporalSettings)
    denoise: DenoiseSettings = field(default_factory=DenoiseSettings)
    ssdo: SsdoSettings = field(default_factory=SsdoSettings)
    ssil: SsilSettings = field(default_factory=SsilSettings)
    voxels: VoxelSettings = field(default_factory=VoxelSettings)


@dataclass(frozen=True)
class Source:
    """Where a buffer lies: a handle with four values per pixel, and which of them; without a handle it is zero."""

    handle: Handle | None
    first: int = 0
    count: int = 3


class Absent(Source):
    """A view that this run does not have: to ask for its handle raises GiError."""

    def __init__(self, name: str) -> None:
        object.__setattr__(self, "_name", name)

    @property
    def handle(self) -> Handle | None:
        """Raise GiError that says why there is none."""
        name: str = self._name  # type: ignore[attr-defined]
        raise GiError(f"--show {name}: {ABSENT[name.partition('/')[0]]}")


def picture_count(settings: Settings) -> int:
    """Return how many frames make a still picture; of the path tracer, which averages samples itself, one."""
    several = settings.camera.jitter or TECHNIQUES[settings.gi].is_random
    return settings.camera.frames if several and settings.gi != "path" else 1


def frames_ahead(settings: Settings) -> int:
    """Return how many frames come before those that a still picture averages, for light to go round in."""
    return MOST_BOUNCES if settings.gi == "ssil" and is_amortised(settings.ssil, settings.bounces) else 0


def pixel_offset(frame: int, frames: int) -> tuple[float, float]:
    """Return where the rays of one of `frames` jittered frames go through their pixels.

    A rank-1 lattice, so that every row and every column of the pixel's square has one point and their mean is exactly
    its centre; the order jumps about the square.
    """
    index = (frame * _coprime(frames, R2[0]) + frames // 2) % frames
    other = (index * _coprime(frames, GOLDEN)) % frames
    return (index + 0.5) / frames, (other + 0.5) / frames


@cache
def _coprime(count: int, share: float) -> int:
    """Return the number nearest to a share of `count` that has no common divisor with it."""
    return min(range(1, count + 1), key=lambda k: (math.gcd(k, count) > 1, abs(k - share * count)))


def check_size(width: int, height: int, device: Device | None = None) -> None:
    """Raise GiError if a picture of this size cannot be rendered, at all or on a device."""
    if width < 1 or height < 1:
        raise GiError(f"size {width}x{height}: a picture has at least 1x1 pixels")
    if width > MAX_SIDE or height > MAX_SIDE or width * height > MAX_PIXELS:
        raise GiError(
            f"size {width}x{height}: at most {MAX_SIDE} pixels a side and {MAX_PIXELS // 2**20} million in all;"
            " make --size smaller"
        )
    if device is None:
        return
    needed, limit = width * height * PIXEL_BYTES, device.limits["max-storage-buffer-binding-size"]
    if needed > limit:
        scale = math.sqrt(limit / needed)
        raise GiError(
            f"size {width}x{height} needs buffers of {needed / 2**20:.0f} MiB, and {device.adapter_name} has at most"
            f" {limit / 2**20:.0f} (max-storage-buffer-binding-size); make --size smaller,"
            f" such as {max(int(width * scale), 1)}x{max(int(height * scale), 1)}"
        )


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
