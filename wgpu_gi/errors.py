"""The exception for errors that a user can fix (bad files, bad values, missing drivers), and hints for wrong names."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

FEW = 8  # the most names that a message lists in full


class GiError(Exception):
    """An error that a user can fix. Its message is one sentence: what is wrong, where (file, node, field), what to do.

    The command line prints the message without a traceback and exits with code 2.
    """


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
