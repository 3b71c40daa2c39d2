"""The render graph: textures, buffers and passes declared by name, checked against their shaders, run when needed.

A technique calls `texture` and `buffer` (`declare_resources.py`), `compute` and `raster` (`declare_passes.py`); the
renderer calls `begin` before and `compile` after, and `run` each frame. A pass runs only if an output needs it and
one of its inputs changed since its last run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import wgpu

from ..errors import GiError
from . import describe, execute, schedule, transfer
from .declare_passes import PassDeclarations
from .handles import Buffer, Handle, Resource, Shared, Texture, View
from .passes import Pass
from .schedule import Work
from .wgsl.load import refresh

# Usage flags of every resource: read-back, clear, and a reader that is declared later (adding it must not lose the
# contents). The passes add all other flags.
ALWAYS = {
    Texture: wgpu.TextureUsage.COPY_SRC | wgpu.TextureUsage.COPY_DST | wgpu.TextureUsage.TEXTURE_BINDING,
    Buffer: wgpu.BufferUsage.COPY_SRC | wgpu.BufferUsage.COPY_DST | wgpu.BufferUsage.STORAGE,
    Shared: 0,
}


class Graph(PassDeclarations):
    """A frame that reruns only stale passes, like make. Shaders under `shader_root` come before the package's."""

    def __init__(self, device: Any, shader_root: Path | str | None = None) -> None:
        super().__init__(device, shader_root)
        refresh()  # a new graph reads the current shader files; later changes need another `refresh`
        self.order: list[Pass] = []  # the active passes
        self.last_run: dict[str, schedule.Stale] = {}  # why each pass of the last run ran
        # Receives the number of pipelines compiled so far, and of all that must be, in `compile` or `run`.
        self.on_compile: Callable[[int, int], None] | None = None
        self._linked: tuple | None = None  # the passes and outputs of the last `compile`

    def begin(self, size: tuple[int, int] = (1, 1)) -> None:
        """Start a declaration for a viewport of `size` (width, height) pixels. Raises GiError for an empty viewport.

        Resources and passes that are declared again unchanged keep their contents and state; `compile` frees the
        others. Shared resources stay.
        """
        if min(size) < 1:
            raise GiError(f"a viewport of {size[0]} x {size[1]} pixels is empty; give at least 1 x 1")
        # If the last declaration failed half-way, the one before it still counts.
        self._old_resources = self.resources | self._old_resources
        self._old_passes = self.passes | self._old_passes
        self.resources = {name: r for name, r in self.resources.items() if isinstance(r, Shared)}
        self.passes, self.planned, self.counts, self.order = {}, {}, {}, []
        self.size = (int(size[0]), int(size[1]))
        self._declaring = True

    # Running.

    def compile(self, outputs: Iterable[Handle | str]) -> None:
        """Cull passes that `outputs` do not need; allocate resources and create pipelines for the others. Nothing runs.

        Raises GiError for a resource that is read before any pass writes it, and for shaders that do not compile.
        """
        wanted = tuple(self._find(output) for output in outputs)
        passes = tuple(self.passes.values())
        if (passes, wanted) != self._linked:
            self._link(passes, wanted)
        self.order = [p for p in passes if p.active]
        self._free_old()
        self._declaring = False

    def _link(self, passes: tuple[Pass, ...], wanted: tuple[View, ...]) -> None:
        """Find the active passes, allocate what they use, and make their pipelines."""
        self._linked = None
        schedule.link(passes, wanted)
        active = [p for p in passes if p.active]
        # Free unused resources first, so that old and new contents do not add up.
        self._free_resources()
        usage: dict[Resource, int] = {}
        for p in active:
            for use in p.uses:
                usage[use.view.resource] = usage.get(use.view.resource, ALWAYS[type(use.view.resource)]) | use.usage
        for resource, flags in usage.items():
            resource.allocate(self.device.gpu, flags)
        on_compile, at_dispatch = self.on_compile, self.device.capabilities.compiles_at_dispatch
        self.device.pipelines.make(
            [p for p in active if p.pipeline is None],
            threaded=not at_dispatch,
            made=None if on_compile is None else lambda made, of: on_compile(0 if at_dispatch else made, of),
        )
        self._linked = (passes, wanted)

    def _free_resources(self) -> None:
        """Free the resources of earlier declarations that are no longer declared."""
        for name, resource in self._old_resources.items():
            if self.resources.get(name) is not resource:
                resource.release()
        self._old_resources = {}

    def _free_old(self) -> None:
        """Free the resources, pass states and pipelines that only earlier declarations used."""
        self._free_resources()
        gone = [p for name, p in self._old_passes.items() if self.passes.get(name) is not p]
        kept = {p.state for p in self.passes.values()}
        for p in gone:
            if p.state not in kept:
                p.state.release()
        self.device.pipelines.retire(gone, self.order)
        for p in gone:
            p.retire()
        self._old_passes = {}

    def run(
        self,
        force: bool = False,
        *,
        timings: bool = False,
        check: bool = False,
        on_chunk: Callable[[float], None] | None = None,
    ) -> bool:
        """Run the stale passes, or all with `force`, after the work that is due; return True if any ran.

        `timings` measures each pass and their sum (see `plan` and `timing`). `check` reads back all that is written
        and raises GiError at the first NaN, infinity, value at the end of a narrow format's range, or negative value
        in a `nonnegative` resource. `on_chunk` receives the finished fraction of a split pass after each chunk.
        """
        if self._declaring:
            raise GiError("the graph is declared but not compiled; call compile(outputs) before run")
        stale = schedule.stale_passes(self.order, force)
        works = {name: w for name, w in self.planned.items() if isinstance(w, Work) and stale and (w.due or force)}
        self.last_run = {name: schedule.Stale("changed", work.due or "forced") for name, work in works.items()}
        self.last_run |= {p.name: why for p, why in stale.items()}
        if stale:
            timing = self.timing if timings else None
            execute.run(self.device, self.order, stale, timing, check, on_chunk, self.on_compile, works)
        return bool(stale)

    @property
    def at_rest(self) -> bool:
        """True if `run` would do nothing."""
        return not self.stale()

    def stale(self) -> tuple[str, ...]:
        """Return the names of the passes that `run` would run."""
        return tuple(p.name for p in schedule.stale_passes(self.order))

    def settle_progress(self) -> float:
        """Return how far the settling passes are, from 0 to 1."""
        settling = [p for p in self.order if p.settle > 1]
        done = sum(min(p.state.settle_index + 1, p.settle) for p in settling if p.state.seen is not None)
        return done / sum(p.settle for p in settling) if settling else 1.0

    def read_back(self, handle: Handle | str, mip: int = 0) -> np.ndarray:
        """Return the contents: (height, width, channels), after an axis of layers if there are several, or (count,).

        Values are as stored: uint8 for rgba8unorm. Raises GiError if the resource was never allocated.
        """
        view = self._find(handle)
        level = mip if view.mip is None else view.mip
        return transfer.read_back(self.device.gpu, view, level)

    def plan(self, ran: Mapping[str, schedule.Stale] | None = None, *, counts: bool = False) -> list[describe.Row]:
        """Return what each pass did in the last run, or in the run whose `last_run` was `ran`.

        `describe.table` prints it. counts: read back which shares passes worked on, which waits for the GPU, and
        compute what skipped passes could add at most.
        """
        shares = {}
        for name, count in self.counts.items():
            if counts and self.passes[name].active:
                words = transfer.read_words(self.device.gpu, count.buffer, max(count.part, count.whole) + 1)
                shares[name] = describe.share(int(words[count.part]), int(words[count.whole]), count.of)
        return describe.plan(self.planned, self.last_run if ran is None else ran, self.timing, shares, bounds=counts)

    def release(self) -> None:
        """Destroy all that the graph allocated, except shared resources. A new declaration may follow."""
        for resource in (self._old_resources | self.resources).values():
            resource.release()
        for neutral in self._neutrals.values():
            neutral.object().destroy()
        passes = [*self._old_passes.values(), *self.passes.values()]
        self.device.pipelines.retire(passes)
        for p in passes:
            p.state.release()
            p.retire()
        for uniform in self.uniforms.values():
            uniform.groups.clear()
            uniform.gpu.destroy()
        for known in (
            self.resources,
            self._old_resources,
            self._neutrals,
            self.passes,
            self.planned,
            self._old_passes,
            self.uniforms,
            self.counts,
        ):
            known.clear()
        self.order, self._linked = [], None
