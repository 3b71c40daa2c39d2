"""`wgpu-gi render`: renders the scene of the arguments to a file."""

from __future__ import annotations

import time
from argparse import Namespace

from ..budget.certificate import PIXELS, Certificate
from ..budget.request import Budget
from ..buffers import buffers_of, views_of
from ..errors import GiError
from ..options import Settings, check_size
from ..pictures.image import check_output
from ..pictures.picture import Picture
from ..renderer import Renderer
from ..rendering import check_denoise, read_pictures, with_alpha
from ..tiles import TilePlan, tile_plan
from .budgets import budget_of, check_budget
from .certificates import certificate_of, pixels_of
from .common import checked_buffers, list_names, metadata_of, renderer_from, settings_from
from .interrupt import exit_code, ignored
from .messages import Messages
from .picture import Made, content_of, make, save_layers, texts_of


def render(arguments: Namespace) -> int:
    """Run `wgpu-gi render` and return the exit code. Raises GiError for an error that the user can fix."""
    if list_names(arguments):
        return 0
    settings = settings_from(arguments)
    if "help" in arguments.show:
        print(*buffers_of(settings.gi), *views_of(settings.gi), sep="\n")
        return 0
    # Check the arguments before any slow step.
    shown = checked_buffers(arguments.show or ["radiance"], settings.gi)
    plan = plan_of(arguments, settings)
    if plan is None:
        check_size(arguments.size)
    check_denoise(arguments.denoise, shown if arguments.frames is None else ["radiance"], settings.gi)
    pixels = pixels_of(arguments, shown)
    check_budget(arguments)
    say = Messages(arguments.verbose, arguments.quiet)
    if arguments.frames is not None:
        from .frames import render_frames

        return render_frames(arguments, settings, shown, say)
    check_single(arguments)
    check_output(arguments.output, shown, settings.transparent)
    return _render(arguments, settings, shown, pixels, say, plan)


def _render(
    arguments: Namespace, settings: Settings, shown: list[str], pixels: int, say: Messages, plan: TilePlan | None
) -> int:
    """Load the scene, render the picture and save it; return the exit code."""
    # Render, until the picture is complete, its budget is met, or Ctrl-C is pressed.
    renderer = renderer_from(arguments, settings, say, None if plan is None else plan.tiles[0].window_size)
    if renderer.time is None and renderer.scene.animations:
        say.note("the animations are at rest; --at T shows the second T of one, --frames plays it")
    check_budget(arguments)
    budget = budget_of(arguments)
    if budget is not None and arguments.spp is not None:
        say.note(f"--spp changes nothing: {budget.words()} decides when the picture is done")
    start = time.perf_counter()
    techniques = None if arguments.gi is None else (settings.gi,)
    options = {"check": arguments.check, "timings": arguments.timings}
    show = with_alpha(shown, settings, arguments.denoise)
    made = make(renderer, budget, techniques, arguments.quality, say, show, options, plan)
    # A picture that Ctrl-C ended is saved, however often it is pressed again.
    with ignored(made.interrupts > 0):
        return _save(arguments, renderer, shown, pixels, budget, made, start, say)


def _save(
    arguments: Namespace,
    renderer: Renderer,
    shown: list[str],
    pixels: int,
    budget: Budget | None,
    made: Made,
    start: float,
    say: Messages,
) -> int:
    """Certify the picture, write its file and print the results; return the exit code. `start` is when it began."""
    settings = renderer.settings
    layers = read_pictures(made.tiled or renderer, shown, settings, arguments.denoise)
    seconds = time.perf_counter() - start
    content = content_of(renderer, is_open=budget is not None) + ", denoised" * arguments.denoise
    if arguments.denoise and arguments.error is not None:
        pixels = pixels or PIXELS  # the certificate of the budget is that of the noisy picture
    certificate = _certificate(renderer, made, layers, pixels, content, say)

    # Write the file.
    metadata = metadata_of(arguments, settings, renderer.adapter_name)
    metadata |= texts_of(made, budget, arguments.quality, content, certificate)
    told = save_layers(arguments.output, settings, layers, metadata)

    # Print the reports and the result.
    if arguments.plan:
        print(renderer.plan())
    if arguments.timings:
        print(renderer.timings())
    width, height = arguments.size
    say.result(f"{arguments.output}: {width}x{height}, {content}, {told}{seconds:.1f} s on {renderer.adapter_name}")
    if made.outcome is not None:
        say.detail(made.outcome.table)
        say.result(made.outcome.sentence())
    if certificate is not None:
        say.result(certificate.sentence())
    if made.interrupts:
        say.error(f"interrupted; {arguments.output} holds the picture so far, {content}")
    return exit_code() if made.interrupts else 0


def _certificate(
    renderer: Renderer, made: Made, layers: dict[str, Picture], pixels: int, content: str, say: Messages
) -> Certificate | None:
    """Certify a picture by a number of pixels, if asked or if Ctrl-C was pressed once; return None without it."""
    if "radiance" not in layers or made.interrupts > 1 or not (made.interrupts or pixels):
        return None if made.outcome is None else made.outcome.certificate
    if made.interrupts:
        say.note(f"interrupted after {content}; measuring its error, which Ctrl-C skips")
    return certificate_of(renderer, pixels or PIXELS, layers["radiance"], say)


def plan_of(arguments: Namespace, settings: Settings) -> TilePlan | None:
    """Return the tiles of the picture, None if it is rendered whole. Raises GiError for a flag that needs it whole."""
    if arguments.tiles is False:
        return None
    whole = {
        "--frames": arguments.frames is not None,
        "--time": arguments.budget is not None and arguments.budget.has_unit,
        "--error": arguments.error is not None,
        "--certify": bool(arguments.certify),
    }
    for flag, given in whole.items():
        if given:
            raise GiError(f"{flag} does not go with tiles; leave one of them out")
    return tile_plan(arguments.size, settings, arguments.tiles)


def check_single(arguments: Namespace) -> None:
    """Raise GiError for a flag that only a sequence takes."""
    of_sequences = {
        "--turntable": arguments.turntable,
        "--camera-path": arguments.camera_path,
        "--layers": arguments.layers,
        "--shard": arguments.shard,
        "--fps": arguments.fps is not None,
        "{frame}": "{frame" in arguments.output,
    }
    for name, given in of_sequences.items():
        if given:
            raise GiError(f"{name} needs several frames; add --frames, such as --frames 0:240")
