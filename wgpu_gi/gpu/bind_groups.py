"""Bind groups and params buffers of passes: created at the first run, reused while the resources stay the same."""

from __future__ import annotations

from operator import attrgetter
from typing import Any

import wgpu

from ..errors import GiError
from .device import Device
from .handles import Buffer, Resource, Shared, Texture
from .messages import reason
from .passes import Pass, Use

# Per pass: 2^3, one for each state of three swapped histories. Any more belong to resources that are gone.
MOST_GROUPS = 8

_BOUND = attrgetter("bound")


def write_params(device: Device, p: Pass, first_workgroup: int) -> None:
    """Write the params struct, if there is one and its values differ from those on the GPU."""
    if p.params is None:
        return
    state = p.state
    values = (p.params_bytes, state.settle_index, first_workgroup) if p.special_params else (p.params_bytes,)
    if values == state.params_on_gpu:
        return
    block = p.params.copy()
    special = {"settle_index": state.settle_index, "first_workgroup": first_workgroup}
    for name in p.special_params:
        block[name] = special[name]
    if state.params_buffer is None:
        size = -(-block.nbytes // 16) * 16
        usage = wgpu.BufferUsage.UNIFORM | wgpu.BufferUsage.COPY_DST
        state.params_buffer = device.gpu.create_buffer(label=f"{p.name} params", size=size, usage=usage)
    device.gpu.queue.write_buffer(state.params_buffer, 0, block.tobytes())
    state.params_on_gpu = values


def bind_groups(device: Device, p: Pass) -> tuple[Any, Any]:
    """Return bind group 0, the shared uniforms (None without any), and bind group 1, all other bindings.

    Each new combination of wgpu objects creates them once.
    """
    key = tuple(map(_BOUND, p.resources))
    found = p.state.bind_groups.get(key)
    if found is not None:
        return found
    if len(p.state.bind_groups) >= MOST_GROUPS:
        p.state.bind_groups.clear()
    assert p.layouts is not None
    own = [{"binding": u.binding.number, "resource": bound_object(u)} for u in p.uses if u.binding is not None]
    own += [{"binding": b.number, "resource": s.gpu} for b, s in p.samplers]
    if p.params_binding is not None:
        own.append({"binding": p.params_binding.number, "resource": _whole(p.state.params_buffer)})
    try:
        groups = (
            _shared_group(device, p, p.layouts[0]),
            device.gpu.create_bind_group(label=p.name, layout=p.layouts[1], entries=own),
        )
    except (wgpu.GPUError, RuntimeError) as error:
        raise GiError(f"{p.where}: {reason(error)}") from error
    p.state.bind_groups[key] = groups
    return groups


def _shared_group(device: Device, p: Pass, layout: Any) -> Any:
    """Return bind group 0, the same object for all passes with the same uniforms; None for a pass without any."""
    if not p.uniforms:
        return None
    key = (layout, *((b.number, u) for b, u in p.uniforms))
    groups = p.uniforms[0][1].groups
    if key not in groups:
        entries = [{"binding": b.number, "resource": _whole(u.gpu)} for b, u in p.uniforms]
        groups[key] = device.gpu.create_bind_group(label="uniforms", layout=layout, entries=entries)
    return groups[key]


def bound_object(use: Use) -> Any:
    """Return the wgpu object of a use, as a bind group or an attachment takes it."""
    resource: Resource = use.view.resource
    if isinstance(resource, Buffer) or (isinstance(resource, Shared) and resource.is_buffer):
        return _whole(resource.object(use.view.previous))
    assert isinstance(resource, Texture | Shared)
    return resource.view(use.view, use.dimension or "2d")


def _whole(buffer: Any) -> dict[str, Any]:
    return {"buffer": buffer, "offset": 0, "size": buffer.size}
