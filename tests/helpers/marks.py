"""Which of a test's parameters the default suite takes."""

from collections.abc import Iterable
from typing import Any

import pytest


def slow_but(quick: tuple[Any, ...], values: Iterable[Any]) -> list[Any]:
    """Return parameters of which all but the quick ones are marked slow."""
    return [value if value in quick else pytest.param(value, marks=pytest.mark.slow) for value in values]
