"""The exception for errors that a user can fix (bad files, bad values, missing drivers), and hints for wrong names."""

from __future__ import annotations

import difflib
import warnings
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

FEW = 8  # the most names that a message lists in full


class GiError(Exception):
    """An error that a user can fix. Its message is one sentence: what is wrong, where (file, node, field), what to do.

    The command line prints the message without a traceback and exits with code 2.
    """


class GiWarning(UserWarning):
    """What the user should know about a scene or a picture: what was approximated, assumed, damaged or left out."""


def warn_of(notes: Iterable[str], stacklevel: int) -> None:
    """Emit a GiWarning for each note; `stacklevel` 2 is the line that calls the caller of this function."""
    for note in notes:
        warnings.warn(note, GiWarning, stacklevel=stacklevel + 1)


def known_names(name: str, known: Iterable[str]) -> str:
    """Return the end of a sentence about an unknown name: all known names if they are few, else the nearest three.

    If a known name has dots or slashes, its last part is compared as well.
    """
    names = list(known)
    if len(names) <= FEW:
        return f"available: {', '.join(names)}"

    def nearness(candidate: str) -> float:
        last = candidate.replace("/", ".").rpartition(".")[2]
        return max(difflib.SequenceMatcher(None, name, text).ratio() for text in (candidate, last))

    return f"did you mean {', '.join(sorted(names, key=nearness, reverse=True)[:3])}?"


def near_names(name: str, known: Iterable[str]) -> str:
    """Return the end of a sentence about a misspelt name: the nearest known one, or all names if none is near."""
    names = list(known)
    near = difflib.get_close_matches(name.lower().strip("_"), names, n=1)
    return f"did you mean {near[0]!r}?" if near else f"available: {', '.join(names)}"


class KnownAttributes:
    """Base of classes with slots: reading or setting a misspelt attribute raises AttributeError, with the near name."""

    __slots__ = ("__weakref__",)

    if not TYPE_CHECKING:  # a type checker would take these methods as a permission of any attribute

        def __setattr__(self, name: str, value: Any) -> None:
            try:
                object.__setattr__(self, name, value)
            except AttributeError:
                if hasattr(type(self), name):  # a property or a method
                    raise
                raise _unknown_attribute(self, name) from None

        def __getattr__(self, name: str) -> Any:
            found = getattr(type(self), name, None)
            if isinstance(found, property):
                return found.fget(self)  # the property failed: raise its own error again
            raise _unknown_attribute(self, name)


def _unknown_attribute(owner: object, name: str) -> AttributeError:
    kind = type(owner)
    known = [known for known in dir(kind) if not known.startswith("_")]
    article = "an" if kind.__name__[0] in "AEIOU" else "a"
    return AttributeError(f"{article} {kind.__name__} has no attribute {name!r}; {near_names(name, known)}")
