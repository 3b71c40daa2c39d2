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
        self._is_damage: dict[str, bool] = {}  # of each sentence

    def add(self, sentence: str) -> None:
        """Add a sentence on a valid file: what was approximated, assumed, changed or left out."""
        self._is_damage.setdefault(sentence, False)

    def damage(self, sentence: str) -> None:
        """Add a sentence on a damaged part, which was left out or repaired. Raises GiError if strict."""
        if self.strict:
            raise GiError(f"{sentence.rstrip('.')} (--strict, gi.load(strict=True): damage is refused)")
        self._is_damage[sentence] = True

    @property
    def sentences(self) -> list[str]:
        """All sentences; of many that differ in names and numbers only, the first three, and how many there are."""
        return _shortened(list(self._is_damage))

    @property
    def damages(self) -> list[str]:
        """The sentences on damaged parts, shortened in the same way as `sentences`."""
        return _shortened([sentence for sentence, is_damage in self._is_damage.items() if is_damage])


def _shortened(sentences: list[str]) -> list[str]:
    """Return sentences with those of one kind together, and many of one kind shortened."""
    kinds: dict[str, list[str]] = {}
    for sentence in sentences:
        kinds.setdefault(_NAMES_AND_NUMBERS.sub("", sentence), []).append(sentence)
    return [sentence for similar in kinds.values() for sentence in _some(similar)]


def _some(similar: list[str]) -> list[str]:
    """Return all sentences if they are few; else the first ones, the last of them with the number of the others."""
    more = len(similar) - _LISTED
    if more <= 1:
        return similar
    return [*similar[: _LISTED - 1], f"{similar[_LISTED - 1].rstrip('.')} (and {more} more such notes)"]
