"""The task that a Dask worker runs: the items of a chunk one after another, each with its own result or failure.

Failures travel as text: an exception that cannot be pickled would lose the results of its chunk.
"""

from __future__ import annotations

import pickle
import time
import traceback
from collections.abc import Callable, Hashable, Sequence
from enum import Enum
from typing import Any, NamedTuple

from ..errors import DiskFull, GiError, LostDevice

# Bytes of an event. The scheduler keeps the last 1,000 events of a topic, in Dask's default configuration.
SMALL = 16384


class UnfitWorker(GiError):
    """A worker cannot take part in the job, such as where its scene differs or the folder is not shared."""


class Kind(Enum):
    """What a failure is about."""

    ITEM = "the item, in a way that the user can mend"
    CHANCE = "anything else: memory, the device, a fault of the program"
    WORKER = "the worker"
    DISK = "the disk is full"


class Failure(NamedTuple):
    """Why an item was not done."""

    kind: Kind
    reason: str


class Outcome(NamedTuple):
    """What became of an item: its result or its failure, and the seconds that it took."""

    item: Hashable
    result: Any
    failure: Failure | None
    seconds: float


Task = Callable[[Any, list[Any]], list[Any]]


def failure_of(error: Exception) -> Failure:
    """Return what an exception of a task means."""
    if isinstance(error, UnfitWorker):
        return Failure(Kind.WORKER, str(error))
    if isinstance(error, DiskFull):
        return Failure(Kind.DISK, str(error))
    if isinstance(error, GiError):
        return Failure(Kind.CHANCE if isinstance(error, LostDevice) else Kind.ITEM, str(error))
    frames = traceback.extract_tb(error.__traceback__)
    where = f" (line {frames[-1].lineno} of {frames[-1].filename})" if frames else ""
    return Failure(Kind.CHANCE, f"{type(error).__name__}: {error}{where}")


def do_chunk(task: Task, payload: Any, items: Sequence[Hashable], topic: str, number: int) -> list[Outcome]:
    """Do the items until the chunk is cancelled, the worker is unfit or the disk is full.

    Outcomes of few bytes are also sent as an event of a topic, with the number of the chunk: events take the open
    connection to the scheduler and on to the client, where results are fetched by new connections to each worker.
    """
    from distributed import get_worker

    outcomes: list[Outcome] = []
    for item in items:
        if _is_cancelled():
            break
        start = time.perf_counter()
        result, failure = None, None
        try:
            (result,) = task(payload, [item])
        except Exception as error:
            failure = failure_of(error)
        outcomes.append(Outcome(item, result, failure, time.perf_counter() - start))
        if failure is not None and failure.kind in (Kind.WORKER, Kind.DISK):
            break
    message = pickle.dumps((number, outcomes))
    if len(message) <= SMALL:
        get_worker().log_event(topic, message)
    return outcomes


def _is_cancelled() -> bool:
    """Tell whether the client has cancelled the running task; Dask itself lets the task run to its end."""
    from distributed import get_worker

    worker = get_worker()
    task = worker.state.tasks.get(worker.get_current_task())
    return task is None or task.state == "cancelled"
