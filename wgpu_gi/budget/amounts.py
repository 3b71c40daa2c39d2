"""The amounts of a budget: seconds, from a text with a unit or a number; an error, relMSE. Imports no slow module."""

from __future__ import annotations

import math
import re
from numbers import Real
from typing import Any

from ..errors import GiError

UNITS = {"ms": 1e-3, "s": 1.0, "min": 60.0, "h": 3600.0}
# The mean of 10^6 frames (`camera.frames` allows 65536, the path tracer 10^7 samples) divides the relative variance of
# a frame, 0.1 to 10 in measured scenes, by 10^6. The running mean in 32-bit floats adds at most 10^6 x 2^-24 of the
# value in the worst case, and sqrt(10^6) x 2^-24 = 6e-5 as rounding errors are random: a relMSE of 4e-9.
LEAST_ERROR = 1e-7

_AMOUNT = re.compile(r"\s*(?P<number>[^a-zA-Z\s]\S*?)\s*(?P<unit>[a-zA-Z]*)\s*")


def seconds_of(text: str) -> float | None:
    """Return the seconds of a text with a unit, such as 2s, 500ms, 1.5min or 1h; None for a number without a unit.

    Raises GiError for any other text, and for an amount that is not above 0 and finite.
    """
    match = _AMOUNT.fullmatch(text)
    unit = match["unit"] if match else ""
    try:
        number = float(match["number"] if match and unit in UNITS else text)
    except ValueError:
        units = ", ".join(UNITS)
        raise GiError(f"a time is a number, with a unit ({units}) for a budget, such as 2s, not {text!r}") from None
    if not match or not unit:
        return None
    return checked_seconds(number * UNITS[unit], text)


def checked_seconds(seconds: Any, text: str | None = None) -> float:
    """Return the seconds of a time budget, from `text`. Raises GiError unless they are above 0 and finite."""
    number = _number(seconds)
    if not 0.0 < number < math.inf:
        raise GiError(f"a time budget must be a finite number of seconds above 0, not {_shown(seconds, text)}")
    return number


def checked_error(error: Any, text: str | None = None) -> float:
    """Return the relMSE of an error budget. Raises GiError unless it is finite and within reach."""
    number = _number(error)
    if not 0.0 < number < math.inf:
        raise GiError(f"error must be a relMSE above 0, such as 0.01, not {_shown(error, text)}")
    if number < LEAST_ERROR:
        raise GiError(
            f"error {_shown(error, text)} is out of reach: a million frames of 32-bit floats leave about"
            f" {LEAST_ERROR:g}; ask for that or more"
        )
    return number


def _number(value: Any) -> float:
    """Return a value as a float; NaN if it is no number, or too large for a float."""
    try:
        return float(value) if isinstance(value, Real) and not isinstance(value, bool) else math.nan
    except OverflowError:
        return math.nan


def _shown(value: Any, text: str | None) -> str:
    from ..scene.rules import shown

    return shown(value) if text is None else repr(text)
