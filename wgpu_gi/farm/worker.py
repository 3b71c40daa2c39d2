"""What a Dask worker does: it loads the scene of a job once, keeps it with its pipelines, and renders blocks.

A process keeps one job, the last that it was asked for. Workers with several threads render one block at a time.
"""

from __future__ import annotations

import hashlib
import os
import platform
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

from ..errors import GiError, LostDevice
from ..pictures.exposure import exposure_text
from ..renderer import Renderer
from ..resources import resource_dir
from ..scene.digest import digest
from ..scene.scene import Scene
from ..sequence.blocks import block_of
from ..sequence.files import FrameFiles, Pictures
from ..sequence.job import Job, Timeline
from ..sequence.render import JobRenderer
from ..version import __version__
from .chunk_task import UnfitWorker

LOST_DEVICE = 70  # exit code of a worker that has lost its device twice (EX_SOFTWARE of sysexits.h)


@dataclass(frozen=True)
class SentJob:
    """A job as it is sent to the workers, the same for all.

    `name` is a digest of all that a picture depends on. `scene_digest` is that of the client's scene, see `digest_of`,
    `code_digest` that of its wgpu_gi. `token` is a file in the folder of the output, and what it holds; None if the
    workers need not see that folder.
    """

    name: str
    job: Job
    scene_digest: str
    code_digest: str
    token: tuple[str, str] | None = field(default=None, kw_only=True)


@dataclass(frozen=True)
class Work(SentJob):
    """The frames to render, and where to.

    With `gather`, the files of a frame are returned instead of written, and `existing` are the frames whose files the
    client has.
    """

    files: FrameFiles
    metadata: dict[str, object]
    gather: bool = False
    existing: frozenset[int] = field(default_factory=frozenset)

    def exists(self, frame: int) -> bool:
        """Tell whether the files of a frame exist."""
        return frame in self.existing if self.gather else self.files.exist(frame)


class Findings(NamedTuple):
    """What the first worker finds out for all: see `JobRenderer`."""

    has_history: bool
    exposure: float | None


class Done(NamedTuple):
    """What became of a block: the frames rendered for it, warm-up not counted, and with `gather` their files."""

    frames: tuple[int, ...]
    files: dict[int, dict[str, bytes]]  # by frame and extension
    seconds: float


def digest_of(scene: Scene) -> str:
    """Return a digest of a loaded scene with its cameras and animations."""
    return digest((scene, scene.cameras, scene.animations))


@cache
def code_digest() -> str:
    """Return a digest of the package's modules and shaders."""
    total = hashlib.blake2b(digest_size=16)
    package = Path(__file__).resolve().parents[1]
    for folder, pattern in ((package, "*.py"), (resource_dir("wgsl"), "*.wgsl")):
        for file in sorted(folder.rglob(pattern)):
            total.update(file.relative_to(folder).as_posix().encode() + b"\0" + file.read_bytes())
    return total.hexdigest()


# -------------------------------------------------------------------------------------- Tasks


def check(work: SentJob) -> str:
    """Load the job; return the name of the adapter. Raises UnfitWorker, or GiError without an adapter."""
    check_machine(work)
    with _loaded(work) as state:
        return state.renderer.adapter_name


def find_out(work: Work, needs_exposure: bool) -> Findings:
    """Find out what all workers need to know; renders the first frame."""

    def answer(state: Loaded) -> Findings:
        exposure = state.sequence.exposure(work.files.output, _silent) if needs_exposure else None
        return Findings(state.sequence.has_history(), exposure)

    return with_new_device(work, answer)


def render_blocks(payload: dict[str, Any], numbers: list[int]) -> list[Done]:
    """Render the missing frames of blocks; `payload` holds "work" and "findings".

    Raises UnfitWorker, since a worker may have joined after the others were checked.
    """
    work, findings = payload["work"], payload["findings"]
    check_machine(work)
    return [with_new_device(work, partial(_block, work, findings, number)) for number in numbers]


def _block(work: Work, findings: Findings, number: int, state: Loaded) -> Done:
    """Render the missing frames of a block and write them, or keep the contents of their files."""
    start, frames, files = time.perf_counter(), [], {}
    block = block_of(work.job.frames, findings.has_history, number)
    metadata = {**work.metadata, "adapter": state.renderer.adapter_name}
    if findings.exposure is not None:
        is_automatic = work.job.settings.exposure is None
        metadata["exposure"] = exposure_text(findings.exposure, is_automatic)
    for frame, pictures in state.sequence.render(block, findings.has_history, work.exists, _silent):
        more = metadata | state.sequence.timeline.shown_at(frame)
        if work.gather:
            files[frame] = _contents(work.files, frame, pictures, findings.exposure, more)
        else:
            work.files.add(frame, pictures, findings.exposure, more)
        frames.append(frame)
    return Done(tuple(frames), files, time.perf_counter() - start)


def _contents(
    files: FrameFiles, frame: int, pictures: Pictures, exposure: float | None, metadata: dict[str, object]
) -> dict[str, bytes]:
    """Return the contents of the files of a frame by extension: the layers first, as they are written."""
    with tempfile.TemporaryDirectory(prefix="wgpu_gi-") as folder:
        local = files.moved_to(Path(folder))
        local.add(frame, pictures, exposure, metadata)
        return {path.suffix: path.read_bytes() for path in local.paths(frame)}


def _silent(_fraction: float, _what: str | None = None, /) -> None:
    """Report nothing."""


def check_machine(work: SentJob) -> None:
    """Raise UnfitWorker if the code of this worker is not the client's, or the folder of the output is not shared."""
    if code_digest() != work.code_digest:
        raise UnfitWorker(
            f"wgpu_gi on the worker on {platform.node()} ({__version__}) is another than on this machine; install the"
            " same on all"
        )
    if work.token is not None:
        _check_token(*work.token)


def _check_token(file: str, text: str) -> None:
    """Raise UnfitWorker if the client's token is not in the folder of the output, or nothing can be written there."""
    try:
        found = Path(file).read_text(encoding="utf-8")
    except OSError:
        found = ""
    folder = os.path.dirname(file)
    if found != text:
        raise UnfitWorker(
            f"the folder {folder} is not shared with the worker on {platform.node()}; give one that all machines see,"
            " or add --gather, which sends the pictures back"
        )
    if not os.access(folder, os.W_OK):
        raise UnfitWorker(f"the worker on {platform.node()} may not write to the folder {folder}; add --gather")


# -------------------------------------------------------------------------------------- The job that is kept


class Loaded(NamedTuple):
    """A job with its scene on the GPU."""

    name: str
    renderer: Renderer
    sequence: JobRenderer


_lock = threading.RLock()
_kept: list[Loaded] = []  # one at most


@contextmanager
def _loaded(work: SentJob) -> Iterator[Loaded]:
    """Yield the job of the work, alone; load it if it is not the one that is kept."""
    with _lock:
        if not _kept or _kept[0].name != work.name:
            release()
            _kept.append(_load(work))
        yield _kept[0]


def release() -> None:
    """Free the job that this process keeps."""
    with _lock:
        while _kept:
            _kept.pop().renderer.close()


def _load(work: SentJob) -> Loaded:
    """Load the scene and open the adapter. Raises UnfitWorker if the scene is not the client's."""
    job, source = work.job, work.job.source.scene
    where = f"{source if isinstance(source, str) else 'the scene'} on the worker on {platform.node()}"
    try:
        scene = job.source.load()
    except GiError as error:
        raise UnfitWorker(f"{where} cannot be loaded: {error}") from None
    if digest_of(scene) != work.scene_digest:
        raise UnfitWorker(
            f"{where} is another than here; copy the scene with its textures to every machine, and install the same"
            " versions of optional packages"
        )
    renderer = job.renderer(scene)
    return Loaded(work.name, renderer, JobRenderer(job, renderer, Timeline(job, scene)))


def with_new_device(work: SentJob, use: Callable[[Loaded], Any]) -> Any:
    """Use the loaded job; if the driver loses the device, load it anew, once. A second loss ends the process.

    A process without a nanny raises LostDevice instead: nothing would start it again, and it may be the user's own.
    """
    with _lock:
        try:
            with _loaded(work) as state:
                return use(state)
        except LostDevice:
            _kept.clear()
        except MemoryError:
            release()
            raise
        try:
            with _loaded(work) as state:
                return use(state)
        except LostDevice:
            if not _has_nanny():
                release()
                raise
            os._exit(LOST_DEVICE)  # the driver does not recover in this process; a nanny starts another


def _has_nanny() -> bool:
    """Tell whether a Dask nanny starts this worker again when its process ends."""
    from distributed import get_worker

    return get_worker().nanny is not None
