"""What failures mean: whether an item is tried again, and whether a worker takes part any longer.

An item that fails on one worker and is done by another speaks against the first worker; one that fails on several
speaks against the item. Until that is known, the worker gets no fresh items: one that fails at once would take them
all.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Hashable

from .chunk_task import Failure, Kind

# A worker is left out after failing this many items that others did, with none done between.
STRIKES = 3
# With nothing done at all, this many items more than workers may fail until the run stops.
HOPELESS = 8


class Failures:
    """Counts the failures of items and workers. `failed`: items that failed for good, `left_out`: workers; and why."""

    def __init__(self, tries: int) -> None:
        """`tries`: how often an item fails until it is given up."""
        self._tries = tries
        self._counts: Counter[Hashable] = Counter()
        self._deaths: Counter[Hashable] = Counter()
        self._failed_on: dict[Hashable, set[str]] = defaultdict(set)
        self._open: dict[str, set[Hashable]] = defaultdict(set)  # items that failed on a worker and are not settled
        self._strikes: Counter[str] = Counter()
        self._last: dict[str, str] = {}
        self.failed: dict[Hashable, str] = {}
        self.left_out: dict[str, str] = {}

    def failed_on(self, item: Hashable) -> frozenset[str]:
        """Return the workers on which an item has failed."""
        return frozenset(self._failed_on.get(item, ()))

    def is_trusted(self, worker: str) -> bool:
        """Tell whether a worker may have fresh items: not while it is unknown whose fault its last failures are."""
        return len(self._open[worker]) < STRIKES

    def done(self, item: Hashable, worker: str) -> None:
        """Note that a worker has done an item."""
        self._strikes.pop(worker, None)
        for other in self._settle(item):
            if other == worker:
                continue
            self._strikes[other] += 1
            if self._strikes[other] >= STRIKES:
                self.left_out[other] = f"it failed {STRIKES} items that others did; the last: {self._last[other]}"

    def add(self, item: Hashable, worker: str, failure: Failure, fit: set[str]) -> bool:
        """Note a failure; return whether the item is to be tried again. `fit`: the workers that take part.

        A user's error is tried once more, by another worker if there is one: a worker's own disk or driver also ends
        in such an error.
        """
        if failure.kind is Kind.WORKER:
            self.left_out[worker] = failure.reason
            return True
        self._counts[item] += 1
        tried = self._failed_on[item]
        tried.add(worker)
        final = self._counts[item] >= self._tries
        if failure.kind is Kind.ITEM:
            final = final or len(tried) > 1 or fit <= tried
        if final:
            self._give_up(item, failure.reason)
        else:
            self._open[worker].add(item)
            self._last[worker] = failure.reason
        return not final

    def add_death(self, item: Hashable, alone: bool, reason: str) -> bool:
        """Note that a worker ended with an item; return whether it is to be tried again. `alone`: in its chunk."""
        self._deaths[item] += alone
        if self._deaths[item] < self._tries:
            return True
        self._give_up(item, f"{reason}, {self._tries} times")
        return False

    def is_hopeless(self, workers: int) -> bool:
        """Tell, with nothing done so far, whether so many items have failed that the run must stop."""
        return len(self.failed) >= HOPELESS + workers

    def _give_up(self, item: Hashable, reason: str) -> None:
        self.failed[item] = reason
        self._settle(item)

    def _settle(self, item: Hashable) -> set[str]:
        """Forget and return the workers on which an item failed."""
        workers = self._failed_on.pop(item, set())
        for worker in workers:
            self._open[worker].discard(item)
        return workers
