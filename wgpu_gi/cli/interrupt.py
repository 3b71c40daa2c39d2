"""Ctrl-C during a command: raises KeyboardInterrupt, but not where it would be lost.

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

INTERRUPTED = 130  # exit code: 128 + SIGINT, the convention of shells

_came = 0  # how often Ctrl-C was pressed during this command
_waits: Callable[[], bool] | None = None  # tells whether it must wait
_ignored = False  # whether it does nothing


@contextmanager
def interruptible() -> Iterator[None]:
    """Handle Ctrl-C during the block, in the main thread of a process that does not ignore it."""
    global _came, _waits, _ignored
    _came, _waits, _ignored = 0, None, False
    main = threading.current_thread() is threading.main_thread()
    if not main or signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        yield
        return
    handler, hook = signal.signal(signal.SIGINT, _interrupt), sys.unraisablehook
    sys.unraisablehook = lambda dropped: None if dropped.exc_type is KeyboardInterrupt else hook(dropped)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
        sys.unraisablehook = hook
        _came = 0


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


def _interrupt(_number: int, frame: FrameType | None) -> None:
    """Record Ctrl-C, unless it is ignored; raise it, except in a callback from wgpu's C code."""
    global _came
    if _ignored:
        return
    _came += 1
    caller: Any = frame
    while caller is not None:
        if caller.f_code.co_name.endswith("callback") and "wgpu_native" in caller.f_code.co_filename:
            return
        caller = caller.f_back
    if _waits is None or not _waits():
        raise KeyboardInterrupt
