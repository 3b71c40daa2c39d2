"""Matches the resources of a declaration with the bindings of its shader by name.

A mismatch raises GiError with the names of the pass and the shader file.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import wgpu

from ..errors import GiError
from .handles import VIEW_DIMENSIONS, Buffer, Sampler, Shared, Texture, View, as_view
from .passes import Use
from .wgsl.load import ShaderSource
from .wgsl.module import Binding, EntryPoint, Type

KINDS = {
    "uniform": "a uniform buffer",
    "storage": "a storage buffer",
    "texture": "a texture",
    "storage_texture": "a storage texture",
    "sampler": "a sampler",
}
USAGES = {
    "uniform": wgpu.BufferUsage.UNIFORM,
    "storage": wgpu.BufferUsage.STORAGE,
    "texture": wgpu.TextureUsage.TEXTURE_BINDING,
    "storage_texture": wgpu.TextureUsage.STORAGE_BINDING,
}
# The limits per stage that WebGPU guarantees (specification, section 3.6.2).
MOST_BINDINGS = {
    "storage": (8, "storage buffers"),
    "storage_texture": (4, "storage textures"),
    "texture": (16, "sampled textures"),
}


def entry_point(where: str, source: ShaderSource, stage: str, name: str | None) -> EntryPoint | None:
    """Return the entry point `name` of a stage. Without a name, return the only one, or None if there is none."""
    found = {e.name: e for e in source.entry_points.values() if e.stage == stage}
    if name is None:
        if len(found) > 1:
            raise GiError(f"{where}: it has several {stage} entry points, {names_of(found)}; say which with entry=")
        return next(iter(found.values()), None)
    if name not in found:
        raise GiError(f"{where}: there is no {stage} entry point {name!r}; available: {names_of(found)}")
    return found[name]


def raster_entries(
    where: str, source: ShaderSource, names: tuple[str, str] | None, has_color: bool
) -> tuple[EntryPoint, ...]:
    """Return the vertex entry point, and the fragment entry point if there is one; color targets need one."""
    vertex = entry_point(where, source, "vertex", names[0] if names else None)
    fragment = entry_point(where, source, "fragment", names[1] if names else None)
    if vertex is None:
        raise GiError(f"{where}: it has no vertex entry point")
    if has_color and fragment is None:
        raise GiError(f"{where}: it has no fragment entry point, but color targets are given")
    return (vertex,) if fragment is None else (vertex, fragment)


def bindings_used(where: str, source: ShaderSource, entries: Iterable[EntryPoint]) -> dict[str, Binding]:
    """Return the bindings that the entry points reach."""
    words = frozenset().union(*(e.uses for e in entries))
    used = {name: b for name, b in source.bindings.items() if name in words}
    for binding in used.values():
        if binding.group > 1:
            at = source.where(binding.line)
            raise GiError(
                f"{where}: {at}: {binding.name!r} is in group {binding.group}; only 0 (shared) and 1 are used"
            )
    numbers: dict[tuple[int, int], str] = {}
    for b in used.values():
        other = numbers.setdefault((b.group, b.number), b.name)
        if other != b.name:
            at = source.where(b.line)
            raise GiError(f"{where}: {at}: {b.name!r} and {other!r} have the same group and binding number")
    return used


def resource_uses(
    where: str,
    source: ShaderSource,
    used: dict[str, Binding],
    reads: Mapping[str, Any],
    writes: Mapping[str, Any],
    filters_float32: bool,
) -> tuple[list[Use], list[tuple[Binding, Sampler]]]:
    """Match `reads` and `writes` with the bindings of group 1 by name; return resources and samplers.

    `filters_float32` tells whether the device can filter 32-bit float textures.
    """
    uses: list[Use] = []
    samplers: list[tuple[Binding, Sampler]] = []
    wanted = {n: b for n, b in used.items() if b.group == 1 and not is_params(b)}
    # Match the given resources with the bindings.
    both = [name for name in reads if name in writes]
    if both:
        raise GiError(f"{where}: {names_of(both)} is in reads and in writes; a read_write binding goes in writes")
    for access, given in (("read", reads), ("write", writes)):
        for name, handle in given.items():
            binding = source.bindings.get(name)
            if binding is None or binding.group != 1 or is_params(binding):
                hint = " (group 0: set it with set_uniform)" if binding is not None and binding.group == 0 else ""
                raise GiError(f"{where}: {name!r} is not a binding{hint}; available: {names_of(wanted)}")
            # A resource that the entry points do not use is not bound and cannot make the pass stale.
            if access == "read" and name not in used:
                continue
            if binding.space == "sampler":
                samplers.append((binding, _sampler(where, binding, handle)))
            else:
                uses.append(_use(where, source, binding, handle, access, filters_float32))
    # Every binding needs a resource.
    missing = {n: b for n, b in wanted.items() if n not in reads and n not in writes}
    if missing:
        raise GiError(
            f"{where}: nothing is given for {', '.join(f'{n!r} ({KINDS[b.space]})' for n, b in missing.items())}"
        )
    return uses, samplers


def check_counts(where: str, entries: Iterable[EntryPoint], uses: Iterable[Use]) -> None:
    """Raise GiError if a stage binds more than WebGPU guarantees."""
    uses = list(uses)
    for entry in entries:
        spaces = [u.binding.space for u in uses if u.binding is not None and u.name in entry.uses]
        for space, (most, what) in MOST_BINDINGS.items():
            if spaces.count(space) > most:
                raise GiError(
                    f"{where}: its {entry.stage} stage binds {spaces.count(space)} {what}; WebGPU guarantees {most}"
                )


def check_hazards(where: str, uses: Iterable[Use]) -> None:
    """Raise GiError if the same contents are bound twice and written at least once."""
    owner: dict[tuple, Use] = {}
    uses = list(uses)
    for use in sorted(uses, key=lambda u: not u.writes):
        for slot in use.view.slots():
            key = (slot, use.view.previous)
            other = owner.get(key)
            if other is not None and other.writes:
                how = "written twice" if use.writes else "read and written in one pass"
                raise GiError(
                    f"{where}: {str(use.view)!r} is {how}, as {use.name!r} and {other.name!r}; "
                    "use one read_write binding, or history=True and .previous"
                )
            owner[key] = use


def check_sampling(
    where: str, source: ShaderSource, uses: Iterable[Use], samplers: Iterable[tuple[Binding, Sampler]]
) -> None:
    """Raise GiError if the shader uses a filtering sampler on a texture that cannot be filtered."""
    kinds = {binding.name: sampler.kind for binding, sampler in samplers}
    types = {use.name: use.sample_type for use in uses}
    for texture, sampler in sorted(source.module.sampled):
        if kinds.get(sampler) == "filtering" and types.get(texture) == "unfilterable-float":
            raise GiError(
                f"{where}: {texture!r} has a format that cannot be filtered, but {sampler!r} filters; "
                "use a nearest sampler, textureLoad, or a 16-bit format"
            )


def _use(where: str, source: ShaderSource, binding: Binding, handle: Any, access: str, filters_float32: bool) -> Use:
    what = f"{where}: {binding.name!r}"
    view = as_view(handle, what)
    writable = binding.access in ("write", "read_write")
    if access == "write" and not writable:
        raise GiError(f"{what} is read-only in the shader, but is given in writes")
    if access == "read" and writable:
        raise GiError(f"{what} is {binding.access} in the shader, but is given in reads; give it in writes")
    if access == "write" and view.previous:
        raise GiError(f"{what}: previous contents cannot be written")
    usage = USAGES[binding.space]
    if binding.space in ("uniform", "storage"):
        _check_buffer(what, source, binding, view)
        return Use(binding.name, view, access, usage, binding)
    dimension = VIEW_DIMENSIONS.get(_dimension(binding.type), "")
    if not dimension:
        raise GiError(f"{what}: {binding.type} is not supported")
    sample_type = _check_texture(what, binding, view, dimension, filters_float32)
    if binding.space == "storage_texture" and view.mip is None:
        view = View(view.resource, view.previous, 0, view.layer)
    return Use(binding.name, view, access, usage, binding, dimension, sample_type)


def _check_buffer(what: str, source: ShaderSource, binding: Binding, view: View) -> None:
    resource = view.resource
    layout = source.layout(binding.type)
    least = layout.size + (layout.element.stride if layout.runtime and layout.element else 0)
    if isinstance(resource, Shared) and resource.is_buffer:
        size = resource.gpu[0].size
    elif isinstance(resource, Buffer):
        size = resource.size_bytes
        element, has = layout.element, resource.dtype.itemsize
        if binding.type.name == "array" and element is not None and element.stride != has:
            raise GiError(
                f"{what}: buffer {resource.name!r} has elements of {has} bytes, "
                f"but those of {binding.type} take {element.stride}"
            )
    else:
        raise GiError(f"{what} is {KINDS[binding.space]}, but {resource.name!r} is a texture")
    if size < least:
        raise GiError(f"{what}: buffer {resource.name!r} has {size} bytes, but {binding.type} needs {least}")


def _check_texture(what: str, binding: Binding, view: View, dimension: str, filters_float32: bool) -> str:
    """Check format and shape; return the sample type for the bind group layout."""
    resource = view.resource
    if isinstance(resource, Buffer) or (isinstance(resource, Shared) and resource.is_buffer):
        raise GiError(f"{what} is {KINDS[binding.space]}, but {resource.name!r} is a buffer")
    assert isinstance(resource, Texture | Shared)
    if isinstance(resource, Texture):
        _check_shape(what, binding, view, resource, dimension)
    if resource.format is None:
        return "float"
    if binding.space == "storage_texture":
        wanted = str(binding.type.args[0])
        if wanted != resource.format.name:
            raise GiError(f"{what} is {binding.type}, but {resource.name!r} is {resource.format.name}")
        if not resource.format.storage:
            raise GiError(f"{what}: {wanted} cannot be a storage texture in WebGPU; use r32float, rgba16float ...")
        return ""
    kind = resource.format.kind
    if binding.type.name.startswith("texture_depth"):
        if kind != "depth":
            raise GiError(f"{what} is {binding.type}, but {resource.name!r} is {resource.format.name}")
        return "depth"
    fits = {"f32": ("float", "unfilterable", "depth"), "u32": ("uint",), "i32": ("sint",)}[str(binding.type.args[0])]
    if kind not in fits:
        raise GiError(f"{what} is {binding.type}, but {resource.name!r} is {resource.format.name}")
    if kind == "depth" or (kind == "unfilterable" and not filters_float32):
        return "unfilterable-float"
    return "float" if kind == "unfilterable" else kind


def _check_shape(what: str, binding: Binding, view: View, texture: Texture, dimension: str) -> None:
    layers = 1 if view.layer is not None else texture.layers
    needs = {"2d": layers == 1, "cube": layers == 6, "cube-array": layers % 6 == 0}.get(dimension, True)
    if not needs or (dimension == "3d") != (texture.dimension == "3d"):
        raise GiError(
            f"{what} is {binding.type}, but {texture.name!r} is a {texture.dimension} texture of {layers} layers"
        )


def _sampler(where: str, binding: Binding, handle: Any) -> Sampler:
    if not isinstance(handle, Sampler):
        raise GiError(f"{where}: {binding.name!r} is a sampler, but {handle!r} is given; use Graph.sampler")
    if (binding.type.name == "sampler_comparison") != (handle.kind == "comparison"):
        raise GiError(f"{where}: {binding.name!r} is {binding.type}, but the sampler given is {handle.kind}")
    return handle


def is_params(binding: Binding) -> bool:
    """Tell whether a binding is the `params` struct."""
    return binding.space == "uniform" and binding.name == "params"


def _dimension(kind: Type) -> str:
    """Return "2d_array" of `texture_storage_2d_array<...>`."""
    return kind.name.removeprefix("texture_").removeprefix("depth_").removeprefix("storage_")


def names_of(names: Iterable[str]) -> str:
    """Return names separated by commas, or "none"."""
    return ", ".join(names) or "none"
