"""Compute shaders outside of a frame's graph: work on what frames share, such as building a hierarchy."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import wgpu
from numpy.typing import NDArray

from ..errors import GiError
from .device import Device
from .messages import compiler_message
from .wgsl.load import ShaderSource, load

GROUP = 1  # bind group of a shader's own variables

_pipelines: WeakKeyDictionary[Device, dict[tuple, tuple[Any, Any]]] = WeakKeyDictionary()


class Kernels:
    """Records dispatches of compute shaders, and runs them all at `submit`. Buffers are raw wgpu objects."""

    def __init__(self, device: Device) -> None:
        self.device = device
        self._known = _pipelines.setdefault(device, {})
        self._groups: dict[tuple, tuple[Any, Any]] = {}  # bind groups, and the buffers that their keys name by id
        self._encoder: Any = None
        self._compute: Any = None

    def dispatch(
        self,
        path: str,
        groups: int | Any,
        buffers: Mapping[str, Any],
        constants: Mapping[str, float] | None = None,
        params: NDArray[np.void] | None = None,
    ) -> None:
        """Record `groups` workgroups, or as many as a (buffer, offset in bytes) says; `buffers` by WGSL name.

        A value of `buffers` is a buffer, or (buffer, offset, size in bytes). Raises GiError if the
        shader does not compile.
        """
        source = load(path)
        pipeline, layout = self._pipeline(source, constants or {})
        bound = []
        for binding in _bindings(source):
            value = buffers[binding.name]
            bound.append((binding.number, *(value if isinstance(value, tuple) else (value, 0, value.size))))
        if self._compute is None:
            self._compute = self._begin().begin_compute_pass(label="kernels")
        self._compute.set_pipeline(pipeline)
        self._compute.set_bind_group(GROUP, self._group(path, layout, bound))
        if isinstance(groups, int):
            self._compute.dispatch_workgroups(groups)
        else:
            self._compute.dispatch_workgroups_indirect(*groups)

    def copy(self, source: Any, target: Any) -> None:
        """Record a copy of a whole buffer to the beginning of another."""
        self._begin().copy_buffer_to_buffer(source, 0, target, 0, source.size)

    def copy_rows(self, source: Any, texture: Any, first: int, width: int) -> None:
        """Record a copy of a buffer to whole rows of a texture, from row `first` on; texels have 16 bytes."""
        rows = source.size // (16 * width)
        self._begin().copy_buffer_to_texture(
            {"buffer": source, "bytes_per_row": 16 * width, "rows_per_image": rows},
            {"texture": texture, "origin": (0, first, 0)},
            (width, rows, 1),
        )

    def submit(self) -> None:
        """Run what was recorded."""
        if self._encoder is not None:
            encoder, self._encoder = self._begin(), None
            self.device.gpu.queue.submit([encoder.finish()])

    def forget(self) -> None:
        """Drop the bind groups, which keep their buffers alive."""
        self._groups.clear()

    def _begin(self) -> Any:
        """Return the command encoder, with no pass open."""
        if self._encoder is None:
            self._encoder = self.device.gpu.create_command_encoder(label="kernels")
        if self._compute is not None:
            self._compute.end()
            self._compute = None
        return self._encoder

    def _group(self, path: str, layout: Any, bound: list[tuple[int, Any, int, int]]) -> Any:
        """Return a bind group of (binding, buffer, offset, size)."""
        key = (path, *((number, id(buffer), offset, size) for number, buffer, offset, size in bound))
        if key not in self._groups:
            entries = [
                {"binding": number, "resource": {"buffer": buffer, "offset": offset, "size": size}}
                for number, buffer, offset, size in bound
            ]
            group = self.device.gpu.create_bind_group(label=path, layout=layout, entries=entries)
            self._groups[key] = group, bound
        return self._groups[key][0]

    def _pipeline(self, source: ShaderSource, constants: Mapping[str, float]) -> tuple[Any, Any]:
        key = (source, tuple(sorted(constants.items())))
        if key not in self._known:
            gpu = self.device.gpu
            try:
                module = gpu.create_shader_module(label=source.path, code=source.text)
                kinds = {"read": "read-only-storage", "read_write": "storage", "": "uniform"}
                entries = [
                    {
                        "binding": b.number,
                        "visibility": wgpu.ShaderStage.COMPUTE,
                        "buffer": {"type": "uniform" if b.space == "uniform" else kinds[b.access]},
                    }
                    for b in _bindings(source)
                ]
                empty = gpu.create_bind_group_layout(label=source.path, entries=[])
                own = gpu.create_bind_group_layout(label=source.path, entries=entries)
                layout = gpu.create_pipeline_layout(label=source.path, bind_group_layouts=[empty, own])
                stage = {"module": module, "entry_point": "main", "constants": dict(constants)}
                pipeline = gpu.create_compute_pipeline(label=source.path, layout=layout, compute=stage)
            except (wgpu.GPUError, RuntimeError) as error:
                raise GiError(f"{source.path}: {compiler_message(error, source)}") from error
            self._known[key] = (pipeline, own)
        return self._known[key]


def _bindings(source: ShaderSource) -> list[Any]:
    uses = source.entry_points["main"].uses
    return [b for b in source.bindings.values() if b.name in uses]


def round_up(count: int, size: int) -> int:
    """Return how many groups of `size` hold `count`."""
    return -(-count // size)
