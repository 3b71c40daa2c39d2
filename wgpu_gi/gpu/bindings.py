"""Checks shared uniforms, params, constants and dispatch size of a declaration against its shader; raises GiError."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from ..errors import GiError
from .checks import is_params, names_of
from .handles import Buffer, Resource, Texture, Uniform, View
from .passes import SPECIAL_PARAMS, Pass
from .wgsl.load import ShaderSource
from .wgsl.module import Binding, EntryPoint

Over = Texture | Buffer | View | int | tuple[int, ...]
MAX_GROUPS = 65535


def shared_uniforms(
    where: str,
    source: ShaderSource,
    used: dict[str, Binding],
    known: Mapping[str, Uniform],
    others: Mapping[str, str],
) -> list[tuple[Binding, Uniform]]:
    """Find the shared uniforms (group 0) that the shader uses; `others` renames variables: {"view": "view_second"}."""
    # Match names.
    wanted = {n: b for n, b in used.items() if b.group == 0}
    unknown = [n for n in others if n not in wanted]
    if unknown:
        raise GiError(
            f"{where}: uniforms names {names_of(unknown)}, but the shared uniforms it uses are {names_of(wanted)}"
        )
    found = []
    for variable, binding in wanted.items():
        name = others.get(variable, variable)
        if name not in known:
            raise GiError(f"{where}: there is no shared uniform {name!r}; available: {names_of(known)}")
        # Compare the fields and the size of the struct.
        layout, dtype = source.layout(binding.type), known[name].dtype
        names = layout.dtype.names
        if names and dtype.names and dict(layout.dtype.fields or {}) != dict(dtype.fields or {}):
            raise GiError(
                f"{where}: shared uniform {name!r} has the fields {_fields(dtype)}, "
                f"but {binding.type} here has {_fields(layout.dtype)}"
            )
        if layout.size != dtype.itemsize:
            raise GiError(
                f"{where}: shared uniform {name!r} has {dtype.itemsize} bytes, "
                f"but {binding.type} here has {layout.size}"
            )
        found.append((binding, known[name]))
    return found


def params_binding(where: str, used: Mapping[str, Binding], values: Mapping[str, Any]) -> Binding | None:
    """Return the binding of the uniform struct `params`; None if the entry points and `values` do not use it."""
    binding = next((b for b in used.values() if b.group == 1 and is_params(b)), None)
    if binding is None and values:
        raise GiError(f"{where}: params {names_of(values)} given, but its entry point uses no uniform `params`")
    return binding


def params_block(where: str, source: ShaderSource, binding: Binding, values: Mapping[str, Any]) -> np.ndarray:
    """Return the `params` struct, filled by field name; special fields stay zero."""
    dtype = source.layout(binding.type).dtype
    fields = [n for n in dtype.names or () if not n.startswith("_")]
    ours = [n for n in fields if n not in SPECIAL_PARAMS]
    for name in values:
        if name not in ours:
            raise GiError(f"{where}: there is no field {name!r} in params; available: {names_of(ours)}")
    missing = [n for n in ours if n not in values]
    if missing:
        raise GiError(f"{where}: params lacks {names_of(missing)}; {binding.type} has {names_of(ours)}")
    block = np.zeros((), dtype)
    for name, value in values.items():
        try:
            array = np.asarray(value)
            if array.dtype.kind == "f" and not np.isfinite(array).all():
                raise GiError(f"{where}: params {name} is {value}, which is not finite")
            if array.dtype.kind in "ui" and block[name].dtype.kind in "ui":
                limits = np.iinfo(block[name].dtype)
                if array.size and (array.min() < limits.min or array.max() > limits.max):
                    raise ValueError(f"it must lie between {limits.min} and {limits.max}")
            block[name] = value
        except (TypeError, ValueError) as error:
            raise GiError(f"{where}: params {name} cannot be {value!r}: {error}") from error
    return block


def override_values(
    where: str, source: ShaderSource, entries: Iterable[EntryPoint], given: Mapping[str, float | bool]
) -> dict[str, float]:
    """Check `constants` against the overrides of the shader; return them as floats."""
    for name, value in given.items():
        if name not in source.overrides:
            raise GiError(f"{where}: there is no override {name!r}; available: {names_of(source.overrides)}")
        if not np.isfinite(value):
            raise GiError(f"{where}: constant {name} is {value}, which is not finite")
    words = frozenset().union(*(e.uses for e in entries))
    lacking = [n for n in source.module.required_overrides if n in words and n not in given]
    if lacking:
        raise GiError(f"{where}: override {names_of(lacking)} has no default; give it in constants=")
    return {name: float(value) for name, value in given.items()}


def workgroup_size(
    where: str, source: ShaderSource, entry: EntryPoint, constants: Mapping[str, float]
) -> tuple[int, int, int]:
    """Return the workgroup size of a compute entry point with its overrides applied."""
    if not entry.workgroup_size:
        raise GiError(f"{where}: it has no @workgroup_size")
    sizes = []
    for size in entry.workgroup_size:
        value = constants.get(size, source.overrides.get(size)) if isinstance(size, str) else size
        if value is None:
            raise GiError(f"{where}: the workgroup size {size!r} is not a literal, constant or override with a literal")
        sizes.append(int(value))
    x, y, z = [*sizes, 1, 1, 1][:3]
    if min(x, y, z) < 1 or x * y * z > 256:
        raise GiError(f"{where}: a workgroup of {x} x {y} x {z} threads; WebGPU guarantees 1 to 256")
    return x, y, z


def workgroups(p: Pass, over: Over) -> tuple[int, int, int]:
    """Return the number of workgroups for `over`."""
    size = workgroup_size(p.where, p.source, p.entries[0], p.constants)
    threads = _threads(p.where, over)
    x, y, z = (-(-count // per_group) for count, per_group in zip(threads, size, strict=True))
    if (x > MAX_GROUPS and not p.split) or y > MAX_GROUPS or z > MAX_GROUPS:
        raise GiError(
            f"{p.where}: {x} x {y} x {z} workgroups; a dispatch has at most {MAX_GROUPS} a side: "
            "use split=True (along x), larger workgroups, or two dimensions"
        )
    return x, y, z


def _threads(where: str, over: Over) -> tuple[int, int, int]:
    view = View(over) if isinstance(over, Resource) else over
    if isinstance(view, View):
        resource = view.resource
        if isinstance(resource, Buffer):
            return resource.count, 1, 1
        if not isinstance(resource, Texture):
            raise GiError(f"{where}: over cannot be the shared resource {resource.name!r}; give a number of threads")
        layers = resource.layers if view.layer is None else 1
        return (*resource.mip_size(view.mip or 0), layers)
    counts = (view,) if isinstance(view, int | np.integer) else tuple(view)
    if not 1 <= len(counts) <= 3 or min(counts) < 0:
        raise GiError(f"{where}: over={over!r}; give one to three numbers of threads that are not negative")
    x, y, z = [*(int(c) for c in counts), 1, 1][:3]
    return x, y, z


def _fields(dtype: np.dtype) -> str:
    return ", ".join(f"{n}@{f[1]}" for n, f in (dtype.fields or {}).items())
