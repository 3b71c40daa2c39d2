"""Collects what the user should know about a loaded file: what was approximated, and what was damaged."""

from __future__ import annotations

import re

from ...errors import GiError

_LISTED = 3  # sentences of one kind that are listed in full
_NAMES_AND_NUMBERS = re.compile(r"'[^']*'|\d+")


class Notes:
    """Sentences about one load, in order, each once; `strict` turns notes of damage into errors."""

    def __init__(self, strict: bool = False) -> None:
        self.strict = strict
        self._sentences: dict[str, None] = {}  # an ordered set

    def add(self, sentence: str) -> None:
        """Add a sentence on a valid file: what was approximated, assumed, changed or left out."""
        self._sentences[sentence] = None

    def damage(self, sentence: str) -> None:
        """Add a sentence on a damaged part, which was left out or repaired. Raises GiError if strict."""
        if self.strict:
            raise GiError(f"{sentence.rstrip('.')} (--strict, gi.load(strict=True): damage is refused)")
        self.add(sentence)

    @property
    def sentences(self) -> list[str]:
        """All sentences; of many that differ in names and numbers only, the first three, and how many there are."""
        kinds: dict[str, list[str]] = {}
        for sentence in self._sentences:
            kinds.setdefault(_NAMES_AND_NUMBERS.sub("", sentence), []).append(sentence)
        return [sentence for similar in kinds.values() for sentence in _some(similar)]


def _some(similar: list[str]) -> list[str]:
    """Return all sentences if they are few; else the first ones, the last of them with the number of the others."""
    more = len(similar) - _LISTED
    if more <= 1:
        return similar
    return [*similar[: _LISTED - 1], f"{similar[_LISTED - 1].rstrip('.')} (and {more} more such notes)"]
