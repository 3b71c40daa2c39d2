"""NaN watch: names the first pass, resource and pixel with a NaN, infinite, out-of-range or wrongly negative value."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..errors import GiError
from .formats import float_end
from .handles import Buffer, Resource, Texture, View
from .passes import Pass
from .transfer import read_back


def check_written(gpu: Any, p: Pass) -> None:
    """Read back all that a pass wrote. Raises GiError that names the first bad value.

    Bad values are NaN, infinity, the largest value of a float format narrower than 32 bits (an overflow may saturate
    there instead of becoming infinite), and negative values in a resource declared `nonnegative`. Integers and shared
    resources are not checked.
    """
    for view in dict.fromkeys(View(u.view.resource, mip=u.view.mip) for u in p.uses if u.writes):
        resource = view.resource
        if isinstance(resource, Buffer):
            _check(p, resource, read_back(gpu, view, 0), 0)
        elif isinstance(resource, Texture) and resource.format.is_float:
            for _, mip in view.slots():
                _check(p, resource, resource.format.floats(read_back(gpu, view, mip)), mip)


def _check(p: Pass, resource: Buffer | Texture, data: np.ndarray, mip: int) -> None:
    for field, values in _floats(data, ""):
        name, end = _range(resource, values.dtype)
        with np.errstate(invalid="ignore"):  # comparisons with NaN, which are false
            bad = ~(np.abs(values) < end)
            if resource.nonnegative:
                bad |= values < 0
        if not bad.any():
            continue
        at = tuple(int(i) for i in np.argwhere(bad)[0])
        value = values[at]
        saturated = np.isfinite(value) and abs(value) >= np.broadcast_to(end, values.shape)[at]
        raise GiError(
            f"{p.where}: wrote {value}{f' (where the range of {name} ends)' if saturated else ''} "
            f"to {resource.name!r} at {_place(resource, at, mip)}{' field ' + field if field else ''} "
            f"({int(bad.sum())} of {bad.size} values are bad)"
        )


def _range(resource: Buffer | Texture, dtype: np.dtype) -> tuple[str, Any]:
    """Return the name of a float format and the magnitude at which its range ends."""
    if isinstance(resource, Texture):
        return resource.format.name, resource.format.end
    return str(dtype), float_end(dtype)


def _floats(data: np.ndarray, name: str) -> Iterator[tuple[str, np.ndarray]]:
    """Yield (field, values) for all floats in an array, structured or not."""
    if data.dtype.names:
        for field in data.dtype.names:
            yield from _floats(data[field], f"{name}.{field}" if name else field)
    elif data.dtype.kind == "f":
        yield name, data


def _place(resource: Resource, at: tuple[int, ...], mip: int) -> str:
    if isinstance(resource, Buffer):
        inner = f", component {', '.join(map(str, at[1:]))}" if len(at) > 1 else ""
        if resource.width:
            return f"pixel ({at[0] % resource.width}, {at[0] // resource.width}){inner}"
        return f"index {at[0]}{inner}"
    *layer, row, column, channel = at
    parts = [f"pixel ({column}, {row}), channel {channel}", *(f"layer {index}" for index in layer)]
    return ", ".join([*parts, f"mip level {mip}"] if mip else parts)
