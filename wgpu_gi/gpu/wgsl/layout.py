"""Memory layout of WGSL types (WGSL specification, section 14.4.1) as numpy dtypes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...errors import GiError
from .module import Member, Type

SCALARS = {"f32": "<f4", "i32": "<i4", "u32": "<u4", "f16": "<f2"}
SHORT = {"f": "f32", "i": "i32", "u": "u32", "h": "f16"}


@dataclass(frozen=True)
class Layout:
    """The memory layout of a type.

    `dtype` is padded to `size`; for a type with a runtime-sized array it is the part before that array. `element` is
    the layout of an element if the type is an array, or ends in a runtime-sized one (then `runtime` is true).
    """

    dtype: np.dtype
    align: int
    size: int
    element: Layout | None = None
    runtime: bool = False

    @property
    def stride(self) -> int:
        """The size of an element of an array of this type, with its padding."""
        return _round_up(self.size, self.align)


def layout_of(kind: Type, structs: dict[str, tuple[Member, ...]]) -> Layout:
    """Return the layout of a host-shareable type. Raises GiError for any other type.

    A column of a `matCx3` and an element of an `array<vec3...>` take four scalars, the last of them padding.
    """
    name, args = kind.name, kind.args
    if name in SCALARS:
        dtype = np.dtype(SCALARS[name])
        return Layout(dtype, dtype.itemsize, dtype.itemsize)
    if name == "atomic" and isinstance(args[0], Type):
        return layout_of(args[0], structs)
    if name == "array" and args and isinstance(args[0], Type):
        return _array(layout_of(args[0], structs), args[1] if len(args) > 1 else None)
    if name in structs:
        return _struct(name, structs)
    if name.startswith("vec") and name[3:4] in "234":
        return _vector(int(name[3]), _scalar(kind, name[4:]))
    if name.startswith("mat") and name[3:4] in "234" and name[5:6] in "234":
        columns, column = int(name[3]), _vector(int(name[5]), _scalar(kind, name[6:]))
        whole = np.dtype((column.dtype.base, (columns, column.stride // column.dtype.base.itemsize)))
        return Layout(whole, column.align, whole.itemsize)
    raise GiError(f"type {kind} cannot be shared with the GPU's host, or is declared nowhere")


def _scalar(kind: Type, suffix: str) -> np.dtype:
    argument = kind.args[0] if kind.args else None
    name = argument.name if isinstance(argument, Type) else SHORT.get(suffix, "")
    if name not in SCALARS:
        raise GiError(f"type {kind} cannot be shared with the GPU's host")
    return np.dtype(SCALARS[name])


def _vector(count: int, scalar: np.dtype) -> Layout:
    dtype = np.dtype((scalar, (count,)))
    return Layout(dtype, scalar.itemsize * (2 if count == 2 else 4), dtype.itemsize)


def _array(element: Layout, count: Type | int | None) -> Layout:
    padded = Layout(_padded(element), element.align, element.stride, element.element)
    if not isinstance(count, int):
        return Layout(np.dtype([]), element.align, 0, padded, runtime=True)
    dtype = np.dtype((padded.dtype, (count,)))
    return Layout(dtype, element.align, dtype.itemsize, padded)


def _padded(element: Layout) -> np.dtype:
    """Return the dtype of an array's element: only a vec3 is smaller than its stride."""
    if element.stride == element.dtype.itemsize:
        return element.dtype
    return np.dtype((element.dtype.base, (element.stride // element.dtype.base.itemsize,)))


def _struct(name: str, structs: dict[str, tuple[Member, ...]]) -> Layout:
    names, dtypes, offsets = [], [], []
    end, align, runtime = 0, 1, None
    for position, member in enumerate(structs[name]):
        inner = layout_of(member.type, structs)
        member_align = max(inner.align, member.align)
        align = max(align, member_align)
        end = _round_up(end, member_align)
        if inner.runtime:
            if position != len(structs[name]) - 1:
                raise GiError(f"struct {name}: only the last member may be a runtime-sized array, not {member.name!r}")
            runtime = inner.element
            break
        names.append(member.name)
        dtypes.append(inner.dtype)
        offsets.append(end)
        end += max(inner.size, member.size)
    size = end if runtime else _round_up(end, align)
    dtype = np.dtype({"names": names, "formats": dtypes, "offsets": offsets, "itemsize": size})
    return Layout(dtype, align, size, runtime, runtime is not None)


def _round_up(value: int, multiple: int) -> int:
    return -(-value // multiple) * multiple
