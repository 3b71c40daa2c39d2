"""The render graph: textures, buffers and passes declared by name, checked against their shaders, run when needed.

A technique calls `texture`, `buffer`, `compute` and `raster`; the renderer calls `begin` before and `compile` after,
and `run` each frame. A pass runs only if an output needs it and one of its inputs changed since its last run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import wgpu

from ..errors import GiError
from . import checks, describe, execute, schedule, transfer, values
from .declare import Declarations
from .handles import Buffer, Handle, Resource, Shared, Texture, View
from .passes import Pass, RasterState, Use
from .timing import Timing
from .values import Over
from .wgsl import ShaderSource, load

# Uses that are always allowed: reading back, clearing, and a reader that is declared later, which must not cost the
# contents. All other uses come from the passes.
ALWAYS = {
    Texture: wgpu.TextureUsage.COPY_SRC | wgpu.TextureUsage.COPY_DST | wgpu.TextureUsage.TEXTURE_BINDING,
    Buffer: wgpu.BufferUsage.COPY_SRC | wgpu.BufferUsage.COPY_DST | wgpu.BufferUsage.STORAGE,
    Shared: 0,
}


class Graph(Declarations):
    """A frame as a makefile. `device` is a `Device`; shaders under `shader_root` are found before the package's."""

    def __init__(self, device: Any, shader_root: Path | str | None = None) -> None:
        super().__init__(device)
        self.shader_root = shader_root
        self.passes: dict[str, Pass] = {}
        self.timing = Timing(device)
        self.order: list[Pass] = []  # the active passes
        self.last_run: dict[str, str] = {}  # why each pass that ran last time ran
        self._declaring = False
        self._old_passes: dict[str, Pass] = {}

    def begin(self, size: tuple[int, int] = (1, 1)) -> None:
        """Start a declaration for a viewport of `size` (width, height) pixels.

        What is declared as before, by name, keeps its contents and its state; the rest goes at `compile`.
        """
        if min(size) < 1:
            raise GiError(f"a viewport of {size[0]} x {size[1]} pixels has none; give at least 1 x 1")
        # After a declaration that failed half-way, the one before it still counts.
        self._old_resources = self.resources | self._old_resources
        self._old_passes = self.passes | self._old_passes
        self.resources, self.passes, self.order = {}, {}, []
        self.size = (int(size[0]), int(size[1]))
        self._declaring = True

    def compute(
        self,
        name: str,
        shader: str,
        *,
        over: Over | None = None,
        indirect: Buffer | None = None,
        reads: Mapping[str, Any] | None = None,
        writes: Mapping[str, Any] | None = None,
        params: Mapping[str, Any] | None = None,
        constants: Mapping[str, float] | None = None,
        entry: str = "main",
        settle: int = 0,
        split: bool = False,
        clear: Iterable[Buffer] = (),
    ) -> Pass:
        """Declare a compute pass with a thread for each pixel of a texture, element of a buffer, or of `over` threads.

        The keys of `reads` and `writes` are WGSL variable names; read_write bindings go in `writes`. `settle` runs
        follow each change. With `split`, consecutive ranges of workgroups along x are dispatched one by one; the
        shader adds `params.first_workgroup` to its workgroup_id.x. `clear` are buffers zeroed before each run.
        `indirect` is a buffer of three u32 group counts, instead of `over`.
        """
        where = f"pass {name!r} ({shader})"
        source = self._load(name, shader)
        main = checks.entry_point(where, source, "compute", entry)
        assert main is not None
        p = self._pass(name, source, (main,), reads or {}, writes or {}, params or {}, constants or {}, settle)
        p.split, p.clear = split, tuple(clear)
        if split and "first_workgroup" not in (p.params.dtype.names or () if p.params is not None else ()):
            raise GiError(f"{where}: split=True needs a field first_workgroup: u32 in params")
        for buffer in p.clear:
            if buffer not in p.written() or not isinstance(buffer, Buffer):
                raise GiError(f"{where}: clear takes buffers that the pass writes")
        if (over is None) == (indirect is None):
            raise GiError(f"{where}: give either over= (a texture, a buffer or a number of threads) or indirect=")
        if split and indirect is not None:
            raise GiError(f"{where}: split=True needs over=; the size of an indirect dispatch is not known")
        if indirect is not None:
            p.indirect = indirect
            p.uses += (Use("indirect", View(indirect), "read", wgpu.BufferUsage.INDIRECT),)
        elif over is not None:
            p.groups = values.workgroups(p, over)
        return self._add(p)

    def raster(
        self,
        name: str,
        shader: str,
        *,
        draw: Callable[[Any], None] | tuple[int, ...] | int,
        color: Mapping[str, Texture | View] | None = None,
        depth: Texture | View | None = None,
        reads: Mapping[str, Any] | None = None,
        writes: Mapping[str, Any] | None = None,
        params: Mapping[str, Any] | None = None,
        constants: Mapping[str, float] | None = None,
        entry: tuple[str, str] | None = None,
        settle: int = 0,
        topology: str = "triangle-list",
        cull: str = "none",
        depth_compare: str = "greater",
        depth_write: bool = True,
        load: bool = False,
        clear_color: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0),
        clear_depth: float = 0.0,
    ) -> Pass:
        """Declare a raster pass; the keys of `color` are the names of the fragment shader's outputs.

        `draw` records draw calls on the render pass encoder it is given, or is (vertices, instances). Targets are
        cleared unless `load`. Depth is reversed: 1 near, cleared to 0, greater wins. `entry` is (vertex, fragment).
        """
        where = f"pass {name!r} ({shader})"
        source = self._load(name, shader)
        vertex = checks.entry_point(where, source, "vertex", entry[0] if entry else None)
        fragment = checks.entry_point(where, source, "fragment", entry[1] if entry else None)
        if vertex is None:
            raise GiError(f"{where}: it has no vertex entry point")
        if color and fragment is None:
            raise GiError(f"{where}: it has no fragment entry point, but color targets are given")
        entries = (vertex,) if fragment is None else (vertex, fragment)
        p = self._pass(name, source, entries, reads or {}, writes or {}, params or {}, constants or {}, settle)
        targets = checks.color_targets(where, fragment, color or {})
        target = checks.depth_target(where, depth, depth_write) if depth is not None else None
        if not targets and target is None:
            raise GiError(f"{where}: it has neither color nor depth targets")
        checks.same_size(where, [use.view for _, use in targets] + ([target.view] if target else []))
        p.uses += tuple(use for _, use in targets) + ((target,) if target else ())
        calls = (draw, 1) if isinstance(draw, int) else draw
        p.raster = RasterState(
            targets, target, topology, cull, depth_compare, depth_write, load, clear_color, clear_depth, calls
        )
        return self._add(p)

    # Running.

    def compile(self, outputs: Iterable[Handle | str]) -> None:
        """Cull what `outputs` do not need, allocate the rest, and make the pipelines. Nothing runs.

        Raises GiError for a resource that is read before any pass writes it, and for shaders that do not compile.
        """
        wanted = [self._find(output) for output in outputs]
        schedule.link(list(self.passes.values()), wanted)
        for name, resource in self._old_resources.items():
            if self.resources.get(name) is not resource:
                resource.release()
        self._old_resources, self._old_passes = {}, {}
        self.order = [p for p in self.passes.values() if p.active]
        usage: dict[Resource, int] = {}
        for p in self.order:
            for use in p.uses:
                usage[use.view.resource] = usage.get(use.view.resource, ALWAYS[type(use.view.resource)]) | use.usage
        for resource, flags in usage.items():
            resource.allocate(self.device.gpu, flags)
        for p in self.order:
            p.pipeline = self.device.pipelines.of(p)
        self._declaring = False

    def run(
        self,
        force: bool = False,
        *,
        timings: bool = False,
        check: bool = False,
        on_chunk: Callable[[float], None] | None = None,
    ) -> bool:
        """Run the stale passes, or all with `force`; return True if any ran.

        `timings` measures each pass (see `plan`). `check` reads back all that is written and raises GiError at the
        first NaN, infinity, or negative value where none may be. `on_chunk` is called between the parts of split
        passes with the fraction of the pass that is done.
        """
        if self._declaring:
            raise GiError("the graph is declared but not compiled; call compile(outputs) before run")
        return execute.run(self, force, timings, check, on_chunk)

    @property
    def at_rest(self) -> bool:
        """True if `run` would do nothing."""
        return not schedule.stale_passes(self.order)

    def settle_progress(self) -> float:
        """Return how far the settling passes are, from 0 to 1."""
        settling = [p for p in self.order if p.settle > 1]
        done = sum(min(p.state.settle_index + 1, p.settle) for p in settling if p.state.seen is not None)
        return done / sum(p.settle for p in settling) if settling else 1.0

    def read_back(self, handle: Handle | str, mip: int = 0) -> np.ndarray:
        """Return the contents: (height, width, channels), with layers in front if several, or (count,).

        Values are as stored: uint8 for rgba8unorm. Raises GiError if it was never allocated.
        """
        view = self._find(handle)
        level = mip if view.mip is None else view.mip
        return transfer.read_back(self.device.gpu, view, level)

    def plan(self) -> list[describe.Row]:
        """Return what each pass did in the last run, and why; `describe.table` prints it."""
        return describe.plan(self)

    def release(self) -> None:
        """Destroy all that the graph allocated; shared resources stay. It can be declared anew."""
        for resource in (self._old_resources | self.resources).values():
            resource.release()
        for neutral in self._neutrals.values():
            neutral.object().destroy()
        for p in (self._old_passes | self.passes).values():
            if p.state.params_buffer is not None:
                p.state.params_buffer.destroy()
        for uniform in self.uniforms.values():
            uniform.gpu.destroy()
        for known in (
            self.resources,
            self._old_resources,
            self._neutrals,
            self.passes,
            self._old_passes,
            self.uniforms,
        ):
            known.clear()
        self.order = []

    # Inside.

    def _load(self, name: str, shader: str) -> ShaderSource:
        try:
            return load(shader, self.shader_root)
        except GiError as error:
            raise GiError(f"pass {name!r} ({shader}): {error}") from error

    def _pass(
        self,
        name: str,
        source: ShaderSource,
        entries: tuple[Any, ...],
        reads: Mapping[str, Any],
        writes: Mapping[str, Any],
        params: Mapping[str, Any],
        constants: Mapping[str, float],
        settle: int,
    ) -> Pass:
        """Check what compute and raster passes have in common."""
        where = f"pass {name!r} ({source.path})"
        if name in self.passes:
            raise GiError(f"{where}: two passes have this name; give one another")
        used = checks.bindings_used(where, source, entries)
        filters = "float32-filterable" in self.device.features
        uses, samplers = checks.resource_uses(where, source, used, reads, writes, filters)
        checks.check_sampling(where, source, uses, samplers)
        uniforms = values.shared_uniforms(where, source, used, self.uniforms)
        block, binding = values.params_block(where, source, used, params)
        overrides = values.override_values(where, source, entries, constants)
        return Pass(
            name, source, entries, tuple(uses), tuple(uniforms), tuple(samplers), block, binding, overrides, settle
        )

    def _add(self, p: Pass) -> Pass:
        """Add a pass; it takes over the state of the same pass of the declaration before."""
        if not self._declaring:
            raise GiError(f"{p.where}: declared outside of begin ... compile")
        if not any(use.writes for use in p.uses):
            raise GiError(f"{p.where}: it writes nothing")
        for name, resource in ((use.view.resource.name, use.view.resource) for use in p.uses):
            if self.resources.get(name) is not resource:
                raise GiError(f"{p.where}: {name!r} is of another declaration; declare it after begin")
        checks.check_hazards(p.where, p.uses)
        old = self._old_passes.get(p.name)
        if old is not None and old.signature() == p.signature():
            p.state = old.state
        else:
            self.timing.forget(p.name)
        self.passes[p.name] = p
        return p
