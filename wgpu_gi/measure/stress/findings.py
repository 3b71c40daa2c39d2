"""What a check finds: a verdict on one scene and technique, with a sentence, numbers and pictures."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.float64]
Verdict = Literal["passed", "failed", "skipped"]


@dataclass(frozen=True)
class Case:
    """One check of one technique on one scene; `seed` and `kind` give the scene and all random choices."""

    kind: str
    seed: int
    gi: str
    check: str
    quality: str = "medium"


@dataclass
class Finding:
    """The result of a check.

    failure: the class of a failure, for grouping. numbers: measured values by name. got, expected: the pictures of a
    failure. p: the probability of such a deviation by chance, if the check is statistical. compared: picture and truth
    of each layer that was measured.
    """

    verdict: Verdict
    failure: str = ""
    sentence: str = ""
    numbers: dict[str, float] = field(default_factory=dict)
    got: Picture | None = None
    expected: Picture | None = None
    p: float | None = None
    compared: dict[str, tuple[Picture, Picture]] = field(default_factory=dict)


PASSED = Finding("passed")


def skipped(reason: str) -> Finding:
    """Return the finding of a check that does not apply to a scene."""
    return Finding("skipped", sentence=reason)


def failed(failure: str, sentence: str, got: Picture | None = None, expected: Picture | None = None) -> Finding:
    """Return a failure of class `failure`."""
    return Finding("failed", failure, sentence, got=got, expected=expected)
