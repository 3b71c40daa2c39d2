"""`gi.render`: one picture, or several buffers of one view, in one call."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import deepcopy
from pathlib import Path
from typing import Any, overload

import numpy as np

from .budget.certificate import certify as make_certificate
from .budget.certificate import check_pixels
from .buffers import check_buffers
from .camera import Camera
from .errors import GiError, warn_of
from .options import Settings, check_size, technique_of, uses
from .pictures.denoise import denoised, require_denoiser
from .pictures.picture import Picture
from .renderer import Renderer
from .scene.load import is_usd, lit
from .scene.pose import check_time, outside, start_of
from .scene.rules import shown
from .scene.scene import Environment, Scene
from .settings import apply_quality, validate
from .techniques.reference import FEATURES


@overload
def render(
    scene: Any,
    *,
    size: tuple[int, int] = ...,
    camera: Camera | str | int | dict[str, Any] | None = ...,
    environment: Environment | str | Path | None = ...,
    time: float | None = ...,
    animation: str | int | None = ...,
    gi: str | None = ...,
    spp: int | None = ...,
    bounces: int | None = ...,
    seed: int | None = ...,
    diffuse: bool | None = ...,
    transparent: bool | None = ...,
    quality: str | None = ...,
    denoise: bool = ...,
    certify: bool | int = ...,
    show: str = ...,
    settings: Settings | None = ...,
    adapter: str | None = ...,
    progress: Callable[[float], None] | None = ...,
) -> Picture: ...


@overload
def render(
    scene: Any,
    *,
    size: tuple[int, int] = ...,
    camera: Camera | str | int | dict[str, Any] | None = ...,
    environment: Environment | str | Path | None = ...,
    time: float | None = ...,
    animation: str | int | None = ...,
    gi: str | None = ...,
    spp: int | None = ...,
    bounces: int | None = ...,
    seed: int | None = ...,
    diffuse: bool | None = ...,
    transparent: bool | None = ...,
    quality: str | None = ...,
    denoise: bool = ...,
    certify: bool | int = ...,
    show: Sequence[str],
    settings: Settings | None = ...,
    adapter: str | None = ...,
    progress: Callable[[float], None] | None = ...,
) -> dict[str, Picture]: ...


def render(
    scene: Any,
    *,
    size: tuple[int, int] = (640, 360),
    camera: Camera | str | int | dict[str, Any] | None = None,
    environment: Environment | str | Path | None = None,
    time: float | None = None,
    animation: str | int | None = None,
    gi: str | None = None,
    spp: int | None = None,
    bounces: int | None = None,
    seed: int | None = None,
    diffuse: bool | None = None,
    transparent: bool | None = None,
    quality: str | None = None,
    denoise: bool = False,
    certify: bool | int = False,
    show: str | Sequence[str] = "radiance",
    settings: Settings | None = None,
    adapter: str | None = None,
    progress: Callable[[float], None] | None = None,
) -> Picture | dict[str, Picture]:
    """Render one picture: (height, width, 3) float32 linear radiance in W/(m2 sr), or the buffer `show`.

    `scene` is a Scene or what `load` takes: a path, a trimesh mesh or scene, a pair (vertices, faces). A scene without
    light gets an overcast sky. Its user learns that, and what else was approximated, by a GiWarning.
    `environment` replaces the scene's. `camera` is a Camera, the name or the index of one in the scene, "auto",
    "inside" (at eye height), or a dict such as {"position": (0, 1, 5), "target": (0, 1, 0)}. With several
    names in `show`, such as ("radiance", "depth"), the result is a dictionary of pictures by name. With `transparent`,
    radiance is (height, width, 4): the environment is left out where the camera sees it, colours are multiplied by
    alpha, and alpha is the share of the pixel that surfaces cover.

    `denoise` smooths the radiance of the path tracer with Open Image Denoise (the extra `denoise`). Other buffers stay
    as they are; `standard_error` is that of the radiance before. `certify` (True: 200) path traces so many random
    pixels: `certificate` of the radiance states its relMSE and its bias with 95 % intervals.

    `time` in seconds shows the scene at that time of `animation`, a name or an index in `scene.animations` (None: the
    first), see `Renderer`; an `animation` without a time is shown at its start. A USD file is shown at the time code
    `time`.

    The other arguments override `settings` where they are given. `quality` (low, medium, high) overrides all settings
    that have presets. Raises GiError for bad values.
    """
    # Check the arguments before any slow step.
    values: dict[str, Any] = {"gi": gi, "spp": spp, "bounces": bounces, "seed": seed, "diffuse": diffuse}
    values["transparent"] = transparent
    chosen = settings_of(settings, values, quality)
    names = (show,) if isinstance(show, str) else show
    _check_arguments(names, size, chosen.gi, denoise, progress)
    pixels = _certified_pixels(certify, names)
    lighted, seconds, notes = lit_at(scene, environment, time, animation)
    warn_of([*notes, *_ignored(chosen, values)], stacklevel=2)
    # Render.
    with Renderer(lighted, size=size, camera=camera, settings=chosen, adapter=adapter) as renderer:
        renderer.time, renderer.animation = seconds, animation
        renderer.run(progress, show=with_alpha(names, chosen, denoise))
        pictures = read_pictures(renderer, names, chosen, denoise)
        _certify(renderer, pictures, pixels)
    return pictures[show] if isinstance(show, str) else pictures


def _check_arguments(names: Sequence[str], size: tuple[int, int], gi: str, denoise: bool, progress: Any) -> None:
    """Raise GiError for arguments of `render` that are wrong, or do not go together."""
    check_buffers(names, gi)
    check_size(size)
    check_denoise(denoise, names, gi)
    if progress is not None and not callable(progress):
        raise GiError(f"progress must be a function of the fraction done, not {shown(progress)}")


def _certified_pixels(certify: bool | int, names: Sequence[str]) -> int:
    """Return how many pixels to certify by, 0 for none. Raises GiError for a wrong number or no radiance to certify."""
    if certify is False:
        return 0
    if "radiance" not in names:
        raise GiError(f"certify measures radiance, which is not among the buffers {', '.join(names)}")
    return check_pixels(certify)


def _certify(renderer: Renderer, pictures: dict[str, Picture], pixels: int) -> None:
    """Certify radiance by a number of pixels, 0 for none; warn if it cannot be certified."""
    if not pixels:
        return
    radiance = pictures["radiance"]
    try:
        radiance.certificate = make_certificate(renderer, pixels, picture=radiance[..., :3])
    except GiError as error:
        warn_of([f"no certificate: {error}"], stacklevel=3)


def lit_at(
    scene: Any, environment: Environment | str | Path | None, time: float | None, animation: str | int | None
) -> tuple[Scene, float | None, list[str]]:
    """Return a scene with light, the seconds at which to show its animation, and notes; see `render` and `lit`."""
    check_time(time)
    usd = is_usd(scene)
    lighted, notes = lit(scene, environment, time if usd else None)
    seconds = start_of(lighted, None if usd else time, animation)
    return lighted, seconds, [*notes, *outside(lighted, seconds, animation)]


def settings_of(settings: Settings | None, values: dict[str, Any], quality: str | None) -> Settings:
    """Return a copy of `settings`, or the defaults, with the presets of `quality` and those `values` that are not None.

    Raises GiError for values that are not allowed.
    """
    if settings is not None and not isinstance(settings, Settings):
        raise GiError(f"settings must be Settings(...), not {shown(settings)}")
    chosen = Settings() if settings is None else deepcopy(settings)
    if quality is not None:
        apply_quality(chosen, quality)
    for name, value in values.items():
        if value is not None:
            setattr(chosen, name, value)
    validate(chosen)
    return chosen


def _ignored(settings: Settings, values: dict[str, Any]) -> list[str]:
    """Return a sentence for each of the given `values` that the technique does not use."""
    gi, most = settings.gi, technique_of(settings.gi).most_bounces
    notes = []
    if values["bounces"] is not None and most is not None and values["bounces"] > most:
        notes.append(f"the technique {gi} has at most {most} indirect bounces, not {values['bounces']}")
    if values["spp"] is not None and not uses(gi, "spp"):
        notes.append(f"spp changes nothing: the technique {gi} averages frames, settings.camera.frames of them")
    return notes


def check_denoise(denoise: bool, names: Sequence[str], gi: str) -> None:
    """Raise GiError if `denoise` is set, but radiance is not among `names`, `gi` is not noisy, or no denoiser runs."""
    if not isinstance(denoise, bool):
        raise GiError(f"denoise must be True or False, not {shown(denoise)}")
    if not denoise:
        return
    if not technique_of(gi).averages_samples:
        raise GiError(f"denoise is for the technique path; {gi} filters its own light, so leave denoise out")
    if "radiance" not in names:
        raise GiError(f"denoise smooths radiance, which is not among the buffers {', '.join(names)}")
    require_denoiser()


def with_alpha(names: Sequence[str], settings: Settings, denoise: bool = False) -> tuple[str, ...]:
    """Return the buffers to render for `read_pictures`."""
    extra = ("alpha",) if settings.transparent and "radiance" in names else ()
    return (*dict.fromkeys((*names, *extra, *(FEATURES if denoise else ()))),)


def read_pictures(
    renderer: Renderer, names: Sequence[str], settings: Settings, denoise: bool = False
) -> dict[str, Picture]:
    """Return buffers by name; radiance is RGBA if the background is transparent, and smooth with `denoise`."""
    pictures = {name: renderer.read_back(name) for name in names}
    if denoise and "radiance" in pictures:
        color = pictures["radiance"]
        smooth = denoised(color, *(renderer.read_back(name) for name in FEATURES))
        pictures["radiance"] = Picture(smooth, color.name, color.exposure)
    if settings.transparent and "radiance" in pictures:
        color = pictures["radiance"]
        pictures["radiance"] = Picture(np.dstack([color, renderer.read_back("alpha")]), color.name, color.exposure)
    return pictures
