"""Ctrl-C during a command, or SIGTERM: raises KeyboardInterrupt, but not where it would be lost.

SIGTERM is how a farm manager ends a task; after half a minute or so it kills it. So it counts as Ctrl-C pressed twice,
which saves the picture so far without a certificate.

Python drops exceptions within callbacks from C and within `__del__`; modules written in C turn them into ImportError.
There Ctrl-C is only recorded, and `check` raises it: after the imports, and at each report of progress. It is also only
recorded while there is a picture to save (`held`): between two reports of progress, the GPU may hold half a frame.
While that picture is written, Ctrl-C is `ignored`.
"""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

_PRESSES = {signal.SIGINT: 1, signal.SIGTERM: 2}

_signal: int = signal.SIGINT  # the last one that came
_came = 0  # how often Ctrl-C was pressed during this command
_waits: Callable[[], bool] | None = None  # tells whether it must wait
_ignored = False  # whether it does nothing


@contextmanager
def interruptible() -> Iterator[None]:
    """Handle both signals during the block, in the main thread; no ignored SIGINT, no SIGTERM that has a handler."""
    global _came, _waits, _ignored, _signal
    _came, _waits, _ignored, _signal = 0, None, False, signal.SIGINT
    free = {signal.SIGINT: signal.getsignal(signal.SIGINT) is not signal.SIG_IGN}
    free[signal.SIGTERM] = signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    main = threading.current_thread() is threading.main_thread()
    handlers = {number: signal.signal(number, _interrupt) for number in _PRESSES if main and free[number]}
    hook = sys.unraisablehook
    if handlers:
        sys.unraisablehook = lambda dropped: None if dropped.exc_type is KeyboardInterrupt else hook(dropped)
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        sys.unraisablehook = hook
        _came = 0


def exit_code() -> int:
    """Return the exit code of an interrupted command: 128 + the signal, the convention of shells."""
    return 128 + _signal


@contextmanager
def held(waits: Callable[[], bool] = lambda: True) -> Iterator[None]:
    """Let Ctrl-C wait until the end of the block, or until `check`, whenever `waits` returns True."""
    global _waits
    _waits = waits
    try:
        yield
    finally:
        _waits = None
    check()


@contextmanager
def ignored(now: bool = True) -> Iterator[None]:
    """Let Ctrl-C do nothing during the block; with False as `now`, a block within such a block, let it act."""
    global _ignored
    before, _ignored = _ignored, now
    try:
        yield
    finally:
        _ignored = before


def handled() -> int:
    """Forget that Ctrl-C was pressed: the command answers to it, and goes on. Return how often it was pressed."""
    global _came
    count, _came = _came, 0
    return count


def came() -> bool:
    """Return whether Ctrl-C was pressed during this command."""
    return _came > 0


def check() -> None:
    """Raise KeyboardInterrupt if Ctrl-C was pressed during this command."""
    if _came:
        raise KeyboardInterrupt


def _interrupt(number: int, frame: FrameType | None) -> None:
    """Record Ctrl-C, unless it is ignored; raise it, except in a callback from wgpu's C code."""
    global _came, _signal
    if _ignored:
        return
    _came, _signal = _came + _PRESSES[signal.Signals(number)], number
    caller: Any = frame
    while caller is not None:
        if caller.f_code.co_name.endswith("callback") and "wgpu_native" in caller.f_code.co_filename:
            return
        caller = caller.f_back
    if _waits is None or not _waits():
        raise KeyboardInterrupt
