"""`wgpu-gi farm render`: renders a sequence by the workers of a Dask cluster, or of this machine."""

from __future__ import annotations

from argparse import Namespace

from ..errors import GiError
from ..farm.client import connected, require_dask
from ..farm.run import FarmResult, render_job
from ..options import Settings, check_size
from ..pictures.video import is_video
from ..rendering import check_denoise
from ..sequence.files import FrameFiles
from ..sequence.job import Timeline
from ..sequence.shards import ALL
from .budgets import check_budget
from .certificates import pixels_of
from .common import checked_buffers, list_names, metadata_of, noted_scene, settings_from
from .farm_tiles import check_reports, render_tiled, workers_of
from .frames import check_sequence, command_of, job_maker, layers_of
from .messages import Messages


def render(arguments: Namespace) -> int:
    """Run `wgpu-gi farm render`; return the exit code, 1 if frames are missing at the end.

    Raises GiError for an error that the user can fix.
    """
    if list_names(arguments):
        return 0
    say = Messages(arguments.verbose, arguments.quiet)
    if arguments.tiles is not False:
        return render_tiled(arguments, say)
    # Check the arguments before any slow step.
    settings = settings_from(arguments)
    shown = checked_buffers(arguments.show or ["radiance"], settings.gi)
    layers = layers_of(arguments, settings)
    _check(arguments, shown, settings)
    files = FrameFiles(arguments.output, shown, layers, settings.transparent)
    make_job = job_maker(arguments, settings, shown, layers)
    require_dask()

    # Load the scene: its notes are for the user, its digest for the workers.
    scene, camera = noted_scene(arguments, settings, say)
    job = make_job(scene, camera)
    if not Timeline(job, scene).moves:
        say.note("nothing moves, so all frames are the same; see --turntable and --camera-path")
    metadata = metadata_of(arguments, settings, "")
    del metadata["adapter"]

    # Render.
    with say.board() as show, connected(arguments.scheduler, **workers_of(arguments)) as client:
        say.detail(f"{client}")
        result = render_job(
            client,
            job,
            scene,
            files,
            metadata=metadata,
            command=lambda timeline: command_of(arguments, job, metadata, timeline),
            gather=arguments.gather,
            shards=arguments.shard or ALL,
            tick=lambda progress, what: show(progress.fraction, what, progress.table()),
            note=say.note,
        )
    return _tell(result, say)


def _tell(result: FarmResult, say: Messages) -> int:
    """Print the result; return the exit code."""
    say.detail(result.workers)
    if result.is_complete:
        say.result(result.sentence())
        return 0
    for frame, reason in sorted(result.failed.items()):
        say.detail(f"frame {frame} failed: {reason}")
    say.error(result.sentence())
    return 1


def _check(arguments: Namespace, shown: list[str], settings: Settings) -> None:
    """Raise GiError for arguments that a farm does not take, and for those that `render` would refuse."""
    if arguments.frames is None:
        raise GiError(
            "add --frames, such as --frames 0:240, or --farm-tiles: a farm renders several frames, or parts of one"
        )
    if is_video(arguments.output):
        raise GiError(f"-o {arguments.output}: a farm writes frames, such as f_{{frame:04d}}.png, and no video")
    check_reports(arguments)
    pixels_of(arguments, shown)
    check_budget(arguments)
    check_size(arguments.size)
    check_denoise(arguments.denoise, ["radiance"], settings.gi)
    check_sequence(arguments, shown, settings)
