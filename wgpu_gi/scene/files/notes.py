"""Collects what the user should know about a loaded file: what was approximated, and what was damaged."""

from __future__ import annotations

from ...errors import GiError


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
        """All sentences."""
        return list(self._sentences)
