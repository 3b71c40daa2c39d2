"""Creates and caches pipelines. A shader that does not compile raises GiError with file and line."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any
from weakref import WeakKeyDictionary, WeakSet, WeakValueDictionary

import wgpu

from ..errors import GiError
from .messages import compiler_message, reason
from .passes import Pass, RasterState, Use
from .wgsl.dead_branches import without_dead_branches
from .wgsl.load import ShaderSource
from .wgsl.module import Binding

STAGES = {
    "compute": wgpu.ShaderStage.COMPUTE,
    "vertex": wgpu.ShaderStage.VERTEX,
    "fragment": wgpu.ShaderStage.FRAGMENT,
}


MOST_THREADS = 8  # that compile; the largest technique has 65 pipelines
KEPT = 256  # unused pipelines: all techniques at all qualities have 146; switching back to one compiles none


class Pipelines:
    """All shader modules, bind group layouts and pipelines of a device, for all its graphs.

    A pipeline lives while a pass uses it, or while it is among the last `KEPT` that were retired. A shader module lives
    as long as its source.
    """

    def __init__(self, gpu: Any) -> None:
        self.gpu = gpu
        self._modules: WeakKeyDictionary[ShaderSource, dict[str, Any]] = WeakKeyDictionary()  # by what is compiled
        self._layouts: dict[tuple, Any] = {}
        self._pipelines: WeakValueDictionary[tuple, Any] = WeakValueDictionary()
        self._retired: dict[Any, None] = {}  # longest unused first
        self.unused: WeakSet[Any] = WeakSet()  # pipelines that no pass has run with

    def make(self, passes: Sequence[Pass], threaded: bool, made: Callable[[int, int], None] | None = None) -> None:
        """Give each pass its pipeline, and the layouts of its bind groups 0 (shared uniforms) and 1.

        `made` receives how many pipelines have been created, and how many must be. Raises GiError with file and line
        if a shader does not compile.
        """
        # Find the pipelines that exist.
        keys: dict[Pass, tuple] = {}
        missing: dict[tuple, Pass] = {}
        found: dict[tuple, Any] = {}
        for p in passes:
            groups = (self._entries(p, 0), self._entries(p, 1))
            p.layouts = (self._layout(p.name, groups[0]), self._layout(p.name, groups[1]))
            keys[p] = key = _key(p, groups)
            existing = self._pipelines.get(key)
            if existing is None:
                missing.setdefault(key, p)
            else:
                found[key] = existing
        # Create the others.
        codes = {p: _code(p) for p in missing.values()}
        modules = {(p.source, code): p for p, code in codes.items() if code not in self._modules.get(p.source, {})}
        with _mapping(threaded and len(missing) > 1) as mapped:
            made_modules = mapped(lambda item: self._module(*item), [(p, code) for (_, code), p in modules.items()])
            for (source, code), module in zip(modules, made_modules, strict=True):
                self._modules.setdefault(source, {})[code] = module
            new = mapped(lambda p: self._new(p, self._modules[p.source][codes[p]]), missing.values())
            for number, (key, pipeline) in enumerate(zip(missing, new, strict=True), 1):
                found[key] = self._pipelines[key] = pipeline
                self.unused.add(pipeline)
                self._retired[pipeline] = None  # kept if `made` interrupts
                if made is not None:
                    made(number, len(missing))
        for p, key in keys.items():
            p.pipeline = found[key]
            self._retired.pop(p.pipeline, None)

    def retire(self, gone: Iterable[Pass], staying: Iterable[Pass] = ()) -> None:
        """Retire the pipelines of the passes `gone`, except those that passes in `staying` use."""
        used = {p.pipeline for p in staying}
        for p in gone:
            if p.pipeline is not None and p.pipeline not in used:
                self._retired.pop(p.pipeline, None)
                self._retired[p.pipeline] = None
            p.pipeline = None
        while len(self._retired) > KEPT:
            del self._retired[next(iter(self._retired))]

    def _module(self, p: Pass, code: str) -> Any:
        try:
            return self.gpu.create_shader_module(label=p.source.path, code=code)
        except (wgpu.GPUError, RuntimeError) as error:
            raise GiError(f"{p.where}: {compiler_message(error, p.source)}") from error

    def _new(self, p: Pass, module: Any) -> Any:
        assert p.layouts is not None
        try:
            layout = self.gpu.create_pipeline_layout(label=p.name, bind_group_layouts=list(p.layouts))
            return self._raster(p, module, layout) if p.raster else self._compute(p, module, layout)
        except (wgpu.GPUError, RuntimeError) as error:
            raise GiError(f"{p.where}: {compiler_message(error, p.source)}") from error

    def _compute(self, p: Pass, module: Any, layout: Any) -> Any:
        stage = {"module": module, "entry_point": p.entries[0].name, "constants": p.constants}
        return self.gpu.create_compute_pipeline(label=p.name, layout=layout, compute=stage)

    def _raster(self, p: Pass, module: Any, layout: Any) -> Any:
        assert p.raster is not None
        stages = {e.stage: {"module": module, "entry_point": e.name, "constants": p.constants} for e in p.entries}
        formats = dict(p.raster.targets)
        fragment = None
        if "fragment" in stages:
            targets = [{"format": _format(formats[i])} for i in range(len(formats))]
            fragment = {**stages["fragment"], "targets": targets}
        depth = None
        if p.raster.depth is not None:
            depth = {
                "format": _format(p.raster.depth),
                "depth_write_enabled": p.raster.depth_write,
                "depth_compare": p.raster.depth_compare,
            }
        return self.gpu.create_render_pipeline(
            label=p.name,
            layout=layout,
            vertex={**stages["vertex"], "buffers": []},
            primitive={"topology": p.raster.topology, "cull_mode": p.raster.cull},
            depth_stencil=depth,
            fragment=fragment,
        )

    def _layout(self, label: str, entries: tuple[tuple, ...]) -> Any:
        found = self._layouts.get(entries)
        if found is None:
            described = [{"binding": n, "visibility": v, kind: dict(values)} for n, v, kind, values in entries]
            try:
                found = self.gpu.create_bind_group_layout(label=label, entries=described)
            except (wgpu.GPUError, RuntimeError) as error:
                raise GiError(f"pass {label!r}: {reason(error)}") from error
            self._layouts[entries] = found
        return found

    def _entries(self, p: Pass, group: int) -> tuple[tuple, ...]:
        """Describe the bind group layout: (number, stages, kind, details) per binding, by number."""
        entries = []
        if group == 0:
            entries += [(b.number, _stages(p, b), "buffer", (("type", "uniform"),)) for b, _ in p.uniforms]
        else:
            entries += [_entry(p, u, u.binding) for u in p.uses if u.binding is not None]
            entries += [(b.number, _stages(p, b), "sampler", (("type", s.kind),)) for b, s in p.samplers]
            if p.params_binding is not None:
                b = p.params_binding
                entries.append((b.number, _stages(p, b), "buffer", (("type", "uniform"),)))
        return tuple(sorted(entries))


@contextmanager
def _mapping(threaded: bool) -> Iterator[Callable[..., Iterable[Any]]]:
    """Yield `map`, or its like that calls the function in several threads."""
    if not threaded:
        yield map
        return
    with ThreadPoolExecutor(min(os.cpu_count() or 1, MOST_THREADS)) as pool:
        yield pool.map


def _code(p: Pass) -> str:
    """Return the text of a pass' shader that is compiled: without the branches that its constants switch off."""
    known = {name: value for name, value in p.source.overrides.items() if value is not None} | p.constants
    return without_dead_branches(p.source.text, known)


def _key(p: Pass, groups: tuple[tuple, tuple]) -> tuple:
    """Return what determines the pipeline of a pass; `groups`: the entries of its bind group layouts."""
    key = (p.source.text, tuple(e.name for e in p.entries), tuple(sorted(p.constants.items())), groups)
    return (*key, _target_key(p.raster)) if p.raster else key


def _entry(p: Pass, use: Use, binding: Binding) -> tuple:
    stages = _stages(p, binding)
    if binding.space == "uniform":
        return binding.number, stages, "buffer", (("type", "uniform"),)
    if binding.space == "storage":
        kind = "read-only-storage" if binding.access == "read" else "storage"
        return binding.number, stages, "buffer", (("type", kind),)
    view = ("view_dimension", use.dimension)
    if binding.space == "storage_texture":
        access = {"write": "write-only", "read": "read-only", "read_write": "read-write"}[binding.access]
        return binding.number, stages, "storage_texture", (("access", access), ("format", _format(use)), view)
    return binding.number, stages, "texture", (("sample_type", use.sample_type), view)


def _stages(p: Pass, binding: Binding) -> int:
    """Return the stages that use a binding; all stages of the pass if none does."""
    using = [STAGES[e.stage] for e in p.entries if binding.name in e.uses] or [STAGES[e.stage] for e in p.entries]
    return sum(set(using))


def _format(use: Use) -> str:
    resource: Any = use.view.resource
    return str(resource.format.name)


def _target_key(raster: RasterState) -> tuple:
    return (
        tuple((location, _format(use)) for location, use in raster.targets),
        _format(raster.depth) if raster.depth else "",
        raster.topology,
        raster.cull,
        raster.depth_compare,
        raster.depth_write,
    )
