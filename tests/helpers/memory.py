"""How much memory this process takes, for tests of growth."""

from __future__ import annotations

import pytest


def resident() -> float:
    """Return MiB of this process in memory."""
    try:
        with open("/proc/self/statm") as file:
            return int(file.read().split()[1]) * 4096 / 2**20
    except OSError:
        pytest.skip("no /proc to read memory from")
