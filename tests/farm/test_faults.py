"""Runs on real Dask processes that are killed, hang, or find the disk full: no item is lost, and the end says what was.

The tasks do little, in a process each; `test_killed_workers.py` renders frames.
"""

import os
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from contextlib import contextmanager
from pathlib import Path

import pytest

from wgpu_gi.errors import GiError
from wgpu_gi.farm import cluster, schedule
from wgpu_gi.farm.chunk_task import UnfitWorker
from wgpu_gi.farm.client import connected
from wgpu_gi.pictures.atomic_file import atomic_file

distributed = pytest.importorskip("distributed")
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def two_workers():
    with connected(workers=2) as client:
        yield client


def run(client, task, count, payload=None, done=None, **options):
    """Run a task on items 0 to count - 1; return how often each was done, those that failed, and the summary."""
    done, failed = Counter() if done is None else done, {}

    def on_done(item, result, worker, seconds):
        assert result == item**2
        done[item] += 1

    options.setdefault("on_done", on_done)
    summary = schedule.run_chunks(client, task, range(count), payload=payload, on_failed=failed.__setitem__, **options)
    assert set(done.values()) <= {1}
    return done, failed, summary


def square(payload, items):
    (item,) = items
    time.sleep(payload["seconds"])
    kind = payload.get(item)
    if kind == "die":
        os.kill(os.getpid(), signal.SIGKILL)
    if kind == "raise":
        raise RuntimeError("broken", threading.Lock())  # cannot be pickled
    if kind == "refuse":
        raise GiError("no such camera")
    if kind == "crash":
        os.abort()
    return [item**2]


def test_what_kills_or_fails_is_told_and_the_rest_is_done(two_workers):
    payload = {"seconds": 0.01, 13: "die", 20: "raise", 30: "refuse", 40: "crash"}
    done, failed, summary = run(two_workers, square, 60, payload)
    assert set(failed) == {13, 20, 30, 40}
    assert len(done) == 56 and summary.stopped is None and not summary.left_out
    assert "ended (killed, out of memory, or crashed), 3 times" in failed[13]
    assert failed[20].startswith("RuntimeError: ('broken'") and failed[30] == "no such camera"


def out_of_memory(payload, items):
    """Take more memory than the process may have, for one item."""
    import resource

    (item,) = items
    if item == 7:
        resource.setrlimit(resource.RLIMIT_AS, (2**30, resource.RLIM_INFINITY))
        try:
            bytearray(2**40)
        finally:
            resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    return [item**2]


def test_item_without_enough_memory_fails_alone(two_workers):
    done, failed, summary = run(two_workers, out_of_memory, 20)
    assert set(failed) == {7} and failed[7].startswith("MemoryError")
    assert len(done) == 19 and not summary.deaths


def write(payload, items):
    """Write a file, in a file system that the payload says is full after some."""
    (item,) = items
    time.sleep(0.02)
    folder = Path(payload["folder"])
    if len(list(folder.glob("*.txt"))) >= payload["room"]:
        os.write = full  # of this process
    with atomic_file(folder / f"{item}.txt") as temporary:
        file = os.open(temporary, os.O_CREAT | os.O_WRONLY)
        try:
            os.write(file, b"0123456789")
        finally:
            os.close(file)
    return [item**2]


def full(*_):
    raise OSError(28, "No space left on device")


def test_full_disk_stops_in_a_sentence_and_the_rest_is_done_later(tmp_path):
    with connected(workers=2) as client:
        done, failed, summary = run(client, write, 200, {"folder": str(tmp_path), "room": 30})
        assert "No space left on device" in summary.stopped and not failed
        written = sorted(path.name for path in tmp_path.iterdir())
        assert 30 <= len(written) <= 32 and len(done) <= len(written)
        assert all(path.read_bytes() == b"0123456789" for path in tmp_path.iterdir())


def unfit_in_one_process(payload, items):
    """Be unfit in the process that comes first."""
    time.sleep(0.01)
    try:
        owner = os.open(payload["file"], os.O_CREAT | os.O_EXCL | os.O_WRONLY)
        os.write(owner, str(os.getpid()).encode())
        os.close(owner)
    except FileExistsError:
        pass
    if Path(payload["file"]).read_text() in (str(os.getpid()), ""):
        raise UnfitWorker("the folder is not shared")
    return [items[0] ** 2]


def test_worker_that_is_unfit_is_left_out(two_workers, tmp_path):
    done, failed, summary = run(two_workers, unfit_in_one_process, 50, {"file": str(tmp_path / "owner")})
    assert len(done) == 50 and not failed
    assert list(summary.left_out.values()) == ["the folder is not shared"]


def hang_in_one_process(payload, items):
    """Hang, in the process that comes first to item 20 and only there."""
    (item,) = items
    time.sleep(0.02)
    if item == 20:
        try:
            os.close(os.open(payload["file"], os.O_CREAT | os.O_EXCL))
        except FileExistsError:
            return [item**2]
        time.sleep(600)
    return [item**2]


def test_worker_that_hangs_holds_nothing_up(tmp_path, monkeypatch):
    monkeypatch.setattr(schedule, "GRACE", 0.5)
    with connected(workers=2) as client:
        done, failed, summary = run(client, hang_in_one_process, 60, {"file": str(tmp_path / "hung")})
        assert len(done) == 60 and not failed and summary.repeated >= 1


def test_interrupt_cancels_what_is_in_flight(two_workers):
    """Workers stop before their next item; another run follows at once."""
    seen = []

    def on_done(item, result, worker, seconds):
        seen.append(item)
        if len(seen) == 20:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(two_workers, square, 1000, {"seconds": 0.02}, on_done=on_done)
    done, _, _ = run(two_workers, square, 10, {"seconds": 0.0})
    assert len(done) == 10


def test_two_clients_at_once_share_the_workers(two_workers):
    found = []
    address = two_workers.scheduler.address

    def other():
        with distributed.Client(address, set_as_default=False) as client:
            found.append(run(client, square, 60, {"seconds": 0.01}))

    thread = threading.Thread(target=other)
    thread.start()
    found.append(run(two_workers, square, 60, {"seconds": 0.01}))
    thread.join()
    assert [len(done) for done, _, _ in found] == [60, 60]


@contextmanager
def other_machine(workers=2):
    """Yield a scheduler process, its address, and its worker processes, as others start them."""
    started = []

    def start(module, *arguments):
        command = [sys.executable, "-m", f"distributed.cli.{module}", *arguments]
        started.append(subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True))
        return started[-1]

    try:
        scheduler = start("dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
        address = next(line.split()[-1] for line in scheduler.stderr if "Scheduler at:" in line)
        threading.Thread(target=scheduler.stderr.read, daemon=True).start()
        for _ in range(workers):
            worker = start("dask_worker", address, "--nthreads", "1", "--no-nanny", "--no-dashboard")
            threading.Thread(target=worker.stderr.read, daemon=True).start()
        yield scheduler, address
    finally:
        for process in started:
            process.kill()
            process.wait()


def test_gone_scheduler_is_told_in_a_sentence():
    with other_machine() as (scheduler, address):
        client = distributed.Client(address, set_as_default=False, timeout=3)
        try:
            client.wait_for_workers(2, timeout=60)
            done = Counter()

            def on_tick():
                if done:
                    scheduler.kill()

            _, failed, summary = run(client, square, 100000, {"seconds": 0.01}, done, on_tick=on_tick)
            assert summary.stopped == f"the scheduler at {address} is gone"
            assert summary.done == len(done) > 0 and not failed
        finally:
            client.close(timeout=1)


def test_scheduler_that_is_silent_is_told_in_a_sentence(monkeypatch):
    monkeypatch.setattr(cluster, "SILENT", 15.0)
    with other_machine() as (scheduler, address), distributed.Client(address, set_as_default=False) as client:
        client.wait_for_workers(2, timeout=60)
        done = Counter()

        def on_tick():
            if done:
                scheduler.send_signal(signal.SIGSTOP)

        try:
            _, failed, summary = run(client, square, 100000, {"seconds": 0.01}, done, on_tick=on_tick)
        finally:
            scheduler.send_signal(signal.SIGCONT)
        assert summary.stopped == f"the scheduler at {address} has not answered for 15 s"
        assert summary.done == len(done) > 0 and not failed


def test_workers_that_come_later_take_part_and_leaving_ones_lose_nothing():
    """A cluster that grows from one worker to three and shrinks to one again."""
    with connected(workers=1) as client:
        workers = set()
        client.cluster.new_spec = dict(client.cluster.worker_spec[0])

        def on_tick():
            client.cluster.scale(3 if len(workers) < 2 else 1)

        def on_done(item, result, worker, seconds):
            workers.add(worker)

        _, failed, summary = run(client, square, 1000, {"seconds": 0.02}, on_tick=on_tick, on_done=on_done)
        assert summary.done == 1000 and not failed and len(workers) >= 2


def test_chunks_are_few():
    """1,000 items of 10 ms by two workers: chunks of seconds, but for the first and the last."""
    with connected(workers=2) as client:
        done, _, summary = run(client, square, 1000, {"seconds": 0.01})
        assert len(done) == 1000
        assert summary.chunks < 80
