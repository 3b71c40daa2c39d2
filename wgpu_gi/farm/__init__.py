"""Frames by many processes and machines: Dask workers render the blocks of a sequence (extra `farm`)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .api import render
    from .run import FarmResult

__all__ = ["FarmResult", "render"]


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}; it has: {', '.join(__all__)}")
    from . import api

    return getattr(api, name)
