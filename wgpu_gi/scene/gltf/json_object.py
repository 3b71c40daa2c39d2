"""Typed access to the JSON of a glTF file: a wrong type or value raises an error with its place in the file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, TypeVar

from ...errors import GiError

T = TypeVar("T")

# Larger integers are not exact in every JSON reader, and no real file has such a count or offset.
_MAX_INTEGER = 1 << 53


class JsonObject:
    """A JSON object; `where` is its place in the file.

    The getters return a checked value, or the default if the key is absent; without a default an absent key is an
    error. All of them raise GiError.
    """

    def __init__(self, value: Any, where: str) -> None:
        if not isinstance(value, dict):
            raise GiError(f"{where} must be a JSON object, not {_kind(value)}")
        self.raw: dict[str, Any] = value
        self.where = where

    def __contains__(self, key: str) -> bool:
        return key in self.raw

    def error(self, problem: str) -> GiError:
        """Return a GiError that reports a problem of this object."""
        return GiError(f"{self.where}: {problem}")

    def _get(self, key: str, default: Any, expected: str) -> Any:
        if key in self.raw:
            return self.raw[key]
        if default is None:
            raise self.error(f"{key} is missing ({expected}); the file is damaged")
        return default

    def number(self, key: str, default: float | None = None, low: float = -math.inf, high: float = math.inf) -> float:
        """Return a finite number within [low, high]."""
        value = self._get(key, default, "a number")
        number = _finite(value)
        if number is None or not low <= number <= high:
            raise self.error(f"{key} must be a finite number{_range(low, high)}, not {_kind(value)}")
        return number

    def integer(self, key: str, default: int | None = None, low: int = 0, high: int = _MAX_INTEGER) -> int:
        """Return an integer within [low, high]; 3.0 counts as 3."""
        value = self._get(key, default, "an integer")
        number = _finite(value)
        if number is None or number != math.floor(number) or not low <= number <= high:
            raise self.error(f"{key} must be an integer{_range(low, high)}, not {_kind(value)}")
        return int(value)

    def index(self, key: str, count: int, array: str) -> int:
        """Return an index into the file's `array`, which has `count` elements."""
        return self._checked_index(self._get(key, None, f"an index into {array}"), key, count, array)

    def indices(self, key: str, count: int, array: str) -> list[int]:
        """Return a list of indices into `array`; an absent key is an empty list."""
        values = self.values(key)
        return [self._checked_index(value, f"{key}[{i}]", count, array) for i, value in enumerate(values)]

    def _checked_index(self, value: Any, label: str, count: int, array: str) -> int:
        number = _finite(value)
        if number is None or number != math.floor(number) or not 0 <= number < count:
            raise self.error(f"{label} must be an index into {array} (there are {count}), not {_kind(value)}")
        return int(value)

    def vector(
        self, key: str, default: tuple[float, ...], low: float = -math.inf, high: float = math.inf
    ) -> tuple[float, ...]:
        """Return finite numbers within [low, high]; `default` sets their count."""
        values = self.raw.get(key, default)
        numbers = [_finite(v) for v in values] if isinstance(values, list | tuple) else []
        if len(numbers) != len(default) or not all(n is not None and low <= n <= high for n in numbers):
            raise self.error(f"{key} must be {len(default)} finite numbers{_range(low, high)}, not {_kind(values)}")
        return tuple(n for n in numbers if n is not None)

    def text(self, key: str, default: str | None = "") -> str:
        """Return a string."""
        value = self._get(key, default, "a string")
        if not isinstance(value, str):
            raise self.error(f"{key} must be a string, not {_kind(value)}")
        # Lone surrogates are legal JSON escapes, but cannot be printed.
        return value.encode("utf-8", "replace").decode("utf-8")

    def flag(self, key: str) -> bool:
        """Return a boolean, false if absent."""
        value = self.raw.get(key, False)
        if not isinstance(value, bool):
            raise self.error(f"{key} must be true or false, not {_kind(value)}")
        return value

    def choice(self, key: str, options: Mapping[Any, T], default: Any = None) -> T:
        """Return the option for the value (a number or a string) of `key`."""
        value = self._get(key, default, "one of " + _listed(options))
        if not isinstance(value, str | int | float) or value not in options:
            raise self.error(f"{key} must be one of {_listed(options)}, not {_kind(value)}")
        return options[value]

    def values(self, key: str) -> list[Any]:
        """Return a list, empty if absent."""
        values = self.raw.get(key, [])
        if not isinstance(values, list):
            raise self.error(f"{key} must be a list, not {_kind(values)}")
        return values

    def objects(self, key: str) -> list[JsonObject]:
        """Return a list of objects, empty if absent."""
        return [JsonObject(value, f"{self.where}.{key}[{i}]") for i, value in enumerate(self.values(key))]

    def child(self, key: str) -> JsonObject:
        """Return the object under `key`, an empty one if absent."""
        return JsonObject(self.raw.get(key, {}), f"{self.where}.{key}")

    def extension(self, name: str) -> JsonObject | None:
        """Return the extension object `name`, or None if this object does not have it."""
        extensions = self.child("extensions")
        return extensions.child(name) if name in extensions else None


def _finite(value: Any) -> float | None:
    """Return a JSON number as a float; None for anything else, and for numbers too large for a float."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def _kind(value: Any) -> str:
    """Describe a wrong value in a few words."""
    if isinstance(value, dict):
        return "an object"
    if isinstance(value, list) and len(value) > 16:
        return f"a list of {len(value)}"
    text = repr(value[:60] if isinstance(value, str) else value)
    return text if len(text) <= 60 else text[:57] + "..."


def _range(low: float, high: float) -> str:
    if low == -math.inf and high == math.inf:
        return ""
    if high >= _MAX_INTEGER:
        return f" of at least {low:g}"
    return f" between {low:g} and {high:g}"


def _listed(options: Mapping[Any, Any]) -> str:
    return ", ".join(str(option) for option in options)
