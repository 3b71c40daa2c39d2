"""The table of techniques, and every setting of a picture."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from .camera import Window
from .errors import GiError
from .gpu.device import Device
from .records import KnownAttributes
from .scene.rules import is_whole, shown
from .scene.scene import Scene
from .settings import setting
from .techniques import deferred, many_light, reference, ssao, ssdo, ssil
from .techniques.deferred.direct import DirectSettings, draws_emitters
from .techniques.deferred.environment import EnvironmentSettings
from .techniques.deferred.shadow_views import ShadowSettings
from .techniques.deferred.transmission import draws_transmission
from .techniques.many_light.gather import GatherSettings
from .techniques.many_light.ism import IsmSettings
from .techniques.many_light.rsm import RsmSettings
from .techniques.many_light.vpl import VplSettings
from .techniques.reference import PathSettings
from .techniques.shared.denoise import DenoiseSettings
from .techniques.shared.sampling import CameraSettings
from .techniques.shared.technique import Technique
from .techniques.shared.temporal import TemporalSettings
from .techniques.ssdo.settings import SsdoSettings
from .techniques.ssil.ssil import SsilSettings
from .techniques.ssil.voxels import VoxelSettings
from .upload.see_through import is_see_through
from .webgpu_limits import MAX_TEXTURE_SIDE

MAX_PIXELS = 2**25  # each takes 96 bytes of running means and results: 3 GiB
PIXEL_BYTES = 16  # bytes per pixel of the largest buffer, array<vec4f>


# A technique for indirect light has a folder in `techniques/`, an entry here, and a line in `frame.py`. Code for all
# techniques (the command line, benchmarks, tests of invariance) reads this table.
TECHNIQUES = {
    "path": reference.TECHNIQUE,
    "none": deferred.TECHNIQUE,
    "many-light": many_light.TECHNIQUE,
    "ssdo": ssdo.TECHNIQUE,
    "ssil": ssil.TECHNIQUE,
    "ssao": ssao.TECHNIQUE,
}
FOR_ALL = ("gi", "exposure", "diffuse", "camera")  # settings and sections that the renderer itself uses


@dataclass(repr=False, slots=True)
class Settings(KnownAttributes):
    """What to render and how well. `--set` reaches sections as `section.name`."""

    gi: str = setting(
        "many-light",
        "Technique for indirect light: " + ", ".join(TECHNIQUES) + ".",
        choices=(*TECHNIQUES,),
    )
    bounces: int | None = setting(None, "Number of indirect bounces; none means all.", "bounces", range=(0, 10_000))
    spp: int = setting(64, "Samples per pixel of the path tracer.", "samples", range=(1, 10_000_000))
    seed: int = setting(0, "Seed of all random numbers.", range=(0, 2**32 - 1))
    exposure: float | None = setting(
        None, "Scale the displayed picture by 2^exposure; none means automatic.", "EV", range=(-60, 60)
    )
    diffuse: bool = setting(False, "Treat every material as Lambert with its base colour.")
    transparent: bool = setting(
        False, "Leave the environment out of the picture where the camera sees it; it lights the scene all the same."
    )
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


def technique_of(gi: str) -> Technique:
    """Return a technique by its name. Raises GiError if there is none."""
    if not isinstance(gi, str) or gi not in TECHNIQUES:
        raise GiError(f"gi must be one of {', '.join(TECHNIQUES)}, not {gi!r}")
    return TECHNIQUES[gi]


def uses(gi: str, name: str) -> bool:
    """Return whether a technique uses a setting, by the section of its name."""
    technique = technique_of(gi)
    if name in ("camera.frames", "camera.antialias"):
        return not technique.averages_samples
    return name.partition(".")[0] in {*FOR_ALL, *technique.sections}


def picture_count(settings: Settings, scene: Scene) -> int:
    """Return the number of frames of a still picture: one if the technique averages samples, or if nothing varies."""
    if technique_of(settings.gi).averages_samples:
        return 1
    return settings.camera.frames if varies(settings, scene) else 1


def varies(settings: Settings, scene: Scene) -> bool:
    """Return whether the frames of a still picture differ: by random numbers, or by the points that pixels sample."""
    technique = technique_of(settings.gi)
    draws = draws_emitters(settings.direct, scene) or draws_transmission(scene, diffuse=settings.diffuse)
    dithers = any(is_see_through(m, settings.diffuse) for m in scene.materials)
    return settings.camera.jitter or technique.is_random or draws or dithers


def samples_of(settings: Settings, runs: int) -> int:
    """Return the samples per pixel of a picture of the path tracer after `runs` runs of its pass."""
    return min(runs * settings.path.samples_per_run, settings.spp)


def why_aliased(settings: Settings) -> str | None:
    """Return why the frames of a moving picture are not anti-aliased over time; None if they are."""
    if technique_of(settings.gi).averages_samples:
        return "the technique averages jittered samples"
    if not settings.camera.jitter:
        return "camera.jitter is false"
    return "camera.antialias is 1" if settings.camera.antialias == 1 else None


def check_whole(size: tuple[int, int]) -> None:
    """Raise GiError if a picture of this size (width, height) cannot be rendered window by window."""
    if not isinstance(size, (tuple, list)) or len(size) != 2 or not all(map(is_whole, size)):
        raise GiError(f"size must be (width, height) in whole pixels, not {shown(size)}")
    if min(size) < 1 or max(size) > MAX_TEXTURE_SIDE:
        raise GiError(f"size {size[0]}x{size[1]}: a picture has 1 to {MAX_TEXTURE_SIDE} pixels a side")


def check_window(size: tuple[int, int], window: Window | None) -> None:
    """Raise GiError unless a picture of this size lies at the window's corner in a whole picture."""
    if window is None:
        return
    if not isinstance(window, Window) or not isinstance(window.corner, tuple) or len(window.corner) != 2:
        raise GiError(f"window must be Window(corner, whole), two pairs of whole pixels, not {shown(window)}")
    check_whole(window.whole)
    (x, y), (width, height) = window
    if not (is_whole(x) and is_whole(y)) or min(x, y) < 0 or x + size[0] > width or y + size[1] > height:
        raise GiError(f"the window of {size[0]}x{size[1]} pixels at {x}, {y} is not within {width}x{height} pixels")


def check_size(size: tuple[int, int], device: Device | None = None) -> None:
    """Raise GiError if a picture of this size (width, height) cannot be rendered, in general or on `device`."""
    if not isinstance(size, (tuple, list)) or len(size) != 2 or not all(map(is_whole, size)):
        raise GiError(f"size must be (width, height) in whole pixels, not {shown(size)}")
    width, height = size
    if width < 1 or height < 1:
        raise GiError(f"size {width}x{height}: a picture has at least 1x1 pixels")
    if width > MAX_TEXTURE_SIDE or height > MAX_TEXTURE_SIDE or width * height > MAX_PIXELS:
        raise GiError(
            f"size {width}x{height}: at most {MAX_TEXTURE_SIDE} pixels a side and {MAX_PIXELS // 2**20} million in all;"
            " make the picture smaller"
        )
    if device is None:
        return
    needed, limit = width * height * PIXEL_BYTES, device.limits["max-storage-buffer-binding-size"]
    if needed > limit:
        scale = math.sqrt(limit / needed)
        raise GiError(
            f"size {width}x{height} needs buffers of {needed / 2**20:.0f} MiB, and {device.adapter_name} has at most"
            f" {limit / 2**20:.0f} (max-storage-buffer-binding-size); make the picture smaller,"
            f" such as {max(int(width * scale), 1)}x{max(int(height * scale), 1)}"
        )
