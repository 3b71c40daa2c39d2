"""Run the farm's scheduling with 1,000 workers that sleep instead of rendering, while some of them die.

python tools/simulate_farm.py [--workers N] [--items N] [--seconds S] [--deaths PERCENT] [--processes N]

The scheduler has a process of its own, the workers share some: each is a `distributed.Worker` with its own connections
and its own thread. An item sleeps for S seconds, times 0.5 to 1.5. Each minute PERCENT of the workers break their
connections without a word, and after 5 s new ones start. The tool prints how many items were lost or done twice, and
the processor time of the scheduler and of the client for each chunk. The scheduler's time for heartbeats alone is
measured before. The exit code is 1 if an item was lost or done twice.
"""

from __future__ import annotations

import argparse
import asyncio
import logging
import multiprocessing
import os
import random
import resource
import sys
import tempfile
import time
from collections import Counter
from multiprocessing.connection import Connection
from typing import Any

from wgpu_gi.farm.schedule import Summary, run_chunks

IDLE = 20.0  # seconds over which the scheduler's time without chunks is measured
AWAY = 5.0  # seconds until a new worker replaces a dead one
EACH = 20.0  # seconds between lines of progress
STARTING = 20  # workers that start at the same time
DESCRIPTION = bytes(4096)  # as long as the description of a job


def stand_in(payload: dict[str, Any], items: list[int]) -> list[int]:
    """Sleep for as long as an item takes."""
    for item in items:
        time.sleep(payload["seconds"] * random.Random(item).uniform(0.5, 1.5))
    return items


# -------------------------------------------------------------------------------------- Processes


def serve_scheduler(pipe: Connection) -> None:
    """Run a scheduler until the pipe is closed; sends its address."""

    async def serve() -> None:
        from distributed import Scheduler

        async with Scheduler(host="127.0.0.1", port=0, dashboard_address="127.0.0.1:0") as scheduler:
            pipe.send(scheduler.address)
            await asyncio.to_thread(_wait_for_end, pipe)

    logging.disable(logging.ERROR)  # Dask logs each connection and each death
    asyncio.run(serve())


def serve_workers(pipe: Connection, address: str, count: int, deaths: float, seed: int) -> None:
    """Run workers; once told to, kill some, `deaths` a second. Ends when the pipe is closed."""

    async def serve() -> None:
        workers: list[Any] = []
        for start in range(0, count, STARTING):
            workers += await asyncio.gather(*(_worker(address) for _ in range(start, min(start + STARTING, count))))
        pipe.send(len(workers))
        await asyncio.to_thread(pipe.recv)
        killer = asyncio.create_task(_kill(workers, address, deaths, random.Random(seed)))
        await asyncio.to_thread(_wait_for_end, pipe)
        killer.cancel()

    logging.disable(logging.CRITICAL)
    asyncio.run(serve())


async def _worker(address: str) -> Any:
    from distributed import Worker

    return await Worker(address, host="127.0.0.1", nthreads=1, memory_limit=0, dashboard=False)


async def _kill(workers: list[Any], address: str, deaths: float, rng: random.Random) -> None:
    """Break the connections of a worker again and again, and start another in its place."""
    replacing = set()
    while deaths > 0:
        await asyncio.sleep(rng.expovariate(deaths))
        dying = workers.pop(rng.randrange(len(workers)))
        dying.heartbeat_active = True  # no heartbeat any more
        dying.batched_stream.abort()
        replacing.add(asyncio.create_task(_replace(workers, address)))


async def _replace(workers: list[Any], address: str) -> None:
    await asyncio.sleep(AWAY)
    workers.append(await _worker(address))


def _wait_for_end(pipe: Connection) -> None:
    try:
        pipe.recv()
    except EOFError:
        return


# -------------------------------------------------------------------------------------- The run


class Simulation:
    """A scheduler and workers in processes of their own."""

    def __init__(self, workers: int, processes: int, deaths: float) -> None:
        """`deaths`: percent of the workers a minute."""
        context = multiprocessing.get_context("spawn")
        self._pipes: list[Connection] = []
        self._processes: list[Any] = []

        def start(target: Any, *arguments: Any) -> Connection:
            pipe, other = context.Pipe()
            process = context.Process(target=target, args=(other, *arguments), daemon=True)
            process.start()
            other.close()
            self._pipes.append(pipe)
            self._processes.append(process)
            return pipe

        self.address: str = start(serve_scheduler).recv()
        shares = [len(range(number, workers, processes)) for number in range(processes)]
        self._workers = [
            start(serve_workers, self.address, share, share * deaths / 100 / 60, seed)
            for seed, share in enumerate(shares)
        ]
        for pipe in self._workers:
            pipe.recv()

    def begin_deaths(self) -> None:
        """Let workers die from now on."""
        for pipe in self._workers:
            pipe.send("begin")

    def close(self) -> None:
        """End all processes."""
        for pipe in self._pipes:
            pipe.close()
        for process in self._processes:
            process.join(3)
            process.kill()


def run(arguments: argparse.Namespace) -> int:
    """Simulate and print; return the exit code."""
    from distributed import Client

    started = time.monotonic()
    simulation = Simulation(arguments.workers, arguments.processes, arguments.deaths)
    client = Client(simulation.address)
    try:
        print(f"{arguments.workers} workers started in {time.monotonic() - started:.0f} s", flush=True)
        idle = client.run_on_scheduler(time.process_time)
        time.sleep(IDLE)
        idle = (client.run_on_scheduler(time.process_time) - idle) / IDLE
        print(f"scheduler without chunks: {1000 * idle:.0f} ms of processor time a second", flush=True)

        done: Counter[int] = Counter()
        busy = told = 0.0

        def on_done(item: int, _result: int, _worker: str, seconds: float) -> None:
            nonlocal busy
            done[item] += 1
            busy += seconds

        def on_tick() -> None:
            nonlocal told
            if time.monotonic() - told > EACH:
                told = time.monotonic()
                print(f"{told - start:.0f} s: {len(done)} items done", flush=True)

        simulation.begin_deaths()
        start = told = time.monotonic()
        mine, its = time.process_time(), client.run_on_scheduler(time.process_time)
        summary = run_chunks(
            client,
            stand_in,
            range(arguments.items),
            payload={"seconds": arguments.seconds, "job": DESCRIPTION},
            on_done=on_done,
            on_tick=on_tick,
            on_failed=lambda item, reason: print(f"item {item} failed: {reason}"),
        )
        wall, mine = time.monotonic() - start, time.process_time() - mine
        its = client.run_on_scheduler(time.process_time) - its
        return _report(summary, done, arguments, wall, mine, its, idle, busy)
    finally:
        client.close()
        simulation.close()


def _report(
    summary: Summary,
    done: Counter[int],
    arguments: argparse.Namespace,
    wall: float,
    mine: float,
    its: float,
    idle: float,
    busy: float,
) -> int:
    """Print what was measured: seconds of the wall, of the client's and the scheduler's processors, of sleep."""
    lost, twice = arguments.items - len(done), sum(count - 1 for count in done.values())
    chunks = summary.chunks
    print(
        f"{arguments.items} items in {wall:.0f} s: {lost} lost, {twice} done twice, {len(summary.failed)} failed\n"
        f"{chunks} chunks ({chunks / wall:.1f} a second), {summary.deaths} lost with their workers,"
        f" {summary.repeated} items given out again\n"
        f"scheduler: {1000 * its / chunks:.2f} ms of processor time a chunk,"
        f" {1000 * (its - idle * wall) / chunks:.2f} without the heartbeats\n"
        f"client: {1000 * mine / chunks:.2f} ms a chunk\n"
        f"workers busy with items that counted: {100 * busy / (wall * arguments.workers):.1f} %"
    )
    if summary.stopped:
        print(f"stopped: {summary.stopped}")
    return int(bool(lost or twice))


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--workers", type=int, default=1000)
    parser.add_argument("--items", type=int, default=60000)
    parser.add_argument("--seconds", type=float, default=2.5, help="of an item")
    parser.add_argument("--deaths", type=float, default=5.0, help="percent of the workers a minute")
    parser.add_argument("--processes", type=int, default=4, help="that the workers share")
    arguments = parser.parse_args()
    import dask

    logging.disable(logging.INFO)  # Dask logs each connection
    hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
    with tempfile.TemporaryDirectory() as folder:
        # For this process and those to come. A profile of sleep is of no use; each worker would look at the folders of
        # all others; and connections of processes that wait for a core must not count as broken.
        changes: dict[str, Any] = {
            "distributed.worker.profile.enabled": False,
            "distributed.worker.use-file-locking": False,
            "distributed.comm.timeouts.tcp": "300s",
            "distributed.comm.timeouts.connect": "300s",
            "temporary-directory": folder,
        }
        dask.config.set(changes)
        names = {f"DASK_{name.upper().replace('.', '__').replace('-', '_')}": f"{changes[name]}" for name in changes}
        os.environ |= names
        return run(arguments)


if __name__ == "__main__":
    sys.exit(main())
