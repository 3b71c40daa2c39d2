"""Runs the stale passes of a graph: swaps histories, binds, records and submits; split passes chunk by chunk."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import wgpu

from ..errors import GiError
from .bind_groups import bind_groups, bound_object, write_params
from .bindings import MAX_GROUPS
from .device import Device
from .draw_calls import DrawEncoder
from .handles import Resource
from .messages import reason
from .passes import Chunk, Pass, PassState, RasterState
from .schedule import Stale, Work
from .timing import Timing
from .watch import check_written

CHUNK_STEP = (0.25, 8.0)  # bounds on the change from chunk to chunk; the first run includes compilation by the driver

_stamps = itertools.count(1)


def run(
    device: Device,
    order: list[Pass],
    stale: Mapping[Pass, Stale],
    timing: Timing | None,
    check: bool,
    on_chunk: Callable[[float], None] | None,
    on_compile: Callable[[int, int], None] | None,
    works: Mapping[str, Work],
) -> None:
    """Run `works`, then the stale passes of `order`; `timing` measures each of them.

    `check` reads back what each pass writes and raises GiError at the first bad value. `on_chunk` receives the
    finished fraction of a split pass. If the adapter compiles pipelines at their first use, `on_compile` receives how
    many of the new ones are compiled before each of them, and how many there are. After any exception, all stale passes
    start over.
    """
    frame = _Frame(device, timing, check, on_chunk)
    unused = device.pipelines.unused
    new = {p.pipeline for p in stale if p.pipeline in unused} if unused else set()
    count = len(new)
    if timing is not None:
        timing.begin()
    try:
        for name, work in works.items():
            frame.run_work(name, work)
        for resource in {r for p in stale for r in p.written if r.history}:
            resource.swap()
        if timing is None:
            # A clear ends the compute pass, so do all possible clears before the first compute pass begins.
            frame.clear(r for p in order if p.clear_first and p in stale for r in p.clear_first)
        for p in order:
            if p in stale:
                _prepare(device, p, stale[p])
                if p.pipeline in new:
                    frame.report_compiled(count - len(new), count, on_compile)
                    new.remove(p.pipeline)
                    unused.discard(p.pipeline)
                frame.run(p)
        frame.submit()
    except BaseException:
        # The GPU holds half a frame.
        for p in stale:
            p.state.restart()
        raise
    if timing is not None:
        timing.end()


class _Frame:
    """One command encoder, submitted once; a split pass, a measurement or a check submits earlier."""

    def __init__(
        self, device: Device, timing: Timing | None, check: bool, on_chunk: Callable[[float], None] | None
    ) -> None:
        self.device = device
        self.gpu = device.gpu
        self.timing = timing
        self.check = check
        self.on_chunk = on_chunk
        self.encoder: Any = None
        self.compute: Any = None  # the open compute pass encoder: takes all dispatches up to a clear or draw
        self.pipeline: Any = None  # the pipeline set on `compute`
        self.shared: Any = None  # bind group 0 set on `compute`

    def run(self, p: Pass) -> None:
        """Record a pass; submit at once if it must run alone."""
        timing = self.timing
        if timing is None and p.raster is None and not p.split and not self.check:
            self.clear(p.clear_late)
            self.record_compute(p, p.groups)
            return
        # A split pass, and a pass measured without timestamps, waits for the passes before it.
        by_wait = timing is not None and not timing.has_timestamps(p)
        if by_wait or (p.split and (timing is not None or self.device.capabilities.chunks_in_flight == 1)):
            self.submit()
            self.device.wait()
        started = 0.0 if timing is None else timing.clock()
        # Record it.
        self.clear(p.clear_late if timing is None else p.clear)
        if p.split:
            self.run_split(p)
        else:
            stamps = timing.writes(p) if timing is not None and not by_wait else None
            if p.raster is not None:
                self.record_raster(p, p.raster, stamps)
            else:
                self.record_compute(p, p.groups, stamps)
        # Measure and check it.
        if by_wait:
            self.submit()
            self.device.wait()
        if timing is not None and (by_wait or p.split):
            timing.add(p.name, (timing.clock() - started) * 1e3)
        if self.check:
            self.submit()
            check_written(self.gpu, p)

    def run_work(self, name: str, work: Work) -> None:
        """Run work outside of the graph."""
        if self.timing is None:
            work.run()
            return
        self.device.wait()
        started = self.timing.clock()
        work.run()
        self.device.wait()
        self.timing.add(name, (self.timing.clock() - started) * 1e3)

    def report_compiled(self, done: int, count: int, on_compile: Callable[[int, int], None] | None) -> None:
        """Report pipelines that have been compiled because they were used."""
        if on_compile is not None and self.device.capabilities.compiles_at_dispatch:
            self.submit()
            self.device.wait()
            on_compile(done, count)

    def begin(self) -> Any:
        """Return the command encoder, with no pass open."""
        if self.encoder is None:
            self.encoder = self.gpu.create_command_encoder(label="frame")
        if self.compute is not None:
            self.compute.end()
            self.compute = None
        return self.encoder

    def clear(self, resources: Iterable[Resource]) -> None:
        """Zero the contents of buffers."""
        for resource in resources:
            self.begin().clear_buffer(resource.object())

    def submit(self) -> Any:
        """Submit the recorded commands; return the submission. Raises GiError for an error that the driver detects."""
        if self.encoder is None:
            return None
        encoder, self.encoder = self.begin(), None
        try:
            return self.device.submit(encoder.finish())
        except (wgpu.GPUError, RuntimeError) as error:
            raise GiError(f"the GPU refused the frame: {reason(error)}") from error

    def record_compute(self, p: Pass, groups: tuple[int, int, int] | None, stamps: Any = None) -> None:
        """Record a dispatch. Set only what differs from the previous dispatch: each call of wgpu-py takes 1 us."""
        if self.compute is None or stamps:
            more = {"timestamp_writes": stamps} if stamps else {}
            self.compute = self.begin().begin_compute_pass(label="compute", **more)
            self.pipeline = self.shared = None
        compute = self.compute
        if p.pipeline is not self.pipeline:
            self.pipeline = p.pipeline
            compute.set_pipeline(p.pipeline)
        shared, own = bind_groups(self.device, p)
        if shared is not None and shared is not self.shared:
            self.shared = shared
            compute.set_bind_group(0, shared)
        compute.set_bind_group(1, own)
        if p.indirect is not None:
            compute.dispatch_workgroups_indirect(p.indirect.object(), 0)
        elif groups is not None:
            compute.dispatch_workgroups(*groups)
        if stamps:
            self.begin()

    def record_raster(self, p: Pass, raster: RasterState, stamps: Any) -> None:
        """Record a render pass."""
        # Describe the attachments.
        load = "load" if raster.load else "clear"
        colors = [
            {
                "view": bound_object(use),
                "load_op": load,
                "store_op": "store",
                "clear_value": raster.clear_color,
            }
            for _, use in raster.targets
        ]
        depth = None
        if raster.depth is not None:
            depth = {"view": bound_object(raster.depth), "depth_read_only": not raster.depth_write}
            if raster.depth_write:
                depth |= {"depth_load_op": load, "depth_store_op": "store", "depth_clear_value": raster.clear_depth}
        # Draw.
        encoder = self.begin().begin_render_pass(
            label=p.name,
            color_attachments=colors,
            depth_stencil_attachment=depth,
            **({"timestamp_writes": stamps} if stamps else {}),
        )
        encoder.set_pipeline(p.pipeline)
        for index, group in enumerate(bind_groups(self.device, p)):
            if group is not None:
                encoder.set_bind_group(index, group)
        if raster.index is not None:
            encoder.set_index_buffer(raster.index.view.resource.object(raster.index.view.previous), "uint32")
        if callable(raster.draw):
            raster.draw(DrawEncoder(encoder, self.gpu, self.device.capabilities.multi_draw))
        elif raster.index is not None:
            encoder.draw_indexed(*raster.draw)
        else:
            encoder.draw(*raster.draw)
        encoder.end()

    def run_split(self, p: Pass) -> None:
        """Dispatch consecutive ranges of workgroups along x, several in flight; the last are awaited by the next run.

        With `timing`, all are awaited.
        """
        assert p.groups is not None
        total, y, z = p.groups
        state, most = p.state, self.device.capabilities.chunks_in_flight
        first = 0
        while first < total:
            count = min(state.chunk, total - first, MAX_GROUPS)
            write_params(self.device, p, first)
            submitted = time.perf_counter()
            self.record_compute(p, (count, y, z))
            state.in_flight.append(Chunk(self.submit(), state.chunk, count, submitted))
            first += count
            self.await_chunks(state, most - 1)
            if self.on_chunk is not None:
                self.on_chunk(first / total)
        if self.timing is not None:
            self.await_chunks(state, 0)

    def await_chunks(self, state: PassState, most: int) -> None:
        """Wait until at most `most` chunks are in flight; choose the size of the next one by their time."""
        while len(state.in_flight) > most:
            chunk = state.in_flight.popleft()
            self.device.wait(chunk.submission)
            now = time.perf_counter()
            # It began when it was submitted, or when the one before it ended.
            seconds = now - max(chunk.submitted, state.last_end)
            state.last_end = now
            state.chunk = next_chunk(chunk.size, chunk.groups, seconds, self.device.capabilities.chunk_seconds)


def next_chunk(chunk: int, count: int, seconds: float, wanted: tuple[float, float, float]) -> int:
    """Return how many workgroups to dispatch next, after `count` (at most `chunk`) took `seconds`.

    wanted: the least, best and greatest seconds.
    """
    low, aim, high = wanted
    if seconds > high or (seconds < low and count == chunk):
        change = min(max(aim / max(seconds, 1e-6), CHUNK_STEP[0]), CHUNK_STEP[1])
        return min(max(int(count * change), 1), MAX_GROUPS)
    return chunk


def _prepare(device: Device, p: Pass, why: Stale) -> None:
    """Record the run in the state of the pass and write its params."""
    state = p.state
    if why.kind != "repeated":
        state.settle_index = state.settle_index + 1 if why.kind == "settling" else 0
        state.stamp = next(_stamps)
    state.seen = p.inputs()
    state.runs += 1
    write_params(device, p, 0)
