"""The names of the buffers and debug views of each technique."""

from __future__ import annotations

from dataclasses import dataclass

from .gpu.handles import Handle
from .options import TECHNIQUES, technique_of

# Buffers of every technique.
COMMON = (
    "radiance",
    "direct",
    "indirect",
    "emission",
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


@dataclass(frozen=True)
class Source:
    """Locates a buffer: `count` of the four values per pixel of `handle`, from `first`. Without a handle it is zero."""

    handle: Handle | None
    first: int = 0
    count: int = 3
