"""How many items a worker gets at once: chunks by measured seconds, smaller toward the end.

An item is what is never split, such as a block of frames. Guided self-scheduling (Polychronopoulos and Kuck 1987,
section 3) bounds a chunk by a share of the rest, so that all workers end at about the same time. Departures: a chunk
also has a least and a greatest time, and grows by steps, because the times of items are known only when some are done.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Hashable, Iterable, Sequence
from typing import NamedTuple

Item = Hashable

# The greatest seconds of a chunk: a killed worker loses half of it on average, and progress is shown as often.
LONGEST = 20.0
# Chunks that each worker still gets of the rest; more make the end shorter and cost more chunks.
SHARES = 3
# The client and the scheduler spend about this many seconds on a chunk, see tools/README.md. Chunks are so long that
# these never work more than half of the time.
OVERHEAD = 0.005
# A chunk has at most this many times the items of the worker's chunk before it: the first of a scene may be quick.
GROWTH = 4


class Speeds:
    """Seconds per unit of cost, of each worker and of all. The first chunk of a worker includes the loading."""

    def __init__(self) -> None:
        self._worker: dict[str, float] = {}
        self._counts: dict[str, int] = {}
        self._first: float | None = None
        self._all: float | None = None
        self._longest_start = 0.0

    def add(self, worker: str, cost: float, seconds: float, count: int) -> None:
        """Take the time of a chunk of `count` items."""
        pace = seconds / cost
        if worker not in self._worker:
            self._longest_start = max(self._longest_start, seconds)
            self._first = pace if self._first is None else min(self._first, pace)
        else:
            self._all = pace if self._all is None else self._all + (pace - self._all) / 16
        self._worker[worker], self._counts[worker] = pace, count

    def forget(self, worker: str) -> None:
        """Drop a worker that has ended."""
        self._worker.pop(worker, None)
        self._counts.pop(worker, None)

    def knows(self, worker: str) -> bool:
        """Tell whether a worker has ended a chunk."""
        return worker in self._worker

    def seconds(self, worker: str | None, cost: float) -> float | None:
        """Return the expected seconds of a cost on a worker, or (None) on the average worker; None if unknown."""
        usual = self._first if self._all is None else self._all
        pace = usual if worker is None else self._worker.get(worker, usual)
        return None if pace is None else pace * cost

    def expected(self, worker: str, cost: float) -> float | None:
        """Return the expected seconds of a chunk with the loading; None if no worker has ended its first chunk."""
        seconds = self.seconds(worker, cost)
        if seconds is None:
            return None
        return seconds if worker in self._worker else max(seconds, self._longest_start)

    def most_items(self, worker: str) -> int:
        """Return the greatest number of items of the worker's next chunk."""
        return GROWTH * self._counts.get(worker, 0) or 1


class Run(NamedTuple):
    """Items that are tried again together, and the workers on which they have failed."""

    items: tuple[Item, ...]
    failed_on: frozenset[str] = frozenset()


class Waiting:
    """The items that no worker has, in order; those to be tried again come first."""

    def __init__(self, items: Iterable[Item], cost_of: Callable[[Item], float]) -> None:
        self._cost_of = cost_of
        self._fresh = deque(items)
        self._again: list[Run] = []
        self._cost = sum(map(cost_of, self._fresh))

    def __len__(self) -> int:
        return len(self._fresh) + sum(len(run.items) for run in self._again)

    def items(self) -> tuple[Item, ...]:
        """Return the fresh items."""
        return tuple(self._fresh)

    def cost(self, items: Sequence[Item]) -> float:
        """Return the cost of items."""
        return sum(map(self._cost_of, items))

    def put_back(self, run: Run) -> None:
        """Have a run tried again, as one chunk."""
        self._again.append(run)
        self._cost += self.cost(run.items)

    def take_again(self, worker: str, fit: set[str]) -> tuple[Item, ...]:
        """Take a run for a worker on which it has not failed, or for any if it has failed on all fit ones."""
        for number, run in enumerate(self._again):
            if worker not in run.failed_on or run.failed_on >= fit:
                del self._again[number]
                self._cost -= self.cost(run.items)
                return run.items
        return ()

    def take(self, worker: str, workers: int, speeds: Speeds) -> tuple[Item, ...]:
        """Take a chunk of fresh items for a worker, one of `workers`; one item while no speed is known."""
        rest = speeds.seconds(None, self._cost)
        share = 0.0 if rest is None else rest / (SHARES * workers)
        wanted = max(min(share, LONGEST), 2 * OVERHEAD * workers)
        taken: list[Item] = []
        seconds, most = 0.0, speeds.most_items(worker)
        while self._fresh and len(taken) < most:
            cost = self._cost_of(self._fresh[0])
            more = speeds.seconds(worker, cost) or 0.0
            if taken and seconds + more > wanted:
                break
            taken.append(self._fresh.popleft())
            self._cost -= cost
            seconds += more
        return tuple(taken)
