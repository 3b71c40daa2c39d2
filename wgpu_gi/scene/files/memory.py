"""The memory that one file may unpack to: loaders ask for it before they allocate, by sizes from headers."""

from __future__ import annotations

from ...errors import GiError

GIB = 1 << 30
MAX_MEMORY = 4 * GIB  # bytes by default: 64 textures of 4096 x 4096


class MemoryBudget:
    """The bytes that a file may unpack to in all, apart from its own size: pictures, arrays and copies of them."""

    def __init__(self, limit: int = MAX_MEMORY) -> None:
        self.limit = limit
        self._taken = 0

    def take(self, size: int, what: str) -> None:
        """Count `size` bytes that `what` unpacks to. Raises GiError if the file then exceeds the limit."""
        self._taken += size
        if self._taken > self.limit:
            raise GiError(
                f"{what}: it unpacks to {_text(size)}, and the file to more than the {_text(self.limit)} allowed; "
                "if that is right, raise --max-memory (gi.load: max_memory)"
            )


def _text(size: int) -> str:
    """Return a number of bytes with a unit."""
    return f"{size / GIB:.1f} GiB" if size >= GIB // 10 else f"{size / 2**20:.1f} MiB"
