"""Lists of draw calls: drawn by one command from a buffer where the adapter can, else one by one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import wgpu
from wgpu.backends.wgpu_native.extras import multi_draw_indexed_indirect

CALL_BYTES = 20  # of five u32


class DrawCalls:
    """Indexed draws: (n, 5) uint32 with indices, instances, first index, base vertex and first instance."""

    def __init__(self, calls: Sequence[tuple[int, int, int, int, int]] = ()) -> None:
        self._buffer: Any = None
        self._room = 0  # calls that fit into the buffer
        self.set(calls)

    def set(self, calls: Sequence[tuple[int, int, int, int, int]]) -> None:
        """Replace the calls."""
        self.calls = np.array(calls, np.uint32).reshape(-1, 5)
        self._on_gpu = False

    def buffer(self, gpu: Any) -> Any:
        """Return a buffer with the calls, written by the next submission."""
        if self._room < len(self.calls):
            self._room = 2 * len(self.calls)
            usage = wgpu.BufferUsage.INDIRECT | wgpu.BufferUsage.COPY_DST
            self._buffer = gpu.create_buffer(label="draw calls", size=CALL_BYTES * self._room, usage=usage)
        if not self._on_gpu:
            gpu.queue.write_buffer(self._buffer, 0, self.calls)
            self._on_gpu = True
        return self._buffer


class DrawEncoder:
    """A render pass encoder that also draws lists of calls."""

    def __init__(self, encoder: Any, gpu: Any, multi_draw: bool) -> None:
        self._encoder, self._gpu, self._multi_draw = encoder, gpu, multi_draw

    def __getattr__(self, name: str) -> Any:
        return getattr(self._encoder, name)

    def draw_all(self, draws: DrawCalls, first: int = 0, count: int | None = None) -> None:
        """Draw `count` calls from `first` on; None: all. The calls must not change before the frame is submitted."""
        end = len(draws.calls) if count is None else first + count
        if self._multi_draw and end - first > 1:
            multi_draw_indexed_indirect(
                self._encoder, draws.buffer(self._gpu), offset=CALL_BYTES * first, count=end - first
            )
            return
        for call in draws.calls[first:end].tolist():
            self._encoder.draw_indexed(*call)
