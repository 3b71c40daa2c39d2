"""Shards: the parts of a sequence; its blocks are dealt to them one after another, so that they take equally long."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple


class Shards(NamedTuple):
    """Some of `total` parts, by their numbers from 1."""

    parts: range
    total: int

    def hold(self, number: int) -> bool:
        """Tell whether block `number`, from 0, belongs to these parts."""
        return number % self.total + 1 in self.parts

    def numbers(self, count: int) -> Iterator[int]:
        """Yield those of the block numbers below `count` that belong to these parts."""
        return filter(self.hold, range(count))


ALL = Shards(range(1, 2), 1)
