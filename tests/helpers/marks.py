"""Marks parameters of tests as slow, which the default suite leaves out."""

from collections.abc import Iterable
from typing import Any

import pytest


def slow_but(quick: tuple[Any, ...], values: Iterable[Any]) -> list[Any]:
    """Return parameters, all marked slow but the quick ones."""
    return [value if value in quick else pytest.param(value, marks=pytest.mark.slow) for value in values]
