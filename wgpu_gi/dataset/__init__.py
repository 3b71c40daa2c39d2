"""Labelled data from scenes: cameras, lights and objects drawn at random, and what each pixel shows."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .run import Made, make

__all__ = ["Made", "make"]


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}; it has: {', '.join(__all__)}")
    from . import run

    return getattr(run, name)
