"""`wgpu-gi farm render --farm-tiles`: renders one picture in tiles by the workers of a cluster, and writes it here."""

from __future__ import annotations

import time
from argparse import Namespace
from typing import Any

from ..errors import GiError
from ..farm.client import connected, require_dask
from ..farm.picture import FarmPicture, forget_tiles, render_picture
from ..options import check_size, picture_count, technique_of
from ..pictures.image import check_output
from ..rendering import check_denoise, read_pictures
from ..scene.scene import Scene
from ..sequence.job import Job, index_or_camera
from .common import checked_buffers, metadata_of, noted_scene, settings_from, source_of, time_of
from .messages import Messages
from .picture import counted, save_layers
from .render import check_single, plan_of


def render_tiled(arguments: Namespace, say: Messages) -> int:
    """Render the picture; return the exit code, 1 if tiles are missing. Raises GiError for what the user can fix."""
    # Check the arguments before any slow step.
    start, settings = time.perf_counter(), settings_from(arguments)
    shown = checked_buffers(arguments.show or ["radiance"], settings.gi)
    check_size(arguments.size)
    check_denoise(arguments.denoise, shown, settings.gi)
    check_reports(arguments)
    plan = plan_of(arguments, settings)
    assert plan is not None  # `tiles` is given
    check_single(arguments)
    check_output(arguments.output, shown, settings.transparent)
    require_dask()

    # Load the scene: its notes are for the user, its digest for the workers.
    scene, camera = noted_scene(arguments, settings, say)
    job = Job(
        source=source_of(arguments, arguments.scene),
        camera=index_or_camera(scene, camera),
        settings=settings,
        size=arguments.size,
        frames=range(1),
        shown=tuple(shown),
        time=time_of(arguments, arguments.scene, scene),
        animation=arguments.animation,
        adapter=arguments.adapter,
        denoise=arguments.denoise,
        check=arguments.check,
    )
    with say.board() as show, connected(arguments.scheduler, **workers_of(arguments)) as client:
        say.detail(f"{client}")
        made = render_picture(
            client,
            job,
            scene,
            plan,
            arguments.output,
            tick=lambda progress, what: show(progress.fraction, what, progress.table("tiles")),
            note=say.note,
        )
    return _save(arguments, job, scene, made, time.perf_counter() - start, say)


def _save(arguments: Namespace, job: Job, scene: Scene, made: FarmPicture, seconds: float, say: Messages) -> int:
    """Write the picture, if it is complete, and print the result; return the exit code."""
    say.detail(made.workers)
    if made.tiled is None:
        for number, reason in sorted(made.failed.items()):
            say.detail(f"tile {number + 1} failed: {reason}")
        say.error(f"{arguments.output}: not written; {made.sentence()}")
        return 1
    settings = job.settings
    layers = read_pictures(made.tiled, job.shown, settings, job.denoise)
    told = save_layers(arguments.output, settings, layers, metadata_of(arguments, settings, made.adapters))
    forget_tiles(arguments.output)
    samples = technique_of(settings.gi).averages_samples
    content = counted(str(settings.spp if samples else picture_count(settings, scene)), samples)
    content += ", denoised" * job.denoise
    width, height = job.size
    say.result(f"{arguments.output}: {width}x{height}, {content}, {told}{seconds:.1f} s; {made.sentence()}")
    return 0


def workers_of(arguments: Namespace) -> dict[str, Any]:
    """Return which processes to start on this machine."""
    return {"workers": arguments.workers, "threads": arguments.threads, "adapter": arguments.adapter}


def check_reports(arguments: Namespace) -> None:
    """Raise GiError for reports of one process."""
    for flag, given in (("--plan", arguments.plan), ("--timings", arguments.timings)):
        if given:
            raise GiError(f"{flag} tells of one process; leave it out, or use wgpu-gi render")
