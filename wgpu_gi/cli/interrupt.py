"""Ctrl-C during a command: raises KeyboardInterrupt, but not where it would be lost.

Python drops exceptions within callbacks from C and within `__del__`; modules written in C turn them into ImportError.
There Ctrl-C is only recorded, and `check` raises it: after the imports, and at each report of progress.
"""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

_came = False  # Ctrl-C was pressed during this command
_held = False  # it must wait


@contextmanager
def interruptible() -> Iterator[None]:
    """Handle Ctrl-C during the block, in the main thread of a process that does not ignore it."""
    global _came, _held
    _came = _held = False
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
        _came = False


@contextmanager
def held() -> Iterator[None]:
    """Let Ctrl-C wait until the end of the block."""
    global _held
    _held = True
    try:
        yield
    finally:
        _held = False
    check()


def came() -> bool:
    """Return whether Ctrl-C was pressed during this command."""
    return _came


def check() -> None:
    """Raise KeyboardInterrupt if Ctrl-C was pressed during this command."""
    if _came:
        raise KeyboardInterrupt


def _interrupt(_number: int, frame: FrameType | None) -> None:
    """Record Ctrl-C; raise it, except in a callback from wgpu's C code."""
    global _came
    _came = True
    caller: Any = frame
    while caller is not None:
        if caller.f_code.co_name.endswith("callback") and "wgpu_native" in caller.f_code.co_filename:
            return
        caller = caller.f_back
    if not _held:
        raise KeyboardInterrupt
