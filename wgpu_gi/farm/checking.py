"""Checks the workers of a job, before anything is rendered: each loads the scene and opens its adapter."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from ..errors import GiError
from ..version import __version__
from .worker import SentJob, check

if TYPE_CHECKING:
    from distributed import Client, Future

POLL = 0.5  # seconds between looks at the workers
TRIES = 3  # workers that may end while they render the first frame


def check_workers(client: Client, work: SentJob | Future, tick: Callable[[], None]) -> list[str]:
    """Have every worker load the job; return the addresses of those that did. Raises GiError for one that cannot."""
    addresses = list(client.nthreads())
    pending = {address: _submit(client, address, check, work) for address in addresses}
    fit: list[str] = []
    try:
        while pending:
            tick()
            for address in _ended(client, pending):
                future = pending.pop(address)
                if future.done():
                    _raise_error(future, address)
                    fit.append(address)
    finally:
        client.cancel(list(pending.values()))
    if not fit:
        raise GiError("all workers ended while they loaded the scene; their logs say why, such as too little memory")
    return fit


def ask(client: Client, workers: list[str], task: Callable[..., Any], work: SentJob | Future, *arguments: Any) -> Any:
    """Return `task(work, *arguments)` by the first of the workers that can; the last argument is called meanwhile.

    Raises GiError for the user's errors, and if several workers end.
    """
    *arguments_, tick = arguments
    for address in workers[:TRIES]:
        future = _submit(client, address, task, work, *arguments_)
        while not _ended(client, {address: future}):
            tick()
        if future.done():
            _raise_error(future, address)
            return future.result()
    raise GiError(f"{min(TRIES, len(workers))} workers ended while they rendered the first frame; their logs say why")


def _submit(client: Client, address: str, task: Callable[..., Any], *arguments: Any) -> Future:
    return client.submit(task, *arguments, workers=[address], allow_other_workers=False, pure=False)


def _ended(client: Client, pending: dict[str, Future]) -> list[str]:
    """Wait a moment; return the workers whose task has ended, or that have ended themselves."""
    from distributed import TimeoutError as DaskTimeoutError  # of asyncio, which is another class in Python 3.10
    from distributed import wait

    with client.as_current(), suppress(DaskTimeoutError):
        wait(list(pending.values()), timeout=POLL, return_when="FIRST_COMPLETED")
    if client.status != "running":
        raise GiError("the scheduler is gone; start it again, and then the same command")
    alive = client.nthreads()
    return [address for address, future in pending.items() if future.done() or address not in alive]


def _raise_error(future: Future, address: str) -> None:
    """Raise the error of a task as a GiError, if it has one."""
    error = future.exception()
    if error is None:
        return
    if isinstance(error, GiError):
        raise error
    raise GiError(
        f"the worker at {address} cannot run wgpu_gi {__version__} ({type(error).__name__}: {error}); install the"
        " version of this machine there"
    ) from None
