"""Runs of a task on a cluster that is not one: every item is settled once, whatever fails. And the sizes of chunks."""

import itertools
from collections import Counter

import pytest
from farm.fake_cluster import Died, FakeCluster, Hangs
from hypothesis import given
from hypothesis import strategies as st

from wgpu_gi.errors import DiskFull, GiError, LostDevice
from wgpu_gi.farm import schedule
from wgpu_gi.farm.chunk_task import UnfitWorker
from wgpu_gi.farm.chunks import GROWTH, LONGEST, Speeds, Waiting
from wgpu_gi.farm.failures import HOPELESS, Failures


class Result:
    """A run of `task(worker, item)` on items 0 to count - 1 that has ended."""

    def __init__(self, task, workers=3, count=100, tries=3, admit=None, gone_after=None):
        self.done, self.failed = Counter(), {}
        self.cluster = FakeCluster(workers, task, gone_after)
        callbacks = schedule.Callbacks(self._done, self.failed.__setitem__, None, admit)
        waiting = Waiting(range(count), lambda item: 1.0)
        self.summary = schedule._Running(self.cluster, waiting, Failures(tries), callbacks).to_end()
        assert self.summary.failed == self.failed
        assert self.summary.done == len(self.done)
        assert set(self.done.values()) <= {1}
        if self.summary.stopped is None:
            assert self.done.keys() | self.failed.keys() | self.summary.elsewhere == set(range(count))

    def _done(self, item, result, worker, seconds):
        assert result == item**2
        self.done[item] += 1


def square(worker, item):
    return item**2


def test_every_item_is_done_once():
    result = Result(square)
    assert len(result.done) == 100
    assert result.summary.repeated == 0
    assert result.summary.chunks < 60


def test_worker_has_one_chunk_at_a_time():
    submitted = Counter()

    def task(worker, item):
        submitted[worker] += 1
        return item**2

    result = Result(task, workers=4)
    assert set(submitted) == set("0123")
    for number, (_, worker) in enumerate(result.cluster.submitted[:4]):
        assert worker == str(number)


def test_items_of_dead_workers_are_done_by_others():
    """Each fifth call ends its worker: whatever the item."""
    calls = itertools.count(1)

    def task(worker, item):
        if next(calls) % 5 == 0:
            raise Died
        return item**2

    result = Result(task, count=60, tries=100)
    assert len(result.done) == 60
    assert result.summary.deaths > 5


def test_item_that_ends_workers_is_found_and_the_rest_is_done():
    def task(worker, item):
        if item == 57:
            raise Died
        return item**2

    result = Result(task, count=300)
    assert set(result.failed) == {57}
    assert "ended" in result.failed[57]
    # Halves until it is alone, then three tries.
    assert result.summary.deaths <= 9


def test_failing_item_is_tried_on_several_workers():
    tried = set()

    def task(worker, item):
        if item == 20:
            tried.add(worker)
            raise RuntimeError("broken")
        return item**2

    result = Result(task)
    assert set(result.failed) == {20}
    assert "RuntimeError: broken" in result.failed[20]
    assert len(tried) == 3
    assert not result.summary.left_out


def test_error_of_the_user_is_tried_once_on_each_of_two_workers():
    tried = []

    def task(worker, item):
        if item == 20:
            tried.append(worker)
            raise GiError("frame 20 has no camera")
        return item**2

    assert Result(task).failed == {20: "frame 20 has no camera"}
    assert len(tried) == len(set(tried)) == 2
    tried.clear()
    assert Result(task, workers=1).failed == {20: "frame 20 has no camera"}
    assert len(tried) == 1


@pytest.mark.parametrize(
    "error", [GiError("no driver"), RuntimeError("no memory"), LostDevice("lost"), UnfitWorker("other scene")]
)
def test_worker_that_fails_everything_is_left_out(error):
    tried = []

    def task(worker, item):
        if worker == "1":
            tried.append(item)
            raise error
        return item**2

    result = Result(task, count=1000)
    assert not result.failed
    assert len(tried) < 10
    assert set(result.summary.left_out) == {"1"}
    assert str(error) in result.summary.left_out["1"]


def test_broken_items_leave_no_worker_out():
    def task(worker, item):
        if 30 <= item < 60:
            raise GiError("no texture")
        return item**2

    result = Result(task, workers=4)
    assert set(result.failed) == set(range(30, 60))
    assert not result.summary.left_out


def test_run_stops_if_everything_fails():
    def task(worker, item):
        raise GiError("no sun")

    result = Result(task, count=1000)
    assert "no sun" in result.summary.stopped
    assert len(result.cluster.submitted) < 3 * (HOPELESS + 3) + 3


def test_run_stops_if_no_worker_is_fit():
    def task(worker, item):
        raise UnfitWorker(f"worker {worker} has another scene")

    result = Result(task)
    assert result.summary.stopped.startswith("no worker can go on; ")
    assert len(result.summary.left_out) == 3


def test_full_disk_stops_the_run():
    def task(worker, item):
        if item >= 40:
            raise DiskFull("out/f.exr: cannot be written (No space left on device)")
        return item**2

    result = Result(task)
    assert result.summary.stopped == "out/f.exr: cannot be written (No space left on device)"
    assert not result.failed


def test_gone_scheduler_stops_the_run(monkeypatch):
    monkeypatch.setattr(schedule, "TICK", 0.0)
    result = Result(square, gone_after=10)
    assert result.summary.stopped == "the scheduler is gone"
    assert 0 < len(result.done) < 100


def test_slow_chunk_is_done_by_another_worker(monkeypatch):
    """A worker hangs in its second chunk: the others do all else, then its items."""
    monkeypatch.setattr(schedule, "TICK", 0.0)
    monkeypatch.setattr(schedule, "SLOW", 0.0)
    monkeypatch.setattr(schedule, "GRACE", 0.01)
    calls = Counter()

    def task(worker, item):
        calls[worker] += 1
        if worker == "1" and calls["1"] == 2:
            raise Hangs
        return item**2

    result = Result(task)
    assert len(result.done) == 100
    assert 0 < result.summary.repeated < 20


def test_items_of_others_are_left_to_them():
    asked = []

    def admit(items):
        asked.extend(items)
        return [item for item in items if item % 3]

    result = Result(square, admit=admit)
    assert result.summary.elsewhere == set(range(0, 100, 3))
    assert sorted(asked) == list(range(100))


def test_interrupt_is_passed_on():
    def task(worker, item):
        return item**2

    with pytest.raises(KeyboardInterrupt):
        Result(task, admit=interrupted)


def interrupted(items):
    raise KeyboardInterrupt


@given(
    workers=st.integers(1, 5),
    count=st.integers(1, 80),
    deaths=st.sets(st.integers(1, 200), max_size=8),
    errors=st.sets(st.integers(1, 200), max_size=20),
    poisonous=st.sets(st.integers(0, 80), max_size=2),
    broken=st.sets(st.integers(0, 80), max_size=5),
)
def test_every_item_is_settled_once(workers, count, deaths, errors, poisonous, broken):
    """Workers end or fail at any call; some items end every worker, some always fail."""
    calls = itertools.count(1)

    def task(worker, item):
        call = next(calls)
        if call in deaths or item in poisonous:
            raise Died
        if call in errors or item in broken:
            raise RuntimeError("fault")
        return item**2

    result = Result(task, workers, count, tries=50)
    if result.summary.stopped is None and not result.summary.left_out:
        assert result.failed.keys() == (poisonous | broken) & set(range(count))


def sizes_of_chunks(count, workers, seconds):
    """Return the number of items of each chunk if every item takes the same time."""
    waiting, speeds, sizes = Waiting(range(count), lambda item: 1.0), Speeds(), []
    for worker in itertools.cycle(map(str, range(workers))):
        items = waiting.take(worker, workers, speeds)
        if not items:
            return sizes
        speeds.add(worker, len(items), len(items) * seconds, len(items))
        sizes.append(len(items))


@pytest.mark.parametrize("workers", [1, 7])
@pytest.mark.parametrize("seconds", [0.01, 1.0, 60.0])
def test_chunks_grow_to_their_longest_and_shrink_toward_the_end(workers, seconds):
    sizes = sizes_of_chunks(20000, workers, seconds)
    assert sum(sizes) == 20000
    assert sizes[:workers] == [1] * workers
    assert max(sizes) * seconds <= max(LONGEST, seconds)
    assert all(size <= GROWTH * before for before, size in zip(sizes, sizes[workers:], strict=False))
    assert sizes[-1] * seconds <= max(0.01 * workers, seconds) * 1.01


def test_costs_size_chunks():
    """Items of ten times the cost come in chunks of a tenth as many."""
    waiting, speeds = Waiting(range(2000), lambda item: 1.0 if item < 1000 else 10.0), Speeds()
    for _ in range(3):
        speeds.add("a", 5.0, 5.0, 5)
    assert len(waiting.take("a", 1, speeds)) == LONGEST
    while waiting.take("b", 1, speeds) != (999,):
        pass
    assert len(waiting.take("a", 1, speeds)) == LONGEST // 10


def test_first_chunk_is_due_after_the_longest_loading():
    speeds = Speeds()
    assert speeds.expected("a", 1.0) is None
    speeds.add("a", 1.0, 30.0, 1)
    speeds.add("a", 1.0, 1.0, 1)
    assert speeds.expected("a", 4.0) == 4.0
    assert speeds.expected("b", 4.0) == 30.0
