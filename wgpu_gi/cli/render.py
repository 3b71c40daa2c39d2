"""`wgpu-gi render`: from arguments to a scene, a renderer and a file."""

from __future__ import annotations

import time
from argparse import Namespace

from ..buffers import buffers_of, views_of
from ..errors import GiError
from ..options import check_size, picture_count
from ..pictures.image import check_output, save_image
from .common import buffers_from, list_names, metadata_of, progress_bar, renderer_from, settings_from


def render(arguments: Namespace) -> int:
    """Carry out `wgpu-gi render`; return the exit code. Raises GiError for all that the user can put right."""
    if list_names(arguments):
        return 0
    settings = settings_from(arguments)
    if "help" in arguments.show:
        print(*buffers_of(settings.gi), *views_of(settings.gi))
        return 0
    # Refuse what cannot work before any time is spent on it.
    shown = buffers_from(arguments, settings)
    check_size(*arguments.size)
    if arguments.frames is not None:
        from .frames import render_frames

        return render_frames(arguments, settings, shown)
    check_alone(arguments)
    check_output(arguments.output, shown)

    renderer = renderer_from(arguments, settings)
    start = time.perf_counter()
    with progress_bar() as report:
        renderer.run(progress=report, show=tuple(shown), check=arguments.check, timings=arguments.timings)
    layers = {name: renderer.read_back(name) for name in shown}
    seconds = time.perf_counter() - start

    metadata = metadata_of(arguments, settings, renderer.adapter_name)
    save_image(arguments.output, layers, exposure=settings.exposure, metadata=metadata)
    if arguments.plan:
        print(renderer.plan())
    if arguments.timings:
        print(renderer.timings())
    width, height = arguments.size
    samples = f"{settings.spp} spp" if settings.gi == "path" else f"{picture_count(settings)} frames"
    print(f"{arguments.output}: {width}x{height}, {samples}, {seconds:.1f} s on {renderer.adapter_name}")
    return 0


def check_alone(arguments: Namespace) -> None:
    """Raise GiError if anything is asked for that one picture cannot have."""
    of_frames = {
        "--turntable": arguments.turntable,
        "--camera-path": arguments.camera_path,
        "--layers": arguments.layers,
        "--shard": arguments.shard,
        "{frame}": "{frame" in arguments.output,
    }
    for name, given in of_frames.items():
        if given:
            raise GiError(f"{name} is for several frames; add --frames 0:240, say")
