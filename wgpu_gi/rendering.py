"""`gi.render`: one picture, or several buffers of one view, in one call."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import deepcopy
from pathlib import Path
from typing import Any, overload

import numpy as np

from .budget.certificate import PIXELS, check_pixels
from .budget.certificate import certify as certify_by
from .budget.request import Asked, asked_of
from .buffers import check_buffers
from .camera import Camera
from .errors import GiError, warn_of
from .options import Settings, check_size, technique_of, uses
from .pictures.denoise import denoised, require_denoiser
from .pictures.picture import Picture
from .renderer import Renderer
from .scene.rules import shown
from .scene.scene import Environment
from .settings import apply_quality, validate
from .techniques.reference import DENOISER_INPUTS
from .tiles import Tiled, TilePlan, render_tiles, tile_plan


@overload
def render(
    scene: Any,
    *,
    size: tuple[int, int] = ...,
    camera: Camera | str | int | dict[str, Any] | None = ...,
    environment: Environment | str | Path | None = ...,
    time: float | str | None = ...,
    error: float | None = ...,
    at: float | None = ...,
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
    tiles: bool | int | tuple[int, int] = ...,
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
    time: float | str | None = ...,
    error: float | None = ...,
    at: float | None = ...,
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
    tiles: bool | int | tuple[int, int] = ...,
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
    time: float | str | None = None,
    error: float | None = None,
    at: float | None = None,
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
    tiles: bool | int | tuple[int, int] = False,
    show: str | Sequence[str] = "radiance",
    settings: Settings | None = None,
    adapter: str | None = None,
    progress: Callable[[float], None] | None = None,
) -> Picture | dict[str, Picture]:
    """Render one picture: (height, width, 3) float32 linear radiance in W/(m2 sr), or the buffer `show`.

    `scene` is a Scene or what `load` takes: a path, a trimesh mesh or scene, a pair (vertices, faces). A scene without
    light gets an overcast sky; that, and what else was approximated, is a GiWarning. `environment` replaces the
    scene's. `camera` is a Camera, the name or the index of one in the scene, "auto", "inside" (at eye height), or a
    dict such as {"position": (0, 1, 5), "target": (0, 1, 0)}. With several names in `show`, such as ("radiance",
    "depth"), the result is a dictionary of pictures by name. With `transparent`, radiance is (height, width, 4):
    without the environment in view, colours multiplied by alpha, the share of the pixel that surfaces cover.

    `time` ("2s", "500ms", "1.5min") chooses technique, quality and number of frames for the best picture within it;
    `error`, a relMSE, for the fastest that errs no more. What is met first ends it; `outcome` of the pictures tells
    more. `gi` or `settings` fix the technique, `quality` fixes the quality. `at` in seconds is the time in `animation`,
    a name or an index in `scene.animations` (None: the first), see `Renderer`; of a USD file the time code. A number as
    `time` is `at` if the scene has an animation, else seconds to render in.

    `denoise` smooths the path tracer's radiance with Open Image Denoise (the extra `denoise`), and no other buffer.
    `certify` path traces so many random pixels (True: 200), as `error` does: `certificate` of the radiance states
    relMSE and bias with 95 % intervals. `tiles` renders the picture part by part, with the same result, in sizes
    that the adapter's buffers do not hold: so many tiles, or of (width, height) pixels at most (True: 2048x2048). The
    other arguments override `settings`. `quality` (low, medium, high) overrides all settings with presets. Raises
    GiError for bad values.
    """
    values = {"gi": gi, "spp": spp, "bounces": bounces, "seed": seed, "diffuse": diffuse, "transparent": transparent}
    chosen = settings_of(settings, values, quality)
    names = (show,) if isinstance(show, str) else show
    plan = None if tiles is False else tile_plan(size, chosen, tiles)
    pixels = _check_arguments(names, size if plan is None else None, chosen.gi, denoise, progress, certify)
    is_fixed = gi is not None or settings is not None
    asked = asked_of(scene, environment, (time, error, at), animation, names, is_fixed, quality)
    warn_of([*asked.notes, *_ignored(chosen, values, asked.budget)], stacklevel=2)
    shape = size if plan is None else plan.tiles[0].window_size
    with Renderer(asked.scene, size=shape, camera=camera, settings=chosen, adapter=adapter) as renderer:
        pictures = _pictures(renderer, asked, names, progress, denoise, pixels, plan)
    return pictures[show] if isinstance(show, str) else pictures


def _check_arguments(
    names: Sequence[str], size: tuple[int, int] | None, gi: str, denoise: bool, progress: Any, certify: bool | int
) -> int:
    """Raise GiError for arguments of `render` that are wrong, or do not go together; return the pixels to certify."""
    check_buffers(names, gi)
    if size is not None:
        check_size(size)
    check_denoise(denoise, names, gi)
    if progress is not None and not callable(progress):
        raise GiError(f"progress must be a function of the fraction done, not {shown(progress)}")
    if certify is False:
        return 0
    if "radiance" not in names:
        raise GiError(f"certify measures radiance, which is not among the buffers {', '.join(names)}")
    return check_pixels(certify)


def _pictures(
    renderer: Renderer,
    asked: Asked,
    names: Sequence[str],
    progress: Any,
    denoise: bool,
    pixels: int,
    plan: TilePlan | None,
) -> dict[str, Picture]:
    """Render what is asked for; return the buffers by name, radiance certified by a number of pixels (0: not)."""
    if plan is not None:
        if pixels or asked.budget is not None:
            raise GiError("tiles: certify, time and error need the picture as a whole; leave them out, or tiles")
        renderer.time, renderer.animation = asked.at, asked.animation
        tiled = render_tiles(renderer, plan, with_alpha(names, renderer.settings, denoise), progress)
        return read_pictures(tiled, names, renderer.settings, denoise)
    outcome = asked.run(renderer, progress, with_alpha(names, renderer.settings, denoise))
    pictures = read_pictures(renderer, names, renderer.settings, denoise)
    for picture in pictures.values():
        picture.outcome = outcome
    # The certificate of an error budget is that of the radiance, unless the denoiser changes it.
    if outcome is not None and outcome.certificate is not None and "radiance" in pictures:
        if denoise:
            pixels = pixels or PIXELS
        else:
            pictures["radiance"].certificate = outcome.certificate
    if pixels:
        radiance = pictures["radiance"]
        try:
            radiance.certificate = certify_by(renderer, pixels, picture=radiance[..., :3])
        except GiError as error:
            warn_of([f"no certificate: {error}"], stacklevel=3)
    return pictures


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


def _ignored(settings: Settings, values: dict[str, Any], budget: object) -> list[str]:
    """Return a sentence for each of the given `values` that the technique, or a picture of a budget, does not use."""
    gi, most = settings.gi, technique_of(settings.gi).most_bounces
    notes = []
    if values["bounces"] is not None and most is not None and values["bounces"] > most:
        notes.append(f"the technique {gi} has at most {most} indirect bounces, not {values['bounces']}")
    if values["spp"] is not None and budget is not None:
        notes.append("spp changes nothing: time and error decide when the picture is done")
    elif values["spp"] is not None and not uses(gi, "spp"):
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
    return (*dict.fromkeys((*names, *extra, *(DENOISER_INPUTS if denoise else ()))),)


def read_pictures(
    renderer: Renderer | Tiled, names: Sequence[str], settings: Settings, denoise: bool = False
) -> dict[str, Picture]:
    """Return buffers by name; radiance is RGBA if the background is transparent, and smooth with `denoise`."""
    pictures = {name: renderer.read_back(name) for name in names}
    if denoise and "radiance" in pictures:
        color = pictures["radiance"]
        smooth = denoised(color, *(renderer.read_back(name) for name in DENOISER_INPUTS))
        pictures["radiance"] = Picture(smooth, color.name, color.exposure)
    if settings.transparent and "radiance" in pictures:
        color = pictures["radiance"]
        pictures["radiance"] = Picture(np.dstack([color, renderer.read_back("alpha")]), color.name, color.exposure)
    return pictures
