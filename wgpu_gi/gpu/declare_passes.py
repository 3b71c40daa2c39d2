"""Declares passes and checks them against their shaders. An unchanged pass is reused without a check."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import wgpu

from ..errors import GiError
from . import attachments, bindings, checks
from .bindings import Over
from .declare_resources import ResourceDeclarations
from .handles import Buffer, Shared, Texture, View
from .passes import Count, Pass, RasterState, Use
from .schedule import Skipped, Work
from .timing import Timing
from .wgsl.load import ShaderSource, load
from .wgsl.module import EntryPoint


class PassDeclarations(ResourceDeclarations):
    """All passes of a frame. An unchanged pass keeps its state."""

    def __init__(self, device: Any, shader_root: Path | str | None = None) -> None:
        super().__init__(device)
        self.shader_root = shader_root
        self.passes: dict[str, Pass] = {}
        self.planned: dict[str, Pass | Work | Skipped] = {}  # in order of declaration
        self.timing = Timing(device)
        self.counts: dict[str, Count] = {}  # by the names of passes
        self._declaring = False
        self._old_passes: dict[str, Pass] = {}

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
        uniforms: Mapping[str, str] | None = None,
        entry: str = "main",
        settle: int = 0,
        split: bool = False,
        clear: Iterable[Buffer] = (),
    ) -> Pass:
        """Declare a compute pass. `over` is a texture (one thread per pixel), a buffer (per element) or a thread count.

        The keys of `reads` and `writes` are WGSL variable names; read_write bindings go in `writes`. `params` fills the
        fields of the uniform struct `params`. `constants` sets `override`s; each new value compiles a pipeline.
        `uniforms` maps shader variables to shared uniforms of another name: {"view": "view_second"}. The pass runs
        `settle` times after each change of an input. With `split`, it dispatches ranges of workgroups along x one by
        one; the shader adds `params.first_workgroup` to its workgroup_id.x. Buffers in `clear` are zeroed before each
        run. `indirect` replaces `over`: a buffer of three u32 group counts. Raises GiError if the declaration does not
        match the shader.
        """
        source = self._load(name, shader)
        clear = tuple(clear)
        # Reuse the pass of the previous declaration if it is unchanged.
        named = [_items(given) for given in (reads, writes, constants, uniforms)]
        arguments = (source, entry, over, indirect, split, clear, *named)
        known = self._unchanged(name, arguments, params, settle)
        if known is not None:
            return known
        # Check what is bound.
        where = f"pass {name!r} ({shader})"
        main = checks.entry_point(where, source, "compute", entry)
        assert main is not None
        more = () if indirect is None else (Use("indirect", View(indirect), "read", wgpu.BufferUsage.INDIRECT),)
        p = self._pass(name, source, (main,), reads, writes, params, constants, uniforms, settle, more)
        p.arguments, p.split, p.clear, p.indirect = arguments, split, clear, indirect
        # Check how it is dispatched.
        if split and "first_workgroup" not in (p.params.dtype.names or () if p.params is not None else ()):
            raise GiError(f"{where}: split=True needs a field first_workgroup: u32 in params")
        for buffer in p.clear:
            if buffer not in p.written or not isinstance(buffer, Buffer):
                raise GiError(f"{where}: clear takes buffers that the pass writes")
        if (over is None) == (indirect is None):
            raise GiError(f"{where}: give either over= (a texture, a buffer or a number of threads) or indirect=")
        if split and indirect is not None:
            raise GiError(f"{where}: split=True needs over=; the size of an indirect dispatch is not known")
        if over is not None:
            p.groups = bindings.workgroups(p, over)
        return self._add_new(p)

    def raster(
        self,
        name: str,
        shader: str,
        *,
        draw: Callable[[Any], None] | tuple[int, ...] | int,
        index: Buffer | Shared | View | None = None,
        color: Mapping[str, Texture | View] | None = None,
        depth: Texture | View | None = None,
        reads: Mapping[str, Any] | None = None,
        writes: Mapping[str, Any] | None = None,
        params: Mapping[str, Any] | None = None,
        constants: Mapping[str, float] | None = None,
        uniforms: Mapping[str, str] | None = None,
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

        `draw` is (vertices, instances), or a function that records draw calls on a render pass encoder. Redeclaration
        treats functions that compare equal, such as instances of a frozen dataclass, as unchanged. `index` is an index
        buffer of uint32; `draw` then counts indices. Targets are cleared unless `load`. Depth is reversed: 1 near,
        cleared to 0, greater wins. `entry` is (vertex, fragment); the rest is as in `compute`. Raises GiError if the
        declaration does not match the shader.
        """
        source = self._load(name, shader)
        # Reuse the pass of the previous declaration if it is unchanged.
        fixed = (topology, cull, depth_compare, depth_write, load, clear_color, clear_depth)
        named = [_items(given) for given in (color, reads, writes, constants, uniforms)]
        arguments = (source, entry, draw, index, depth, fixed, *named)
        known = self._unchanged(name, arguments, params, settle)
        if known is not None:
            return known
        # Check the targets and the index buffer.
        where = f"pass {name!r} ({shader})"
        entries = checks.raster_entries(where, source, entry, bool(color))
        targets = attachments.color_targets(where, entries[1] if len(entries) > 1 else None, color or {})
        target = attachments.depth_target(where, depth, depth_write) if depth is not None else None
        if not targets and target is None:
            raise GiError(f"{where}: it has neither color nor depth targets")
        attachments.same_size(where, [use.view for _, use in targets] + ([target.view] if target else []))
        indices = attachments.index_buffer(where, index) if index is not None else None
        more = tuple(use for _, use in targets) + tuple(use for use in (target, indices) if use is not None)
        # Check what is bound.
        p = self._pass(name, source, entries, reads, writes, params, constants, uniforms, settle, more)
        p.arguments = arguments
        p.raster = RasterState(targets, target, *fixed, (draw, 1) if isinstance(draw, int) else draw, indices)
        return self._add_new(p)

    def outside(self, name: str, work: Work) -> None:
        """List work on shared resources in the plan; it runs before the passes of a frame, whenever it is due."""
        self._check_new_pass(name, f"work {name!r}")
        self.planned[name] = work

    def skip(self, name: str, reason: str, bound: str | Callable[[], str]) -> None:
        """Record for the plan why a pass is not declared: "no alpha-masked material".

        `bound`: what it could add at most, or a function that returns that when a plan is described.
        """
        self._check_new_pass(name, f"pass {name!r}", "skipped")
        self.planned[name] = Skipped(reason, bound)

    def count(self, name: str, buffer: Buffer, part: int, whole: int, of: str) -> None:
        """Record for the plan which share of `of`, such as "directions", a pass works on.

        The words `part` and `whole` of the buffer, of u32, are the two numbers on the GPU.
        """
        self.counts[name] = Count(buffer, part, whole, of)

    def _check_new_pass(self, name: str, where: str, what: str = "declared") -> None:
        if not self._declaring:
            raise GiError(f"{where}: {what} outside of begin ... compile")
        if name in self.planned:
            raise GiError(f"{where}: two passes have this name; give one another")

    def _load(self, name: str, shader: str) -> ShaderSource:
        try:
            return load(shader, self.shader_root)
        except GiError as error:
            raise GiError(f"pass {name!r} ({shader}): {error}") from error

    def _pass(
        self,
        name: str,
        source: ShaderSource,
        entries: tuple[EntryPoint, ...],
        reads: Mapping[str, Any] | None,
        writes: Mapping[str, Any] | None,
        params: Mapping[str, Any] | None,
        constants: Mapping[str, float] | None,
        uniforms: Mapping[str, str] | None,
        settle: int,
        more: tuple[Use, ...],
    ) -> Pass:
        """Check what compute and raster passes have in common. `more` are uses outside `reads` and `writes`."""
        where = f"pass {name!r} ({source.path})"
        self._check_new_pass(name, where)
        used = checks.bindings_used(where, source, entries)
        filters = "float32-filterable" in self.device.features
        uses, samplers = checks.resource_uses(where, source, used, reads or {}, writes or {}, filters)
        checks.check_sampling(where, source, uses, samplers)
        checks.check_counts(where, entries, uses)
        shared = bindings.shared_uniforms(where, source, used, self.uniforms, uniforms or {})
        binding = bindings.params_binding(where, used, params or {})
        block = bindings.params_block(where, source, binding, params or {}) if binding is not None else None
        overrides = bindings.override_values(where, source, entries, constants or {})
        uses += more
        p = Pass(name, source, entries, tuple(uses), tuple(shared), tuple(samplers), block, binding, overrides, settle)
        p.param_arguments = _comparable(params)
        return p

    def _unchanged(self, name: str, arguments: tuple, params: Mapping[str, Any] | None, settle: int) -> Pass | None:
        """Return the pass of the previous declaration if its arguments are equal, with new params and `settle`.

        Return None if there is none, or if the objects that it binds have changed: the pass then needs a check.
        """
        p = self._old_passes.get(name)
        if p is None or p.arguments != arguments:
            return None
        self._check_new_pass(name, p.where)
        known, uniforms = self.resources, self.uniforms
        if any(known.get(r.name) is not r for r in p.resources):
            return None
        if any(uniforms.get(u.name) is not u for _, u in p.uniforms) or p.shared_bound != _bound(p):
            return None
        values = _comparable(params)
        if values != p.param_arguments:
            if p.params_binding is None:
                return None
            p.set_params(bindings.params_block(p.where, p.source, p.params_binding, params or {}))
            p.param_arguments = values
        p.settle = settle
        return self._add(p)

    def _add_new(self, p: Pass) -> Pass:
        """Add a checked pass. It takes over the state of the previous pass if their signatures are equal."""
        if not any(use.writes for use in p.uses):
            raise GiError(f"{p.where}: it writes nothing")
        for resource in p.resources:
            if self.resources.get(resource.name) is not resource:
                raise GiError(f"{p.where}: {resource.name!r} is of another declaration; declare it after begin")
        checks.check_hazards(p.where, p.uses)
        p.shared_bound = _bound(p)
        old = self._old_passes.get(p.name)
        if old is not None and old.signature() == p.signature():
            p.state, p.pipeline, p.layouts = old.state, old.pipeline, old.layouts
        else:
            self.timing.forget(p.name)
        return self._add(p)

    def _add(self, p: Pass) -> Pass:
        self.passes[p.name] = self.planned[p.name] = p
        return p


def _items(given: Mapping[str, Any] | None) -> tuple:
    return tuple(given.items()) if given else ()


def _comparable(params: Mapping[str, Any] | None) -> tuple:
    """Return params in comparable form: values that could change in place become bytes."""
    if not params:
        return ()
    return tuple((n, v if type(v) in (int, float, bool, tuple) else np.asarray(v).tobytes()) for n, v in params.items())


def _bound(p: Pass) -> tuple[int, ...]:
    """Identify the wgpu objects of shared resources: a new object may be too small or have another format."""
    return tuple(r.bound for r in p.shared)
