"""A clock for an adapter that is a CPU: what other processes take from it does not count."""

from __future__ import annotations

import os
import time
from collections.abc import Callable


def cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def clock_for(is_cpu: bool) -> Callable[[], float]:
    """Return a clock in seconds: the wall's for a GPU, else `processor_clock`."""
    return processor_clock if is_cpu else time.perf_counter


def processor_clock() -> float:
    """Return the processor time of this thread, plus that of all others over the cores.

    This is the time of the wall on a machine with nothing else to do, where this thread records a frame, then waits for
    the driver's threads, which share the work evenly.
    """
    own = time.thread_time()
    return own + (time.process_time() - own) / cores()
