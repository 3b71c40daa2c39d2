"""Renders the frames of a job by the workers of a Dask cluster.

Before anything is written, each worker loads the scene and is checked. The first measures the exposure of all frames.
Blocks then go to the workers by `schedule`, which loses none; another command that renders the same frames takes its
share (`claims`). Pictures are bit for bit those of `render --frames` on one machine.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import secrets
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from ..errors import DiskFull
from ..pictures.atomic_file import atomic_file
from ..pictures.tables import Table
from ..scene.scene import Scene
from ..sequence.blocks import block_count, block_of
from ..sequence.claims import Claim, Claims, wait_for
from ..sequence.files import FrameFiles
from ..sequence.job import Job, Timeline
from ..sequence.shards import ALL, Shards
from .checking import ask, check_workers
from .client import check_versions
from .progress import FarmProgress
from .schedule import Summary, run_chunks
from .worker import Done, Findings, SentJob, Work, code_digest, digest_of, find_out, render_blocks

if TYPE_CHECKING:
    from distributed import Client, Future

SMALL = 65536  # bytes of a description that is sent with each chunk
Tick = Callable[[FarmProgress, str], None]  # receives the progress and what is done now, twice a second


@dataclass(frozen=True)
class FarmResult:
    """What a farm has rendered: the number of new frames, those that failed and why, and who rendered how many.

    `repeated`: blocks given to a worker again. `left_out`: workers that could not go on, and why. `stopped`: why it
    ended before all frames were tried, None if it did not.
    """

    output: str
    done: int = 0
    seconds: float = 0.0
    failed: dict[int, str] = field(default_factory=dict)
    workers: Table = field(default_factory=lambda: Table(""))
    count: int = 0
    repeated: int = 0
    deaths: int = 0
    left_out: dict[str, str] = field(default_factory=dict)
    stopped: str | None = None

    @property
    def is_complete(self) -> bool:
        """Whether every frame is there."""
        return not self.failed and self.stopped is None

    def sentence(self) -> str:
        """Return what was done, in a sentence, and how to go on if frames are missing."""
        workers = f"{self.count} {'worker' if self.count == 1 else 'workers'}"
        rate = f", {self.done / self.seconds:.3g} frames/s" if self.done and self.seconds else ""
        text = f"{self.output}: {self.done} new frames in {self.seconds:.1f} s by {workers}{rate}"
        if self.repeated:
            text += f"; {self.repeated} {'block was' if self.repeated == 1 else 'blocks were'} started again"
        if self.is_complete:
            return text
        why = [] if self.stopped is None else [self.stopped]
        if self.failed:
            frame, reason = min(self.failed.items())
            frames = "frame" if len(self.failed) == 1 else "frames"
            why.append(f"{len(self.failed)} {frames} failed, such as {frame}: {reason}")
        return f"{text}; {'; '.join(why)}; the same command renders what is missing"


def render_job(
    client: Client,
    job: Job,
    scene: Scene,
    files: FrameFiles,
    *,
    metadata: dict[str, object],
    command: Callable[[Timeline], dict[str, object]],
    gather: bool = False,
    shards: Shards = ALL,
    tick: Tick = lambda progress, what: None,
    note: Callable[[str], None] = lambda text: None,
) -> FarmResult:
    """Render the missing frames of a job, whose scene is loaded here as well; see `gi.farm.render`.

    `metadata` of the pictures, without the adapter. `command` returns what the .json keeps. Raises GiError if the
    cluster cannot render the job; nothing has been written then.
    """
    start, timeline, progress = time.monotonic(), Timeline(job, scene), FarmProgress()
    check_versions(client)
    with _folder_of(files), _token_in(files, gather) as token:
        # Load the scene on every worker, and check the workers.
        work = make_work(job, scene, files, metadata, gather, token)
        payload: dict[str, Any] = {"work": sent(client, work)}
        fit = check_workers(client, payload["work"], lambda: tick(progress, "loading the scene on the workers"))
        files.claim(command(timeline), timeline.cameras())
        run = _Run(client, work, files, progress, tick, note, shards)
        if all(map(files.exist, job.frames)):
            return run.result(Summary(), start)

        # Find out what all workers need to know; the first to measure the exposure has it kept.
        progress.start = time.monotonic()
        needs_exposure = not files.has_exposure()
        found = ask(
            client, fit, find_out, payload["work"], needs_exposure, lambda: tick(progress, "rendering the first frame")
        )
        exposure = files.exposure(lambda: found.exposure)
        payload["findings"] = run.findings = Findings(found.has_history, exposure)

        # Render. The token stays, since each worker looks for it before each block: more may join at any time.
        return run.result(run.render(payload), start)


def make_work(
    job: Job, scene: Scene, files: FrameFiles, metadata: dict[str, object], gather: bool, token: tuple[str, str] | None
) -> Work:
    """Return the description that is sent to the workers: with absolute paths, since they run in other folders."""
    existing = frozenset(filter(files.exist, job.frames)) if gather else frozenset()
    placed = files.moved_to(os.path.abspath(Path(files.output).parent))
    return Work(*sent_job(job, scene), placed, metadata, gather, existing, token=token)


def sent_job(job: Job, scene: Scene) -> tuple[str, Job, str, str]:
    """Return the first fields of `SentJob` for a job whose scene is loaded here."""
    source = replace(job.source, scene=_placed(job.source.scene), environment=_placed(job.source.environment))
    sent = replace(job, source=source)
    scene_digest = digest_of(scene)
    bare = replace(sent, source=replace(source, scene="", environment=None))
    name = hashlib.blake2b(scene_digest.encode() + pickle.dumps(bare), digest_size=16).hexdigest()
    return name, sent, scene_digest, code_digest()


def _placed(source: Any) -> Any:
    """Return an absolute path for that of a file, and anything else as it is."""
    if isinstance(source, str | Path) and os.path.isfile(source):
        return os.path.abspath(source)
    return source


def sent(client: Client, work: SentJob) -> SentJob | Future:
    """Return what the tasks receive: a small description itself, else a result that the cluster keeps.

    Dask drops copies of a result every few seconds, so workers fetch it again for each chunk, from one that may hang.
    """
    is_small = len(pickle.dumps(work)) <= SMALL
    return work if is_small else client.submit(_same, work, pure=False)


def _same(work: SentJob) -> SentJob:
    """Return the work: as the result of a task, the cluster keeps it, and makes it again if its worker ends."""
    return work


@contextmanager
def _folder_of(files: FrameFiles) -> Iterator[None]:
    """Make the folder of the output; remove it again if it is new and the block raises an exception."""
    folder = Path(files.output).parent
    new = [path for path in (folder, *folder.parents) if not path.exists()]
    files.make_folder()
    try:
        yield
    except BaseException:
        for path in new:
            with suppress(OSError):
                path.rmdir()
        raise


@contextmanager
def _token_in(files: FrameFiles, gather: bool) -> Iterator[tuple[str, str] | None]:
    """Yield the name and the contents of a file in the folder of the output, which workers that share it can read."""
    if gather:
        yield None
        return
    text = secrets.token_hex(16)
    file = Path(os.path.abspath(Path(files.output).parent), f".wgpu_gi-{text[:8]}.token")
    with atomic_file(file) as temporary:
        temporary.write_text(text, encoding="utf-8")
    try:
        yield str(file), text
    finally:
        with suppress(OSError):
            file.unlink()


class _Run:
    """The frames of a job on their way through the workers."""

    findings: Findings

    def __init__(
        self,
        client: Client,
        work: Work,
        files: FrameFiles,
        progress: FarmProgress,
        tick: Tick,
        note: Callable[[str], None],
        shards: Shards,
    ) -> None:
        self.client, self.work, self.files, self.progress = client, work, files, progress
        self.tick, self.note, self.shards = tick, note, shards
        self.failed: dict[int, str] = {}
        self.missing: dict[int, list[int]] = {}  # frames by block

    def render(self, payload: Mapping[str, Any]) -> Summary:
        """Render the missing blocks, but those that another command renders; wait for these."""
        frames, has_history = self.work.job.frames, self.findings.has_history
        for number in self.shards.numbers(block_count(frames, has_history)):
            missing = [f for f in block_of(frames, has_history, number) if not self.files.exist(f)]
            if missing:
                self.missing[number] = missing
        self.progress.total = sum(map(len, self.missing.values()))
        with Claims(self.files.job_file) as claims:
            summary = self._run_chunks(payload, list(self.missing), claims)
            left = cast(set[int], summary.elsewhere)
            self.progress.total -= self._frame_count(left)
            while summary.stopped is None and (free := wait_for(claims, sorted(left), self._is_done, self._tell)):
                self.progress.total += self._frame_count(free)
                more = self._run_chunks(payload, free, claims)
                self.progress.total -= self._frame_count(cast(set[int], more.elsewhere))
                left = left.difference(free) | cast(set[int], more.elsewhere)  # what failed is not tried again
                summary = _sum(summary, more)
        return summary

    def _run_chunks(self, payload: Mapping[str, Any], numbers: list[int], claims: Claims) -> Summary:
        try:
            return run_chunks(
                self.client,
                render_blocks,
                numbers,
                payload=dict(payload),
                on_done=lambda number, done, worker, seconds: self._on_done(number, done, worker, claims),
                on_failed=lambda number, reason: self._on_failed(number, reason, claims),
                on_tick=lambda: self.tick(self.progress, self.progress.line()),
                seconds_of=lambda number: float(len(self.missing[number])),
                admit=lambda numbers: self._admit(numbers, claims),
            )
        except DiskFull as error:
            return Summary(stopped=str(error))  # on this machine, which gathers the pictures

    def _on_done(self, number: int, done: Done, worker: str, claims: Claims) -> None:
        """Count the frames of a block; write those that were sent back."""
        for frame, contents in done.files.items():
            for path in self.files.paths(frame):
                with atomic_file(path) as temporary:
                    temporary.write_bytes(contents[path.suffix])
        self.progress.add(worker, len(self.missing[number]), done.seconds)
        claims.drop([number])

    def _admit(self, numbers: list[int], claims: Claims) -> list[int]:
        """Claim blocks; return those that no other command claims or has rendered."""
        ours = claims.take(numbers)
        done = set(filter(self._is_done, ours))
        claims.drop(done)
        return [number for number in ours if number not in done]

    def _on_failed(self, number: int, reason: str, claims: Claims) -> None:
        """Count the frames of a block as failed; leave it to other commands, which may wait for it."""
        claims.give_up([number])
        for frame in self.missing[number]:
            if not self.files.exist(frame):
                self.failed[frame] = reason
                self.progress.failed += 1

    def _frame_count(self, numbers: Iterable[int]) -> int:
        return sum(len(self.missing[number]) for number in numbers)

    def _is_done(self, number: int) -> bool:
        return all(map(self.files.exist, self.missing[number]))

    def _tell(self, others: list[Claim], count: int) -> None:
        self.tick(self.progress, f"waiting for {' and '.join(map(str, others))} to render {count} blocks of frames")

    def result(self, summary: Summary, start: float) -> FarmResult:
        """Return what was done."""
        for worker, reason in summary.left_out.items():
            self.note(f"the worker at {worker} was left out: {reason}")
        done = self.progress.done
        if summary.stopped is not None:
            # Workers may have written frames of which nobody heard.
            done = sum(self.files.exist(frame) for missing in self.missing.values() for frame in missing)
        return FarmResult(
            self.files.output,
            done,
            time.monotonic() - start,
            self.failed,
            self.progress.table(),
            len(self.progress.rows),
            summary.repeated,
            summary.deaths,
            summary.left_out,
            summary.stopped,
        )


def _sum(one: Summary, other: Summary) -> Summary:
    """Return the sum of two runs, one after the other."""
    return Summary(
        one.done + other.done,
        one.failed | other.failed,
        other.elsewhere,
        one.left_out | other.left_out,
        one.repeated + other.repeated,
        one.deaths + other.deaths,
        one.chunks + other.chunks,
        other.stopped,
    )
