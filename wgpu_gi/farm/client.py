"""Connects to a Dask cluster, or starts one on this machine, and checks that its workers can take part.

On this machine there is one worker process for each GPU, and one for every THREADS cores if there is none. A process is
spawned, never forked: drivers do not survive a fork.
"""

from __future__ import annotations

import logging
import multiprocessing
import os
import re
import signal
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from multiprocessing import resource_tracker
from typing import TYPE_CHECKING, Any

from ..errors import GiError
from ..extras import install_hint
from ..gpu.device import AdapterInfo, list_adapters, open_device
from .defaults import THREADS

if TYPE_CHECKING:
    from distributed import Client

CONNECT = 10.0  # seconds to wait for a scheduler, and then for its first worker
SCHEMES, ENCRYPTED = ("tcp", "tls", "ws", "wss"), ("tls", "wss")
LOCAL = "127.0.0.1"  # where a cluster on this machine listens: other machines have no access
UNGUARDED = "a farm starts processes that import the main module: put the call below if __name__ == '__main__':"
PACKAGES = ("python", "distributed")  # whose versions must be equal; of Python the first two numbers


def require_dask() -> Any:
    """Return the module `distributed`. Raises GiError if it is not installed."""
    try:
        import distributed
    except ImportError:
        raise GiError(f"a farm needs a package: {install_hint('farm')}") from None
    return distributed


@contextmanager
def connected(
    scheduler: str | None = None,
    *,
    workers: int | None = None,
    threads: int | None = None,
    adapter: str | None = None,
) -> Iterator[Client]:
    """Yield a client of the scheduler at an address, or of a cluster on this machine, which ends with the block.

    `workers` and `threads`: processes on this machine, and cores for each where a CPU renders. Raises GiError if there
    is no such scheduler, adapter or package, or no worker.
    """
    distributed = require_dask()
    if scheduler is None:
        with _local_cluster(distributed, workers, threads, adapter) as cluster, distributed.Client(cluster) as client:
            yield client
        return
    if workers is not None or threads is not None:
        raise GiError("--workers and --threads start workers on this machine; leave them out with --scheduler")
    with _client_of(distributed, scheduler) as client:
        _wait_for_worker(client, scheduler)
        yield client


def check_versions(client: Client) -> None:
    """Raise GiError if the versions of a worker or of the scheduler are not those of the client."""
    try:
        found: Any = client.get_versions()
    except Exception as error:
        raise GiError(
            f"the versions of the workers are unknown ({error}); is their Dask that of this machine?"
        ) from None
    here = _versions(found["client"])
    places = {"the scheduler": found["scheduler"]} | {f"the worker at {a}": v for a, v in found["workers"].items()}
    for place, versions in places.items():
        there = _versions(versions)
        for name in PACKAGES:
            if there[name] != here[name]:
                raise GiError(
                    f"{place} has {name} {there[name]}, and this machine {here[name]}; install the same version on all"
                )


def _versions(found: Any) -> dict[str, str]:
    """Return the versions of PACKAGES from what `Client.get_versions` tells."""
    packages = (found or {}).get("packages", {})
    versions = {name: str(packages.get(name)) for name in PACKAGES}
    versions["python"] = ".".join(versions["python"].split(".")[:2])
    return versions


@contextmanager
def _client_of(distributed: Any, address: str) -> Iterator[Client]:
    """Yield a client of a scheduler. Raises GiError if it cannot be reached."""
    # A client of a wrong address raises an exception, and another when it is deleted; so look first.
    found = re.fullmatch(r"(?:(\w+)://)?(.+):(\d{1,5})", address)
    if found is None or int(found[3]) > 65535 or found[1] not in (None, *SCHEMES):
        raise GiError(f"--scheduler {address}: an address is tcp://HOST:PORT, such as tcp://render1:8786")
    if found[1] in ENCRYPTED and distributed.Security().get_connection_args("client").get("ssl_context") is None:
        raise GiError(f"--scheduler {address}: Dask's configuration has no certificates for {found[1]}")
    for name in ("distributed", "distributed.client"):  # what they log is in the sentences of GiErrors and results
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a warning of versions: `check_versions` says more
            client = distributed.Client(address, timeout=CONNECT, set_as_default=False)
    except Exception as error:  # of the socket, of the protocol, of other versions
        raise GiError(
            f"no Dask scheduler answers at {address} within {CONNECT:g} s ({type(error).__name__}); start one with"
            " 'dask scheduler', or leave out --scheduler to render on this machine"
        ) from None
    try:
        yield client
    finally:
        with suppress(Exception):  # the scheduler may have gone
            client.close(timeout=CONNECT)


def _wait_for_worker(client: Client, address: str) -> None:
    """Wait until a scheduler has a worker. Raises GiError if none comes."""
    try:
        client.wait_for_workers(1, timeout=CONNECT)
    except require_dask().TimeoutError:  # of asyncio, which is another class in Python 3.10
        raise GiError(
            f"the scheduler at {address} has no workers; start some with 'dask worker {address} --nthreads 1'"
        ) from None


@contextmanager
def _local_cluster(distributed: Any, workers: int | None, threads: int | None, adapter: str | None) -> Iterator[Any]:
    """Yield a cluster on this machine."""
    process = multiprocessing.current_process()
    if getattr(process, "_inheriting", False):
        if process.name.startswith("Dask"):
            sys.exit(1)  # a worker of this very call, which then raises the error in the user's process
        raise GiError(UNGUARDED)
    import dask

    environments = worker_environments(list_adapters(), _cores(), workers, threads, adapter)
    open_device(adapter)  # raises GiError without a usable adapter of that name
    spec = {
        number: {
            "cls": distributed.Nanny,
            "options": {
                "nthreads": 1,
                "memory_limit": 0,
                "host": LOCAL,
                "env": environment,
                "silence_logs": logging.CRITICAL,
            },
        }
        for number, environment in enumerate(environments)
    }
    scheduler = {"cls": distributed.Scheduler, "options": {"host": LOCAL, "dashboard_address": f"{LOCAL}:0"}}
    try:
        with _without_interrupts():
            cluster = distributed.SpecCluster(workers=spec, scheduler=scheduler, silence_logs=logging.CRITICAL)
    except RuntimeError as error:
        raise GiError(f"the worker processes do not start ({error}); {UNGUARDED}") from None
    # 15 s after a worker ends, Dask gives it up if it is away at that moment; but its nanny always starts it again.
    with dask.config.set({"distributed.deploy.lost-worker-timeout": "1000 days"}), cluster:
        yield cluster


@contextmanager
def _without_interrupts() -> Iterator[None]:
    """Let Ctrl-C wait: the threads and processes that start in the block, and theirs, never receive it."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # `multiprocessing` lets the signal through again after it has started this
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def worker_environments(
    adapters: list[AdapterInfo], cores: int, workers: int | None, threads: int | None, adapter: str | None
) -> list[dict[str, str]]:
    """Return the environment variables of each worker process on this machine.

    Raises GiError for `threads` of a GPU.
    """
    usable = [a for a in adapters if a.usable and (adapter is None or adapter.lower() in a.name.lower())]
    if usable and usable[0].type != "CPU":
        if threads is not None:
            raise GiError(f"--threads is for rendering on a CPU; {usable[0].name} is a GPU, so leave it out")
        alike = [
            number for number, a in enumerate(usable) if (a.type, a.backend) == (usable[0].type, usable[0].backend)
        ]
        numbers = [alike[number % len(alike)] for number in range(workers or len(alike))]
        return [{"WGPU_GI_ADAPTER": f"{number}"} for number in numbers]
    each = threads or (THREADS if workers is None else max(cores // workers, 1))
    return [{"LP_NUM_THREADS": f"{each}"}] * (workers or max(cores // each, 1))


def _cores() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
