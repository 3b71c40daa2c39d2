"""Chunks on the workers of a Dask cluster: submits them, and queues what becomes of them for the caller's thread.

Each chunk is submitted for one worker. Dask moves the tasks of a dead worker by itself, up to `allowed-failures` times,
which the scheduler's configuration sets, but a task for one worker waits for that worker to return. So the list of
workers is queued as well, about once a second.
"""

from __future__ import annotations

import asyncio
import itertools
import pickle
import queue
import time
import uuid
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Any

from .chunk_task import Failure, Outcome, Task, do_chunk, failure_of
from .chunks import Item

if TYPE_CHECKING:
    from distributed import Client, Future

WATCH = 1.0  # seconds between looks at the list of workers
SILENT = 60.0  # seconds without an answer of the scheduler until it counts as gone
EMPTY = 120.0  # seconds without any worker until the cluster counts as gone: a nanny takes a few to start one

Number = int
# What becomes of a chunk: its outcomes, or the failure of all its items, or None if its worker ended.
News = tuple[Number, list[Outcome] | Failure | None]


class Cluster:
    """A cluster as `run_chunks` needs it: workers by address, each with a chunk or without."""

    def __init__(self, client: Client, task: Task, payload: Any) -> None:
        """`client` is synchronous; `task` and `payload` are those of all chunks."""
        assert client.scheduler is not None and client.loop is not None
        self._client, self._scheduler, self._loop = client, client.scheduler, client.loop
        self._task, self._payload = task, payload
        self._name = f"the scheduler at {client.scheduler.address}"
        self._numbers = itertools.count()
        self._futures: dict[Number, Future] = {}
        self._news: queue.SimpleQueue[News | set[str]] = queue.SimpleQueue()
        self._heard = self._peopled = time.monotonic()
        self._closed = False
        self._told: set[Number] = set()  # chunks whose outcomes came as an event
        self._topic = f"wgpu_gi-{uuid.uuid4()}"
        self._loop.add_callback(self._watch)

    @property
    def is_connected(self) -> bool:
        """Whether chunks can be submitted now. The client connects again by itself after a break of the network."""
        return bool(self._client.status == "running")

    def submit(self, items: tuple[Item, ...], worker: str) -> Number:
        """Send a chunk to a worker."""
        number = next(self._numbers)
        arguments = (self._task, self._payload, items, self._topic, number)
        future = self._client.submit(do_chunk, *arguments, workers=[worker], pure=False)
        self._futures[number] = future
        future.add_done_callback(partial(self._ended, number))
        return number

    def drop(self, number: Number) -> None:
        """Forget a chunk; if its task still runs, it is cancelled, and the worker stops before its next item."""
        self._futures.pop(number).release()

    def news(self, timeout: float) -> News | set[str] | None:
        """Return what became of a chunk that was not dropped, or all workers of now; None after `timeout` seconds."""
        try:
            news = self._news.get(timeout=timeout)
        except queue.Empty:
            return None
        return news if isinstance(news, set) or news[0] in self._futures else None

    def close(self) -> None:
        """Drop all chunks."""
        self._closed = True
        if self.is_connected:
            self._client.unsubscribe_topic(self._topic)
        for number in list(self._futures):
            with suppress(RuntimeError):  # the event loop has ended
                self.drop(number)

    def why_gone(self) -> str | None:
        """Return why nothing more can be expected of the cluster, None if it works."""
        now = time.monotonic()
        if self._client.status not in ("running", "connecting"):
            return f"{self._name} is gone"
        if now - self._heard > SILENT:
            return f"{self._name} has not answered for {SILENT:.0f} s"
        if now - self._peopled > EMPTY:
            return f"{self._name} has had no workers for {EMPTY:.0f} s"
        return None

    # ------------------------------------------------------------------------ In the event loop of the client

    async def _watch(self) -> None:
        """Queue the list of workers again and again; an error of the connection is told by the silence.

        An event that the client sends to itself shows that those of the workers arrive. A client that has connected
        again has to subscribe again; and the scheduler may have forgotten it for good, which no status tells.
        """
        while not self._closed:
            with suppress(OSError, RuntimeError, ValueError, AttributeError, asyncio.TimeoutError):
                self._client.subscribe_topic(self._topic, self._hear)
                await self._client.log_event(self._topic, b"")
                workers = set(await self._client.nthreads(asynchronous=True))
                if workers:
                    self._peopled = time.monotonic()
                self._news.put(workers)
            await asyncio.sleep(WATCH)

    def _hear(self, event: tuple[float, bytes]) -> None:
        """Queue the outcomes of a chunk that come as an event, always before its task counts as finished."""
        self._heard = time.monotonic()
        if event[1]:
            number, outcomes = pickle.loads(event[1])
            self._told.add(number)
            self._news.put((number, outcomes))

    async def _fetch(self, number: Number, key: Any) -> None:
        """Queue the outcomes of a finished chunk that did not come as an event.

        `Client.gather` joins the keys that are asked for at the same time, and asks for all of them again until each
        has come: one worker that ended holds up the results of all. So each chunk is asked for alone, once.
        """
        outcomes: list[Outcome] | None = None
        with suppress(OSError, RuntimeError, ValueError, AttributeError, asyncio.TimeoutError):
            response = await self._scheduler.gather(keys=[key])
            if response["status"] == "OK":
                outcomes = response["data"][key]
        self._news.put((number, outcomes))

    # ------------------------------------------------------------------------ In a thread of the client

    def _ended(self, number: Number, future: Future) -> None:
        """Queue what became of a chunk, or have its outcomes fetched."""
        from distributed import KilledWorker

        if number in self._told:
            self._told.discard(number)
        elif future.status == "finished":
            self._loop.add_callback(self._fetch, number, future.key)
        elif future.status != "error" or isinstance(future.exception(), KilledWorker):
            self._news.put((number, None))
        else:
            self._news.put((number, failure_of(future.exception())))
