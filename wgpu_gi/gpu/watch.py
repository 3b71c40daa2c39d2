"""NaN watch: the first pass, resource, place and value that is NaN, infinite, or negative where nothing may be."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..errors import GiError
from .handles import Buffer, Resource, Texture, View
from .passes import Pass
from .transfer import read_back


def check_written(gpu: Any, p: Pass) -> None:
    """Read back all that a pass wrote. Raises GiError that names the first bad value."""
    for use in p.uses:
        resource = use.view.resource
        if not use.writes or not isinstance(resource, Texture | Buffer):
            continue
        if isinstance(resource, Texture) and not resource.format.is_float:
            continue
        for _, mip in use.view.slots():
            _check(p, resource, read_back(gpu, View(resource), mip), mip)


def _check(p: Pass, resource: Resource, data: np.ndarray, mip: int) -> None:
    for field, values in _floats(data, ""):
        finite = np.isfinite(values)
        bad = ~finite if not resource.nonnegative else ~finite | (values < 0)
        if not bad.any():
            continue
        at = tuple(int(i) for i in np.argwhere(bad)[0])
        value = values[at]
        place = _place(resource, at, mip)
        raise GiError(
            f"{p.where}: wrote {value} to {resource.name!r} at {place}{' field ' + field if field else ''} "
            f"({int(bad.sum())} of {bad.size} values are bad)"
        )


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
        return f"index {at[0]}{inner}"
    *layer, row, column, channel = at
    parts = [f"pixel ({column}, {row}), channel {channel}", *(f"layer {index}" for index in layer)]
    return ", ".join([*parts, f"mip level {mip}"] if mip else parts)
