"""Creates and caches pipelines. A shader that does not compile raises GiError with file and line."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any
from weakref import WeakKeyDictionary, WeakValueDictionary

import wgpu

from ..errors import GiError
from .messages import compiler_message, reason
from .passes import Pass, RasterState, Use
from .wgsl.load import ShaderSource
from .wgsl.module import Binding

STAGES = {
    "compute": wgpu.ShaderStage.COMPUTE,
    "vertex": wgpu.ShaderStage.VERTEX,
    "fragment": wgpu.ShaderStage.FRAGMENT,
}


KEPT = 64  # unused pipelines: as many as the largest technique has, so that switching back to it compiles none


class Pipelines:
    """All shader modules, bind group layouts and pipelines of a device, for all its graphs.

    A pipeline lives while a pass uses it, or while it is among the last `KEPT` that were retired. A shader module lives
    as long as its source.
    """

    def __init__(self, gpu: Any) -> None:
        self.gpu = gpu
        self._modules: WeakKeyDictionary[ShaderSource, Any] = WeakKeyDictionary()
        self._layouts: dict[tuple, Any] = {}
        self._pipelines: WeakValueDictionary[tuple, Any] = WeakValueDictionary()
        self._retired: dict[Any, None] = {}  # longest unused first

    def of(self, p: Pass) -> tuple[Any, tuple[Any, Any]]:
        """Return the pipeline of a pass, and the layouts of its bind groups 0 (shared uniforms) and 1.

        Raises GiError with file and line if the shader does not compile.
        """
        groups = (self._entries(p, 0), self._entries(p, 1))
        key = (p.source.text, tuple(e.name for e in p.entries), tuple(sorted(p.constants.items())), groups)
        key += (_target_key(p.raster),) if p.raster else ()
        layouts = (self._layout(p.name, groups[0]), self._layout(p.name, groups[1]))
        found = self._pipelines.get(key)
        if found is None:
            module = self._module(p)
            try:
                layout = self.gpu.create_pipeline_layout(label=p.name, bind_group_layouts=list(layouts))
                found = self._raster(p, module, layout) if p.raster else self._compute(p, module, layout)
            except (wgpu.GPUError, RuntimeError) as error:
                raise GiError(f"{p.where}: {compiler_message(error, p.source)}") from error
            self._pipelines[key] = found
        self._retired.pop(found, None)
        return found, layouts

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

    def _module(self, p: Pass) -> Any:
        found = self._modules.get(p.source)
        if found is None:
            try:
                found = self.gpu.create_shader_module(label=p.source.path, code=p.source.text)
            except (wgpu.GPUError, RuntimeError) as error:
                raise GiError(f"{p.where}: {compiler_message(error, p.source)}") from error
            self._modules[p.source] = found
        return found

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
