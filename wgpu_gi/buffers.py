"""The names of the buffers and debug views of each technique."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from .errors import GiError, near_names
from .gpu.handles import Handle
from .options import TECHNIQUES, technique_of
from .scene.rules import shown

# Buffers of every technique.
COMMON = (
    "radiance",
    "direct",
    "indirect",
    "emission",
    "standard_error",
    "alpha",
    "albedo",
    "normal",
    "depth",
    "position",
    "instance",
)
# Buffers of at least one technique.
BUFFERS = (*COMMON, *dict.fromkeys(name for technique in TECHNIQUES.values() for name in technique.extra))


def buffers_of(gi: str) -> tuple[str, ...]:
    """Return the names of the buffers of a technique."""
    return (*COMMON, *technique_of(gi).extra)


def views_of(gi: str) -> tuple[str, ...]:
    """Return the names of the debug views of a technique."""
    return (*technique_of(gi).views,)


def check_buffers(names: Any, gi: str) -> None:
    """Raise GiError unless `names` is a tuple or list of names of buffers or views of a technique, or "display"."""
    if not isinstance(names, (tuple, list)) or not names:
        raise GiError(f"show must be the name of a buffer, or a tuple of names, not {shown(names)}")
    known = (*buffers_of(gi), *views_of(gi), "display")
    for name in names:
        if name not in known:
            near = near_names(name, buffers_of(gi)) if isinstance(name, str) else f"available: {', '.join(known)}"
            raise GiError(f"the technique {gi} has no buffer {shown(name)}; {near}")


@dataclass(frozen=True)
class Source:
    """Locates a buffer: `count` of the four values per pixel of `handle`, from `first`. Without a handle it is zero."""

    handle: Handle | None
    first: int = 0
    count: int = 3
