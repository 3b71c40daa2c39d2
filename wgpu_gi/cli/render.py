"""`wgpu-gi render`: renders the scene of the arguments to a file."""

from __future__ import annotations

import time
from argparse import Namespace
from typing import Any

from ..budget.certificate import PIXELS
from ..buffers import buffers_of, views_of
from ..errors import GiError
from ..options import Settings, check_size, picture_count
from ..pictures.exposure import exposure_text
from ..pictures.image import check_output, save_image
from ..renderer import Renderer
from ..rendering import check_denoise, read_pictures, with_alpha
from .certificates import certificate_texts, pixels_of
from .common import checked_buffers, exposure_for, list_names, metadata_of, renderer_from, rendering, settings_from
from .interrupt import INTERRUPTED, handled, held
from .messages import Messages


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
    check_size(arguments.size)
    check_denoise(arguments.denoise, shown if arguments.frames is None else ["radiance"], settings.gi)
    pixels = pixels_of(arguments, shown)
    say = Messages(arguments.verbose, arguments.quiet)
    if arguments.frames is not None:
        from .frames import render_frames

        return render_frames(arguments, settings, shown, say)
    check_single(arguments)
    check_output(arguments.output, shown, settings.transparent)

    # Render, until the picture is complete or Ctrl-C is pressed.
    renderer = renderer_from(arguments, settings, say)
    if renderer.time is None and renderer.scene.animations:
        say.note("the animations are at rest; --time T shows the second T of one, --frames plays it")
    start = time.perf_counter()
    show = with_alpha(shown, settings, arguments.denoise)
    interrupted = _run(renderer, say, {"show": show, "check": arguments.check, "timings": arguments.timings})
    layers = read_pictures(renderer, shown, settings, arguments.denoise)
    seconds = time.perf_counter() - start
    content = _content(renderer, settings) + ", denoised" * arguments.denoise

    # Write the file.
    metadata = metadata_of(arguments, settings, renderer.adapter_name)
    if interrupted:
        metadata["interrupted"] = content
        say.note(f"interrupted after {content}; measuring its error, which Ctrl-C skips")
    if (pixels or interrupted) and interrupted < 2:
        metadata |= certificate_texts(renderer, pixels or PIXELS, layers.get("radiance"), say)
    exposure = exposure_for(arguments.output, settings, shown[0], layers[shown[0]])
    told = ""
    if exposure is not None:
        metadata["exposure"] = exposure_text(exposure, settings.exposure is None)
        told = f"exposure {metadata['exposure']}, "
    save_image(arguments.output, layers, exposure=exposure, metadata=metadata)

    # Print the reports and the result.
    if arguments.plan:
        print(renderer.plan())
    if arguments.timings:
        print(renderer.timings())
    width, height = arguments.size
    say.result(f"{arguments.output}: {width}x{height}, {content}, {told}{seconds:.1f} s on {renderer.adapter_name}")
    if interrupted:
        say.error(f"interrupted; {arguments.output} holds the picture so far, {content}")
    return INTERRUPTED if interrupted else 0


def _run(renderer: Renderer, say: Messages, options: dict[str, Any]) -> int:
    """Render the picture; return how often Ctrl-C was pressed, which ends that once there is a picture to save.

    Before, Ctrl-C raises KeyboardInterrupt.
    """
    try:
        with held(lambda: renderer.finished > 0), rendering(renderer, say) as report:
            renderer.run(progress=report, **options)
    except KeyboardInterrupt:
        if not renderer.finished:
            raise
        return max(handled(), 1)
    return 0


def _content(renderer: Renderer, settings: Settings) -> str:
    """Return in words what the picture averages, such as 24 frames or 12 of 24 frames."""
    samples = settings.gi == "path"
    wanted = settings.spp if samples else picture_count(settings, renderer.scene)
    part = f"{renderer.finished} of " if renderer.finished < wanted else ""
    return f"{part}{wanted} {'spp' if samples else 'frames'}"


def check_single(arguments: Namespace) -> None:
    """Raise GiError for a flag that only a sequence takes."""
    of_sequences = {
        "--turntable": arguments.turntable,
        "--camera-path": arguments.camera_path,
        "--layers": arguments.layers,
        "--shard": arguments.shard,
        "{frame}": "{frame" in arguments.output,
    }
    for name, given in of_sequences.items():
        if given:
            raise GiError(f"{name} needs several frames; add --frames, such as --frames 0:240")
