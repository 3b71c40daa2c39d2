"""The memory of this process, for tests against leaks."""

from __future__ import annotations

import pytest


def resident() -> float:
    """Return the resident memory of this process, MiB."""
    try:
        with open("/proc/self/statm") as file:
            return int(file.read().split()[1]) * 4096 / 2**20
    except OSError:
        pytest.skip("no /proc to read memory from")
