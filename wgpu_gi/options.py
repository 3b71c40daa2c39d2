"""The techniques there are, and every setting of a picture."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cache

from .errors import GiError
from .gpu.device import Device
from .settings import setting
from .techniques.deferred.direct import DirectSettings
from .techniques.deferred.environment import EnvironmentSettings
from .techniques.deferred.shadow_views import ShadowSettings
from .techniques.many_light.filters import DenoiseSettings
from .techniques.many_light.gather import GatherSettings
from .techniques.many_light.ism import IsmSettings
from .techniques.many_light.rsm import RsmSettings
from .techniques.many_light.vpl import VplSettings
from .techniques.reference import PathSettings
from .techniques.shared.temporal import TemporalSettings
from .techniques.ssdo.sources import SsdoSettings
from .techniques.ssil.ssil import MOST_BOUNCES, SsilSettings, is_amortised
from .techniques.ssil.voxels import VoxelSettings
from .upload.surface_samples import GOLDEN, R2

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
