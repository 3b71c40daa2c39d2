"""Checks the color targets, depth target and index buffer of a raster pass against its shader; raises GiError."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import wgpu

from ..errors import GiError
from .checks import names_of
from .handles import Buffer, Shared, Texture, View, as_view
from .passes import Use
from .wgsl.module import EntryPoint


def color_targets(
    where: str, fragment: EntryPoint | None, color: Mapping[str, Texture | View]
) -> tuple[tuple[int, Use], ...]:
    """Match the color targets with the outputs of the fragment shader by name."""
    outputs = fragment.outputs if fragment is not None else {}
    if "" in outputs and len(color) == 1:  # a bare return value has no name
        outputs = {next(iter(color)): outputs[""]}
    unknown, missing = [n for n in color if n not in outputs], [n for n in outputs if n not in color]
    if unknown or missing:
        raise GiError(f"{where}: color targets {names_of(color)} given, but its outputs are {names_of(outputs)}")
    targets = []
    for name, handle in color.items():
        view = _target(f"{where}: {name!r}", handle, depth=False)
        targets.append((outputs[name], Use(name, view, "write", wgpu.TextureUsage.RENDER_ATTACHMENT)))
    return tuple(sorted(targets, key=lambda target: target[0]))


def depth_target(where: str, handle: Texture | View, write: bool) -> Use:
    """Return the use of a depth attachment."""
    view = _target(f"{where}: depth", handle, depth=True)
    return Use("depth", view, "write" if write else "read", wgpu.TextureUsage.RENDER_ATTACHMENT)


def index_buffer(where: str, handle: Any) -> Use:
    """Return the use of an index buffer of uint32."""
    view = as_view(handle, f"{where}: index")
    resource = view.resource
    if isinstance(resource, Texture) or (isinstance(resource, Shared) and not resource.is_buffer):
        raise GiError(f"{where}: index: {resource.name!r} is a texture; a buffer of uint32 is needed")
    if isinstance(resource, Buffer) and resource.dtype != "u4":
        raise GiError(f"{where}: index: {resource.name!r} has elements of {resource.dtype}; uint32 is needed")
    return Use("index", view, "read", wgpu.BufferUsage.INDEX)


def same_size(where: str, views: list[View]) -> None:
    """Raise GiError if attachments differ in size."""
    sizes = {v.resource.name: v.resource.mip_size(v.mip or 0) for v in views if isinstance(v.resource, Texture)}
    if len(set(sizes.values())) > 1:
        raise GiError(
            f"{where}: its targets differ in size: {', '.join(f'{n} {w}x{h}' for n, (w, h) in sizes.items())}"
        )


def _target(what: str, handle: Any, depth: bool) -> View:
    view = as_view(handle, what)
    resource = view.resource
    if not isinstance(resource, Texture | Shared) or (isinstance(resource, Shared) and resource.is_buffer):
        raise GiError(f"{what}: {resource.name!r} is a buffer, not a texture")
    if view.previous:
        raise GiError(f"{what}: previous contents cannot be written")
    if resource.format is not None and resource.format.is_depth != depth:
        wanted = "a depth format" if depth else "a color format"
        raise GiError(f"{what}: {resource.name!r} is {resource.format.name}; {wanted} is needed")
    if isinstance(resource, Texture) and view.mip is None:
        view = View(resource, False, 0, view.layer)
    return view
