"""What can be read back and shown of a frame, by name."""

from __future__ import annotations

from dataclasses import dataclass

from .gpu.handles import Handle
from .options import TECHNIQUES, technique_of

# What every technique can show.
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
# What at least one technique can show.
BUFFERS = (*COMMON, *dict.fromkeys(name for technique in TECHNIQUES.values() for name in technique.extra))


def buffers_of(gi: str) -> tuple[str, ...]:
    """Return the names of what a technique can show."""
    return (*COMMON, *technique_of(gi).extra)


def views_of(gi: str) -> tuple[str, ...]:
    """Return the names of the debug views of a technique."""
    return (*technique_of(gi).views,)


@dataclass(frozen=True)
class Source:
    """Where a buffer lies: a handle with four values per pixel, and which of them; without a handle it is zero."""

    handle: Handle | None
    first: int = 0
    count: int = 3
