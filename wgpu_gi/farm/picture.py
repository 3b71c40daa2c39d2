"""Renders one picture in tiles (`wgpu_gi.tiles`) by the workers of a Dask cluster.

The tiles are sent back and put together here, bit for bit the picture of `render --tiles` on one machine. Until the
picture is written, finished tiles lie in a folder beside it, so a run that was stopped goes on where it ended.
"""

from __future__ import annotations

import hashlib
import pickle
import shutil
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import DiskFull
from ..pictures.atomic_file import atomic_file
from ..pictures.tables import Table
from ..scene.scene import Scene
from ..sequence.job import Job
from ..tiles import Tiled, TilePlan, check_tiles, render_tile
from .checking import check_workers
from .client import check_versions
from .progress import FarmProgress
from .run import Tick, sent, sent_job
from .schedule import Summary, run_chunks
from .worker import Loaded, SentJob, check_machine, with_new_device

if TYPE_CHECKING:
    from distributed import Client

DAMAGED = (OSError, ValueError, KeyError, EOFError)  # of a stored tile that cannot be read


@dataclass(frozen=True)
class TileWork(SentJob):
    """A picture and its tiles."""

    plan: TilePlan


class TileDone(NamedTuple):
    """A finished tile: buffers by name, and the adapter that rendered it."""

    parts: dict[str, NDArray]
    adapter: str


@dataclass(frozen=True)
class FarmPicture:
    """A picture that a farm has rendered: its buffers, None if tiles are missing, and the adapters that rendered it.

    `done` of `total` tiles are new; `failed`: the others by number, and why. `stopped`: why it ended before all tiles
    were tried. `count` workers took `seconds`.
    """

    tiled: Tiled | None
    adapters: str
    total: int
    done: int
    failed: dict[int, str]
    stopped: str | None
    seconds: float
    count: int
    workers: Table

    def sentence(self) -> str:
        """Return what was done, in a sentence, and how to go on if tiles are missing."""
        workers = f"{self.count} {'worker' if self.count == 1 else 'workers'}"
        text = f"{self.done} of {self.total} tiles rendered in {self.seconds:.1f} s by {workers}"
        why = [] if self.stopped is None else [self.stopped]
        if self.failed:
            number, reason = min(self.failed.items())
            tiles = "tile" if len(self.failed) == 1 else "tiles"
            why.append(f"{len(self.failed)} {tiles} failed, such as {number + 1}: {reason}")
        if self.tiled is None:
            why.append("the same command renders what is missing")
        return "; ".join([text, *why])


def render_picture(
    client: Client,
    job: Job,
    scene: Scene,
    plan: TilePlan,
    output: str | Path,
    tick: Tick = lambda progress, what: None,
    note: Callable[[str], None] = lambda text: None,
) -> FarmPicture:
    """Render the picture of a job, whose scene is loaded here as well, in the tiles of `plan`; write nothing yet.

    `output` is where the caller writes the picture: finished tiles are kept in a folder beside it until `forget_tiles`.
    Raises GiError if the technique needs the whole picture, or the cluster cannot render the job.
    """
    check_tiles(job.settings, scene, job.show)
    check_versions(client)
    start, progress = time.monotonic(), FarmProgress()
    work = TileWork(*sent_job(replace(job, size=plan.tiles[0].window_size), scene), plan)
    payload = {"work": sent(client, work)}
    check_workers(client, payload["work"], lambda: tick(progress, "loading the scene on the workers"))

    # Take the tiles that a run before this one has finished; have the others rendered.
    picture = _Picture(plan, _Store(output, work))
    missing = [number for number in range(len(plan.tiles)) if not picture.restore(number)]
    progress.start, progress.total = time.monotonic(), len(missing)

    def on_done(number: int, done: TileDone, worker: str, seconds: float) -> None:
        picture.add(number, done)
        progress.add(worker, 1, seconds)

    failed: dict[int, str] = {}
    try:
        summary = run_chunks(
            client,
            render_numbers,
            missing,
            payload=payload,
            on_done=on_done,
            on_failed=failed.__setitem__,
            on_tick=lambda: tick(progress, progress.line("tiles")),
        )
    except DiskFull as error:
        summary = Summary(stopped=str(error))
    for worker, reason in summary.left_out.items():
        note(f"the worker at {worker} was left out: {reason}")
    is_complete = summary.stopped is None and not failed
    return FarmPicture(
        tiled=Tiled(picture.buffers, job.settings.exposure) if is_complete else None,
        adapters=" and ".join(sorted(picture.adapters)),
        total=len(plan.tiles),
        done=progress.done,
        failed=failed,
        stopped=summary.stopped,
        seconds=time.monotonic() - start,
        count=len(progress.rows),
        workers=progress.table("tiles"),
    )


def render_numbers(payload: dict[str, Any], numbers: list[int]) -> list[TileDone]:
    """Render tiles on a worker; `payload` holds "work"."""
    work: TileWork = payload["work"]
    check_machine(work)
    return [with_new_device(work, partial(_render, work, number)) for number in numbers]


def _render(work: TileWork, number: int, state: Loaded) -> TileDone:
    renderer, job = state.renderer, work.job
    renderer.time = job.time
    parts = render_tile(renderer, work.plan.tiles[number], work.plan.size, job.show, check=job.check)
    return TileDone(parts, renderer.adapter_name)


class _Picture:
    """A picture that is put together from its tiles."""

    def __init__(self, plan: TilePlan, store: _Store) -> None:
        self._plan, self._store = plan, store
        self.buffers: dict[str, NDArray] = {}
        self.adapters: set[str] = set()

    def restore(self, number: int) -> bool:
        """Put in a tile that an earlier run has finished; return whether there is one."""
        done = self._store.load(number)
        if done is not None:
            self._put(number, done)
        return done is not None

    def add(self, number: int, done: TileDone) -> None:
        """Keep a finished tile, and put it in."""
        self._store.save(number, done)
        self._put(number, done)

    def _put(self, number: int, done: TileDone) -> None:
        width, height = self._plan.size
        for name, part in done.parts.items():
            if name not in self.buffers:
                self.buffers[name] = np.empty((height, width, *part.shape[2:]), part.dtype)
            self._plan.tiles[number].put(part, self.buffers[name])
        self.adapters.add(done.adapter)


class _Store:
    """Finished tiles on disk, beside the picture to be written."""

    def __init__(self, output: str | Path, work: TileWork) -> None:
        text = pickle.dumps((work.name, work.code_digest, work.plan))
        self._name = hashlib.blake2b(text, digest_size=8).hexdigest()
        self._folder = _folder_of(output)

    def _path(self, number: int) -> Path:
        return self._folder / f"{self._name}-{number}.npz"

    def load(self, number: int) -> TileDone | None:
        """Return a tile, None if it is not there or damaged."""
        with suppress(*DAMAGED), np.load(self._path(number)) as file:
            parts = {name[1:]: file[name] for name in file.files if name.startswith("_")}
            return TileDone(parts, str(file["adapter"]))
        return None

    def save(self, number: int, done: TileDone) -> None:
        """Keep a tile. Raises GiError if it cannot be written."""
        self._folder.mkdir(exist_ok=True)
        with atomic_file(self._path(number)) as temporary, open(temporary, "wb") as file:
            arrays: dict[str, Any] = {f"_{name}": part for name, part in done.parts.items()}
            np.savez(file, adapter=done.adapter, **arrays)


def forget_tiles(output: str | Path) -> None:
    """Delete the finished tiles of a picture that has been written."""
    shutil.rmtree(_folder_of(output), ignore_errors=True)


def _folder_of(output: str | Path) -> Path:
    return Path(f"{output}.tiles")
