"""Rules for the values of a dataclass: each tells whether a value is allowed, and in words what is allowed."""

from __future__ import annotations

import math
import reprlib
import sys
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

LONGEST = 80  # characters of a value in a message
_NUMBERS = (int, float, np.integer, np.floating)
_ARRAYS: dict[str, tuple[type, ...]] = {
    "numbers": (np.integer, np.floating),
    "integers": (np.integer,),
    "uint8 or uint16": (np.uint8, np.uint16),
}


class Rule(NamedTuple):
    """What a value must be: a test that raises nothing, and the end of a sentence that begins with "must be"."""

    allows: Callable[[Any], bool]
    words: str


def fault_of(owner: Any, rules: Mapping[str, Rule]) -> str | None:
    """Return "field must be ..., not ..." for the first wrong field of `owner`; None if all are right."""
    for name, (allows, words) in rules.items():
        value = getattr(owner, name)
        if not allows(value):
            return f"{name} must be {words}, not {shown(value)}"
    return None


def shown(value: Any) -> str:
    """Return a wrong value in a few words, on one line."""
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape} and type {value.dtype}"
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, (bool, int, float, str, tuple, list)):
        try:
            words = reprlib.repr(value).replace("\n", " ")
        except ValueError:  # Python refuses to write integers of thousands of digits
            words = "a number of thousands of digits"
        return words if len(words) <= LONGEST else f"{words[: LONGEST - 3]}..."
    return f"a {type(value).__name__}"


def is_number(value: Any) -> bool:
    """Tell whether a value is a real number of Python or numpy; True and False are none."""
    return isinstance(value, _NUMBERS) and not isinstance(value, bool)


def _exact(value: Any) -> float:
    """Return a number as one of Python, whose comparisons never overflow."""
    exact: float = value.item() if isinstance(value, np.generic) else value
    return exact


def is_whole(value: Any) -> bool:
    """Tell whether a value is an integer of Python or numpy."""
    return isinstance(value, (int, np.integer)) and not isinstance(value, bool)


def number(low: float = -math.inf, high: float = math.inf, unit: str = "") -> Rule:
    """Allow numbers from `low` to `high`, finite ones if a bound is infinite."""
    unit = f" {unit}" if unit else ""
    if math.isinf(low) and math.isinf(high):
        low, high, words = -sys.float_info.max, sys.float_info.max, f"a finite number{unit}"
    else:
        words = f"a number from {low:g} to {high:g}{unit}"
    return Rule(lambda v: is_number(v) and low <= _exact(v) <= high, words)


def vector(count: int, low: float = -math.inf, high: float = math.inf) -> Rule:
    """Allow tuples, lists and arrays of `count` numbers from `low` to `high`."""
    one = number(low, high)

    def allows(value: Any) -> bool:
        if isinstance(value, np.ndarray):
            value = value.tolist() if value.ndim == 1 else ()
        return isinstance(value, (tuple, list)) and len(value) == count and all(map(one.allows, value))

    return Rule(allows, f"{count} numbers{one.words.removeprefix('a number').replace('a finite number', ', finite')}")


def choice(*options: Any) -> Rule:
    """Allow the `options`, of the same type."""
    words = f"one of {', '.join(map(repr, options))}"
    return Rule(lambda v: type(v) is type(options[0]) and v in options, words)


def instance_of(*kinds: type) -> Rule:
    """Allow objects of some classes."""
    names = [kind.__name__ for kind in kinds]
    words = f"a {', '.join(names[:-1])}{' or ' * (len(names) > 1)}{names[-1]}"
    return Rule(lambda v: isinstance(v, kinds), words)


def optional(rule: Rule) -> Rule:
    """Allow None, too."""
    return Rule(lambda v: v is None or rule.allows(v), f"None or {rule.words}")


def items(*kinds: type) -> Rule:
    """Allow lists and tuples of objects of some classes."""

    def allows(value: Any) -> bool:
        # Most lists hold many objects of few classes.
        return isinstance(value, (list, tuple)) and all(issubclass(kind, kinds) for kind in set(map(type, value)))

    return Rule(allows, f"a list, each item {instance_of(*kinds).words}")


def array(types: str, *shape: int | None) -> Rule:
    """Allow numpy arrays of "numbers", "integers" or "uint8 or uint16" of a shape, where None is any length."""
    kinds = _ARRAYS[types]

    def allows(value: Any) -> bool:
        return (
            isinstance(value, np.ndarray)
            and issubclass(value.dtype.type, kinds)
            and value.ndim == len(shape)
            and all(length in (None, found) for length, found in zip(shape, value.shape, strict=True))
        )

    size = ", ".join("n" if length is None else str(length) for length in shape)
    return Rule(allows, f"a numpy array ({size}{',' * (len(shape) == 1)}) of {types}")


text = instance_of(str)._replace(words="a text")
flag = instance_of(bool, np.bool_)._replace(words="True or False")
