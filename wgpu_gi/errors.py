"""The exception for errors that a user can fix (bad files, bad values, missing drivers), and hints for wrong names."""

from __future__ import annotations

import difflib
import warnings
from collections.abc import Iterable

FEW = 8  # the most names that a message lists in full


class GiError(Exception):
    """An error that a user can fix. Its message is one sentence: what is wrong, where (file, node, field), what to do.

    The command line prints the message without a traceback and exits with code 2.
    """


class LostDevice(GiError):
    """The driver has lost the device of a renderer; a new Renderer opens another."""


class DiskFull(GiError):
    """A file system has no space left for a file, or the user's quota is used up."""


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
