"""Runs a task on many items by the workers of a Dask cluster, so that no item is lost whatever happens to a worker.

Each worker has one chunk of items at a time, so the cluster never holds more than a task per worker. The items of a
chunk whose worker ended are tried again by halves, until the one that ends workers is alone. Departures from Dask: its
work stealing moves only tasks that have not started. Here a chunk that takes too long is started a second time by an
idle worker, from its end; the first to finish settles it.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from .chunk_task import Failure, Kind, Outcome, Task
from .chunks import Item, Run, Speeds, Waiting
from .cluster import Cluster
from .failures import Failures

if TYPE_CHECKING:
    from distributed import Client

TICK = 0.5  # seconds between calls of `on_tick`
# A chunk is slow after this many times its expected seconds, and a few more; more in the first chunk of a worker, which
# loads the scene and compiles pipelines.
SLOW, GRACE, LOADING = 2.0, 3.0, 60.0


@dataclass
class Summary:
    """What a run has done.

    `failed`: items and reasons. `elsewhere`: items that `admit` left to others. `left_out`: workers and reasons.
    `repeated`: how often an item was given to a worker again, after a failure, a death or beside a slow worker.
    `deaths`: chunks whose worker ended. `stopped`: why the run ended before its items, None if it did not.
    """

    done: int = 0
    failed: dict[Item, str] = field(default_factory=dict)
    elsewhere: set[Item] = field(default_factory=set)
    left_out: dict[str, str] = field(default_factory=dict)
    repeated: int = 0
    deaths: int = 0
    chunks: int = 0
    stopped: str | None = None


@dataclass(frozen=True)
class Callbacks:
    """What a run calls, all in the thread of the caller: see `run_chunks`."""

    on_done: Callable[[Any, Any, str, float], None]
    on_failed: Callable[[Any, str], None]
    on_tick: Callable[[], None] | None
    admit: Callable[[list[Any]], list[Any]] | None


def run_chunks(
    client: Client,
    task: Task,
    items: Iterable[Item],
    *,
    payload: Any = None,
    on_done: Callable[[Any, Any, str, float], None],
    on_failed: Callable[[Any, str], None],
    on_tick: Callable[[], None] | None = None,
    seconds_of: Callable[[Any], float] | None = None,
    admit: Callable[[list[Any]], list[Any]] | None = None,
    tries: int = 3,
) -> Summary:
    """Call `task(payload, [item])` for every item on the workers of a synchronous client.

    `task` returns a list of one result. `on_done(item, result, worker, seconds)` and `on_failed(item, reason)` are
    called in this thread, one of them once for each item; `on_tick()` about twice a second. `seconds_of` gives the
    relative cost of an item, above 0. `admit(items)` is called before items are submitted for the first time, and
    returns those to be done here. `tries`: failures until an item is given up. If a callback raises, what is in flight
    is cancelled.
    """
    waiting = Waiting(items, seconds_of or (lambda item: 1.0))
    cluster = Cluster(client, task, payload)
    try:
        return _Running(cluster, waiting, Failures(tries), Callbacks(on_done, on_failed, on_tick, admit)).to_end()
    finally:
        cluster.close()


@dataclass(frozen=True, eq=False)
class _Chunk:
    """Items in flight on a worker."""

    items: tuple[Item, ...]
    worker: str
    since: float


class _Running:
    """A run in progress: the items that wait, the chunks in flight, and the workers that take part."""

    def __init__(self, cluster: Cluster, waiting: Waiting, failures: Failures, callbacks: Callbacks) -> None:
        self.cluster, self.waiting, self.failures, self.callbacks = cluster, waiting, failures, callbacks
        self.summary = Summary(failed=failures.failed, left_out=failures.left_out)
        self.unsettled = set(waiting.items())
        self.speeds = Speeds()
        self.in_flight: dict[int, _Chunk] = {}
        self.held: Counter[Item] = Counter()  # how many chunks in flight have an item
        self.alive: set[str] = set()
        self.idle: dict[str, None] = {}  # in the order in which they became idle

    def to_end(self) -> Summary:
        """Run until every item is settled or the run stops."""
        ticked = 0.0
        while self.unsettled and self.summary.stopped is None:
            if time.monotonic() - ticked > TICK:
                ticked = time.monotonic()
                if self.callbacks.on_tick is not None:
                    self.callbacks.on_tick()
                self.summary.stopped = self.cluster.why_gone() or self._why_no_worker()
                self._double_slow()
            news = self.cluster.news(TICK / 2)
            if isinstance(news, set):
                self._see_workers(news)
            elif news is not None:
                self._end(self._drop(news[0]), news[1])
            if news is not None:
                self._hand_out()
        return self.summary

    # ------------------------------------------------------------------------ Workers

    @property
    def fit(self) -> set[str]:
        """The workers that take part."""
        return self.alive - self.failures.left_out.keys()

    def _see_workers(self, workers: set[str]) -> None:
        """Take the list of workers: chunks of those that have ended are lost, new ones take part."""
        ended, self.alive = self.alive - workers, workers
        for worker in ended:
            self.idle.pop(worker, None)
            self.speeds.forget(worker)
        for number, chunk in list(self.in_flight.items()):
            if chunk.worker not in workers:
                self._lose(self._drop(number))
        busy = {chunk.worker for chunk in self.in_flight.values()}
        self.idle |= dict.fromkeys(sorted(self.fit - busy - self.idle.keys()))

    def _why_no_worker(self) -> str | None:
        """Return why the run cannot go on if every worker is left out, else None."""
        if not self.alive or self.fit or self.in_flight:
            return None
        worker, reason = next(reversed(self.failures.left_out.items()))
        return f"no worker can go on; {worker}: {reason}"

    # ------------------------------------------------------------------------ The end of a chunk

    def _end(self, chunk: _Chunk, outcomes: list[Outcome] | Failure | None) -> None:
        """Take what became of a chunk."""
        if outcomes is None:
            self.alive.discard(chunk.worker)  # until the list of workers has it again
            self._lose(chunk)
        elif isinstance(outcomes, Failure):  # of the worker, such as a module that cannot be imported
            for item in chunk.items:
                self._fail(item, chunk.worker, outcomes)
        else:
            self._settle(chunk, outcomes)
        if chunk.worker in self.fit:
            self.idle[chunk.worker] = None

    def _settle(self, chunk: _Chunk, outcomes: list[Outcome]) -> None:
        """Take the outcomes of a chunk; what it left undone is tried again."""
        good = [outcome for outcome in outcomes if outcome.failure is None]
        if good:
            cost = self.waiting.cost([outcome.item for outcome in good])
            self.speeds.add(chunk.worker, cost, sum(outcome.seconds for outcome in good), len(good))
        for item, result, failure, seconds in outcomes:
            if failure is not None:
                self._fail(item, chunk.worker, failure)
            elif item in self.unsettled:
                self.unsettled.discard(item)
                self.summary.done += 1
                self.failures.done(item, chunk.worker)
                self.callbacks.on_done(item, result, chunk.worker, seconds)
        self._try_again(chunk.items[len(outcomes) :])
        if any(self.held[item] for item in chunk.items):
            self._drop_settled()

    def _drop_settled(self) -> None:
        """Cancel the chunks in flight that another worker has settled."""
        for number, chunk in list(self.in_flight.items()):
            if self.unsettled.isdisjoint(chunk.items):
                self._drop(number)
                if chunk.worker in self.fit:
                    self.idle[chunk.worker] = None

    def _lose(self, chunk: _Chunk) -> None:
        """Have the items of a chunk tried again whose worker ended, or whose task the scheduler lost."""
        self.summary.deaths += 1
        left = [item for item in chunk.items if item in self.unsettled]
        reason = f"the worker {chunk.worker} ended (killed, out of memory, or crashed)"
        if self.cluster.is_connected:
            for item in left:
                if not self.failures.add_death(item, len(left) == 1, reason):
                    self._give_up(item)
        half = (len(left) + 1) // 2
        self._try_again(left[:half])
        self._try_again(left[half:])

    def _fail(self, item: Item, worker: str, failure: Failure) -> None:
        """Act on the failure of an item."""
        if failure.kind is Kind.DISK:
            self.summary.stopped = failure.reason
        elif item in self.unsettled:
            if self.failures.add(item, worker, failure, self.fit):
                self._try_again([item], self.failures.failed_on(item))
            else:
                self._give_up(item)

    def _try_again(self, items: Iterable[Item], failed_on: frozenset[str] = frozenset()) -> None:
        """Put items back that are not settled and that no other chunk in flight has."""
        free = tuple(item for item in items if item in self.unsettled and not self.held[item])
        if free:
            self.waiting.put_back(Run(free, failed_on))

    def _give_up(self, item: Item) -> None:
        """Settle an item that has failed for good. Stops the run if many have, and none was done."""
        self.unsettled.discard(item)
        self.callbacks.on_failed(item, self.failures.failed[item])
        if self.summary.done == 0 and self.failures.is_hopeless(len(self.alive)):
            count, reason = len(self.failures.failed), self.failures.failed[item]
            self.summary.stopped = f"none was done, and {count} failed; the last: {reason}"

    # ------------------------------------------------------------------------ The start of a chunk

    def _hand_out(self) -> None:
        """Give every idle worker a chunk, as far as there are any."""
        for worker in list(self.idle):
            if self.summary.stopped is not None or not self.waiting or not self.cluster.is_connected:
                return
            if worker in self.failures.left_out:
                del self.idle[worker]
            elif items := self._next_items(worker):
                self._submit(items, worker)

    def _next_items(self, worker: str) -> tuple[Item, ...]:
        """Return the items of the next chunk of a worker, none if nothing is left for it."""
        if items := self.waiting.take_again(worker, self.fit):
            self.summary.repeated += len(items)
            return items
        while self.failures.is_trusted(worker) and (items := self.waiting.take(worker, len(self.alive), self.speeds)):
            admit = self.callbacks.admit
            ours = items if admit is None else tuple(admit(list(items)))
            others = set(items).difference(ours)
            self.unsettled -= others
            self.summary.elsewhere |= others
            if ours:
                return ours
        return ()

    def _double_slow(self) -> None:
        """Start slow chunks a second time, by workers for which nothing waits."""
        idle = [worker for worker in self.idle if worker in self.fit]
        if not idle or not self.cluster.is_connected:
            return
        slow = [chunk for chunk in self.in_flight.values() if self._is_slow(chunk)]
        doubled = {item for chunk in self.in_flight.values() if chunk not in slow for item in chunk.items}
        for chunk, worker in zip(sorted(slow, key=lambda chunk: chunk.since), idle, strict=False):
            left = tuple(item for item in reversed(chunk.items) if item in self.unsettled and item not in doubled)
            doubled.update(left)
            if left:
                self.summary.repeated += len(left)
                self._submit(left, worker)

    def _is_slow(self, chunk: _Chunk) -> bool:
        due = self.speeds.expected(chunk.worker, self.waiting.cost(chunk.items))
        grace = GRACE if self.speeds.knows(chunk.worker) else LOADING
        return due is not None and time.monotonic() - chunk.since > SLOW * due + grace

    def _submit(self, items: tuple[Item, ...], worker: str) -> None:
        """Send a chunk to an idle worker."""
        self.idle.pop(worker)
        self.in_flight[self.cluster.submit(items, worker)] = _Chunk(items, worker, time.monotonic())
        self.held.update(items)
        self.summary.chunks += 1

    def _drop(self, number: int) -> _Chunk:
        """Forget a chunk in flight."""
        chunk = self.in_flight.pop(number)
        self.held.subtract(chunk.items)
        self.cluster.drop(number)
        return chunk
