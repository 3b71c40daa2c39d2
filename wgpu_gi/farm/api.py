"""`gi.farm.render`: the frames of a sequence by the workers of a Dask cluster, from Python."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..buffers import check_buffers
from ..camera import Camera
from ..errors import GiError, warn_of
from ..options import Settings, check_size
from ..pictures.video import is_video
from ..rendering import check_denoise, settings_of
from ..scene.digest import digest
from ..scene.files.camera_files import camera_of
from ..scene.files.camera_paths import CameraPath, load_camera_path
from ..scene.load import is_usd, lit_at
from ..scene.rules import is_whole, shown
from ..scene.scene import Environment, Scene
from ..sequence.files import FrameFiles
from ..sequence.job import Job, Timeline, index_or_camera
from ..sequence.source import SceneSource
from ..version import __version__
from .client import connected, require_dask
from .progress import FarmProgress
from .run import FarmResult, render_job
from .worker import digest_of

if TYPE_CHECKING:
    from distributed import Client


def render(
    client: Client | None,
    scene: Any,
    output: str | Path,
    *,
    frames: range,
    size: tuple[int, int] = (640, 360),
    camera: Camera | str | int | dict[str, Any] | None = None,
    camera_path: str | Path | None = None,
    turntable: bool = False,
    environment: Environment | str | Path | None = None,
    at: float | None = None,
    animation: str | int | None = None,
    fps: int = 24,
    gi: str | None = None,
    spp: int | None = None,
    bounces: int | None = None,
    seed: int | None = None,
    diffuse: bool | None = None,
    transparent: bool | None = None,
    quality: str | None = None,
    denoise: bool = False,
    show: str | Sequence[str] = "radiance",
    layers: Sequence[str] = (),
    settings: Settings | None = None,
    adapter: str | None = None,
    gather: bool = False,
    workers: int | None = None,
    threads: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> FarmResult:
    """Render `frames` to `output`, such as "f/{frame:04d}.exr", by the workers of a Dask client; return what was done.

    Frames whose files exist are skipped. The animation of the scene plays: frame F shows the second F / `fps`; `at`
    holds it. `camera_path` is a .json file of keys; `turntable` moves `camera` once round the scene. `layers` are
    buffers for an .npz beside each frame. With `gather`, pictures are sent back and written here; without, all workers
    see the folder. Without a client, `workers` processes start on this machine, with `threads` cores each where a CPU
    renders; a script calls this below `if __name__ == "__main__":`. The other arguments are those of `gi.render`.
    Raises GiError for bad values, and for workers that cannot take part.
    """
    values = {"gi": gi, "spp": spp, "bounces": bounces, "seed": seed, "diffuse": diffuse, "transparent": transparent}
    chosen = settings_of(settings, values, quality)
    names = (show,) if isinstance(show, str) else (*show,)
    _check(output, frames, fps, progress)
    _check_workers(client, gather, workers, threads)
    _check_picture(names, layers, size, denoise, chosen.gi)
    files = FrameFiles(str(output), names, list(layers), chosen.transparent)
    path = _path_of(camera_path, turntable, camera)
    # Load the scene here, too: for its notes, and for the digest that the workers' must have.
    loaded, seconds, notes = lit_at(scene, environment, at, animation)
    warn_of(notes, stacklevel=2)
    source, time = _source_of(scene, environment, at, loaded), None if is_usd(scene) else seconds
    view, shows = index_or_camera(loaded, camera_of(loaded, camera)), (*layers,)
    more = (time, animation, fps, path, turntable, adapter, denoise)
    job = Job(source, view, chosen, size, frames, names, shows, *more)
    here = connected(workers=workers, threads=threads, adapter=adapter) if client is None else nullcontext(client)
    with here as dask:
        return _render(dask, job, scene, loaded, files, gather, progress)


def _path_of(file: str | Path | None, turntable: bool, camera: object) -> CameraPath | None:
    """Return the camera path of a file. Raises GiError if the camera is given otherwise, too."""
    if file is not None and (turntable or camera is not None):
        raise GiError("camera_path gives the camera of every frame; leave out turntable and camera")
    return None if file is None else load_camera_path(file)


def _source_of(scene: Any, environment: Any, at: float | None, loaded: Scene) -> SceneSource:
    """Return what workers load: a file themselves; a scene of this process is sent to them."""
    if isinstance(scene, str | Path):
        return SceneSource(scene, environment, time=at)
    return SceneSource(loaded, time=at)


def _render(
    client: Client, job: Job, scene: Any, loaded: Scene, files: FrameFiles, gather: bool, progress: Any
) -> FarmResult:
    """Render a job; `progress` receives the fraction done."""

    def tick(state: FarmProgress, _what: str) -> None:
        if progress is not None:
            progress(state.fraction)

    return render_job(
        client,
        job,
        loaded,
        files,
        metadata=_metadata(job, scene),
        command=lambda timeline: _command(job, loaded, timeline),
        gather=gather,
        tick=tick,
        note=lambda text: warn_of([text], stacklevel=2),
    )


def _check(output: object, frames: object, fps: object, progress: object) -> None:
    """Raise GiError for values of a wrong type."""
    if not isinstance(output, str | Path) or is_video(output):
        raise GiError(f'output is the name of frames, such as "f/{{frame:04d}}.exr", not {shown(output)}')
    if not isinstance(frames, range) or not frames or frames.start < 0 or frames.step < 1:
        raise GiError(f"frames are a range such as range(240), of numbers from 0, not {shown(frames)}")
    if not is_whole(fps) or not 1 <= fps <= 1000:  # type: ignore[operator]
        raise GiError(f"fps must be a whole number from 1 to 1000, not {shown(fps)}")
    if progress is not None and not callable(progress):
        raise GiError(f"progress must be a function of the fraction done, not {shown(progress)}")


def _check_workers(client: object, gather: object, workers: object, threads: object) -> None:
    """Raise GiError for a wrong client, and for numbers of workers and threads that make no sense."""
    if client is not None:
        if not isinstance(client, require_dask().Client) or client.asynchronous:  # type: ignore[attr-defined]
            raise GiError(f"client must be a distributed.Client that is not asynchronous, or None, not {shown(client)}")
        if workers is not None or threads is not None:
            raise GiError("workers and threads are for processes on this machine; leave them out with a client")
    if not isinstance(gather, bool):
        raise GiError(f"gather must be True or False, not {shown(gather)}")
    for name, number in (("workers", workers), ("threads", threads)):
        if number is not None and (not is_whole(number) or number < 1):  # type: ignore[operator]
            raise GiError(f"{name} must be a whole number from 1, not {shown(number)}")


def _check_picture(names: Sequence[str], layers: Sequence[str], size: tuple[int, int], denoise: bool, gi: str) -> None:
    """Raise GiError for buffers, a size or a denoiser that cannot be rendered."""
    check_buffers((*names, *layers), gi)
    check_size(size)
    check_denoise(denoise, names, gi)


def _metadata(job: Job, scene: Any) -> dict[str, object]:
    """Return the metadata of the pictures."""
    name = str(scene) if isinstance(scene, str | Path) else getattr(scene, "name", "")
    settings = job.settings
    values = {field: getattr(settings, field) for field in ("gi", "bounces", "spp", "seed", "diffuse", "transparent")}
    return {"software": f"wgpu_gi {__version__}", "scene": name, **values, "denoise": job.denoise}


def _command(job: Job, scene: Scene, timeline: Timeline) -> dict[str, object]:
    """Return what must be equal in all runs that share the frames."""
    return {
        "software": f"wgpu_gi {__version__}",
        "scene": digest_of(scene),
        "settings": digest(job.settings),
        "size": list(job.size),
        "frames": [job.frames.start, job.frames.stop, job.frames.step],
        "show": list(job.shown),
        "layers": list(job.layers),
        "denoise": job.denoise,
        "animation": job.animation,
        **({"fps": job.fps} if timeline.plays else {}),
    }
