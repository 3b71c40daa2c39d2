"""Measures ms per pass: by timestamp queries where the driver's are right, else by waiting before and after a pass."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np
import wgpu

from .passes import Pass

RING = 256  # samples kept of each pass: more than a benchmark's frames, and enough for a 95th percentile
MAX_QUERIES = 4096  # the largest query set of WebGPU


class Timing:
    """Collects the time of each pass in measured runs, and the sum per run (`frames`).

    `clock` returns the seconds that passes without timestamps are timed by.
    """

    def __init__(self, device: Any) -> None:
        self.device = device
        self.clock: Callable[[], float] = time.perf_counter
        self.samples: dict[str, deque[float]] = {}
        self.frames: deque[float] = deque(maxlen=RING)
        self._sum = 0.0  # ms of the passes of this run
        self._queries: Any = None
        self._buffer: Any = None
        self._pending: list[str] = []

    def begin(self) -> None:
        """Start a run; drop what an earlier run left unfinished."""
        self._pending.clear()
        self._sum = 0.0

    def has_timestamps(self, p: Pass) -> bool:
        """True if timestamps around this kind of pass are right on this device."""
        return bool(self.device.render_timestamps if p.raster else self.device.compute_timestamps)

    def writes(self, p: Pass) -> dict[str, Any] | None:
        """Return the `timestamp_writes` of a pass that is recorded now; None if the frame has too many."""
        first = 2 * len(self._pending)
        if first + 2 > MAX_QUERIES:
            return None
        if self._queries is None:
            gpu = self.device.gpu
            self._queries = gpu.create_query_set(label="timing", type="timestamp", count=MAX_QUERIES)
            usage = wgpu.BufferUsage.QUERY_RESOLVE | wgpu.BufferUsage.COPY_SRC
            self._buffer = gpu.create_buffer(label="timing", size=8 * MAX_QUERIES, usage=usage)
        self._pending.append(p.name)
        return {
            "query_set": self._queries,
            "beginning_of_pass_write_index": first,
            "end_of_pass_write_index": first + 1,
        }

    def end(self) -> None:
        """Finish a run: wait for its passes and record their sum."""
        if self._pending:
            self._collect()
        self.frames.append(self._sum)

    def _collect(self) -> None:
        """Read the queries."""
        count = 2 * len(self._pending)
        gpu = self.device.gpu
        encoder = gpu.create_command_encoder(label="timing")
        encoder.resolve_query_set(self._queries, 0, count, self._buffer, 0)
        gpu.queue.submit([encoder.finish()])
        stamps = np.frombuffer(gpu.queue.read_buffer(self._buffer, 0, 8 * count), np.uint64).reshape(-1, 2)
        for name, (begin, end) in zip(self._pending, stamps.astype(np.int64), strict=True):
            self.add(name, max(0, int(end) - int(begin)) * self.device.timestamp_period / 1e6)
        self._pending.clear()

    def add(self, name: str, ms: float) -> None:
        """Record the measured time of a pass."""
        self.samples.setdefault(name, deque(maxlen=RING)).append(ms)
        self._sum += ms

    def forget(self, name: str) -> None:
        """Drop the times of a pass that has changed, and the sums that contain it."""
        self.samples.pop(name, None)
        self.frames.clear()

    def clear(self) -> None:
        """Drop all times, such as those of a warm-up."""
        self.samples.clear()
        self.frames.clear()

    def median(self, name: str) -> float | None:
        """Return the median of a pass in milliseconds, None if it was not measured."""
        return _percentile(self.samples.get(name), 50)

    def p95(self, name: str) -> float | None:
        """Return the 95th percentile of a pass in milliseconds, None if it was not measured."""
        return _percentile(self.samples.get(name), 95)

    def frame_ms(self) -> tuple[float, float] | None:
        """Return median and 95th percentile of the sums per run in milliseconds, None if none was measured."""
        median, p95 = _percentile(self.frames, 50), _percentile(self.frames, 95)
        return None if median is None or p95 is None else (median, p95)


def _percentile(samples: deque[float] | None, percent: float) -> float | None:
    """Return the same percentile as numpy (linear interpolation) in a tenth of the time."""
    if not samples:
        return None
    ordered = sorted(samples)
    place = (len(ordered) - 1) * percent / 100
    low, high = ordered[int(place)], ordered[math.ceil(place)]
    return low + (high - low) * (place - int(place))
