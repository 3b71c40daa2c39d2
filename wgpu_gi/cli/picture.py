"""Renders one picture until it is complete, its budget is met, or Ctrl-C is pressed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from ..budget.certificate import Certificate
from ..budget.outcome import Outcome
from ..budget.refine import render_within
from ..budget.request import Budget
from ..options import Settings, picture_count, technique_of
from ..pictures.exposure import exposure_text
from ..pictures.image import exposure_for, save_image
from ..pictures.picture import Picture
from ..renderer import Renderer
from ..tiles import Tiled, TilePlan, render_tiles
from .common import rendering
from .interrupt import handled, held
from .messages import Messages


class Made(NamedTuple):
    """How a picture was made: `outcome` of its budget, None without one; `interrupts`: how often Ctrl-C was pressed.

    tiled: the picture, if it was rendered in tiles; else the renderer has it.
    """

    outcome: Outcome | None
    interrupts: int
    tiled: Tiled | None = None


def make(
    renderer: Renderer,
    budget: Budget | None,
    techniques: Sequence[str] | None,
    quality: str | None,
    say: Messages,
    show: tuple[str, ...],
    options: Mapping[str, bool],
    plan: TilePlan | None = None,
) -> Made:
    """Render a picture: by the `options` of `Renderer.run`, in the tiles of `plan` if given; or within `budget`.

    A budget is met by one of `techniques` (None: any) at a `quality` (None: any).

    Ctrl-C ends it once there is a picture to save. Before, it raises KeyboardInterrupt.
    """
    if plan is not None:
        with rendering(renderer, say, f"rendering {len(plan.tiles)} tiles") as report:
            return Made(None, 0, render_tiles(renderer, plan, show, report, **options))
    outcome = None
    try:
        with held(lambda: renderer.finished > 0), rendering(renderer, say) as report:
            if budget is None:
                renderer.run(progress=report, show=show, **options)
            else:
                outcome = render_within(renderer, *budget, techniques, report, quality=quality, show=show)
    except KeyboardInterrupt:
        if not renderer.finished:
            raise
        return Made(outcome, max(handled(), 1))
    return Made(outcome, 0)


def content_of(renderer: Renderer, is_open: bool) -> str:
    """Return in words what the picture averages, such as 24 frames or 12 of 24 frames; `is_open`: of any number."""
    settings, done = renderer.settings, renderer.finished
    samples = technique_of(settings.gi).averages_samples
    wanted = settings.spp if samples else picture_count(settings, renderer.scene)
    return counted(str(done) if is_open or done >= wanted else f"{done} of {wanted}", samples)


def counted(count: str, samples: bool) -> str:
    """Return a number of samples per pixel or of frames with its unit."""
    return f"{count} {'spp' if samples else 'frame' if count == '1' else 'frames'}"


def save_layers(output: str, settings: Settings, layers: Mapping[str, Picture], metadata: dict[str, object]) -> str:
    """Write the file of a picture, by name of its buffers; return its exposure in words with a comma, if it has one."""
    first = next(iter(layers))
    exposure, told = exposure_for(output, settings.exposure, first, layers[first]), ""
    if exposure is not None:
        metadata["exposure"] = exposure_text(exposure, settings.exposure is None)
        told = f"exposure {metadata['exposure']}, "
    save_image(output, layers, exposure=exposure, metadata=metadata)
    return told


def texts_of(
    made: Made, budget: Budget | None, quality: str | None, content: str, certificate: Certificate | None
) -> dict[str, Any]:
    """Return what a file's metadata say of how its picture was made; `quality` as the user gave it."""
    texts: dict[str, Any] = {}
    if budget is not None:
        texts["budget"] = budget.words()
        texts["quality"] = quality or ""  # of an interrupted choice, unknown
        texts["frames"] = content
    if made.outcome is not None:
        texts["quality"] = made.outcome.candidate.quality
        texts["stopped"] = made.outcome.reason
    if made.interrupts:
        texts["interrupted"] = content
    return texts | ({} if certificate is None else certificate.texts())
