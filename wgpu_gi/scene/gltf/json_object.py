"""Typed access to the JSON of a glTF file: a wrong value becomes its default, with a note, or an error."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, TypeVar

from ...errors import GiError
from ..files.notes import Notes

T = TypeVar("T")

# Larger integers are not exact in every JSON reader, and no real file has such a count or offset.
_MAX_INTEGER = 1 << 53


class Damage(GiError):
    """An error that costs one part of the file, such as a primitive or a texture; the rest can be shown."""


class JsonObject:
    """A JSON object; `where` is its place in the file, and `notes` receives what is wrong with optional values.

    The getters return a checked value. If the key is absent or null, they return the default. A wrong value becomes the
    default, too, or the nearest bound if it is a number out of range, with a note of damage. Without a default, both
    raise Damage. Integers and indices have no harmless replacement: a wrong one always raises Damage.
    """

    def __init__(self, value: Any, where: str, notes: Notes) -> None:
        self.where = where
        self.notes = notes
        self.raw: dict[str, Any] = value if isinstance(value, dict) else {}
        if self.raw is not value:
            notes.damage(f"{where} must be a JSON object, not {_kind(value)}; it was ignored.")

    def __contains__(self, key: str) -> bool:
        return self._get(key) is not None

    def error(self, problem: str) -> Damage:
        """Return an error that costs the part of the file that needs this object."""
        return Damage(f"{self.where}: {problem}")

    def fatal(self, problem: str) -> GiError:
        """Return an error that makes the bytes of the whole file untrustworthy."""
        return GiError(f"{self.where}: {problem}; the file is damaged")

    def damage(self, problem: str) -> None:
        """Note a problem that costs only a value of this object."""
        self.notes.damage(f"{self.where}: {problem}.")

    def _get(self, key: str) -> Any:
        """Return the value of a key, None if it is absent or null."""
        value = self.raw.get(key)
        if value is None and key in self.raw:
            self.damage(f"{key} is null; it was ignored")
        return value

    def _replaced(self, problem: str, default: T | None, words: str = "it was ignored") -> T:
        """Return the default with a note; without one, raise Damage."""
        if default is None:
            raise self.error(problem)
        self.damage(f"{problem}; {words}")
        return default

    def _absent(self, key: str, default: T | None, expected: str) -> T:
        """Return the default of an absent key; without one, raise Damage."""
        if default is None:
            raise self.error(f"{key} is missing ({expected})")
        return default

    def number(self, key: str, default: float | None = None, low: float = -math.inf, high: float = math.inf) -> float:
        """Return a finite number within [low, high]."""
        value = self._get(key)
        if value is None:
            return self._absent(key, default, "a number")
        number = _finite(value)
        if number is not None and low <= number <= high:
            return number
        problem = f"{key} must be a finite number{_range(low, high)}, not {_kind(value)}"
        if number is None or default is None:
            return self._replaced(problem, default)
        limited = min(max(number, low), high)
        return self._replaced(problem, limited, f"it was set to {limited:g}")

    def integer(self, key: str, default: int | None = None, low: int = 0, high: int = _MAX_INTEGER) -> int:
        """Return an integer within [low, high]; 3.0 counts as 3."""
        value = self._get(key)
        if value is None:
            return self._absent(key, default, "an integer")
        number = _finite(value)
        if number is None or number != math.floor(number) or not low <= number <= high:
            raise self.error(f"{key} must be an integer{_range(low, high)}, not {_kind(value)}")
        return int(value)

    def index(self, key: str, count: int, array: str) -> int:
        """Return an index into the file's `array`, which has `count` elements."""
        value = self._get(key)
        if value is None:
            return self._absent(key, None, f"an index into {array}")
        return self._checked_index(value, key, count, array)

    def optional_index(self, key: str, count: int, array: str) -> int | None:
        """Return an index into the file's `array`; None if it is absent, or wrong, with a note."""
        try:
            return self.index(key, count, array) if key in self else None
        except Damage as error:
            self.notes.damage(f"{error}; it was ignored.")
            return None

    def indices(self, key: str, count: int, array: str) -> list[int]:
        """Return a list of indices into `array`, all of them correct; an absent key is an empty list."""
        values = self.values(key)
        return [self._checked_index(value, f"{key}[{i}]", count, array) for i, value in enumerate(values)]

    def correct_indices(self, key: str, count: int, array: str) -> list[int]:
        """Return those elements of a list that are indices into `array`, with a note of the others."""
        found = []
        for i, value in enumerate(self.values(key)):
            try:
                found.append(self._checked_index(value, f"{key}[{i}]", count, array))
            except Damage as error:
                self.notes.damage(f"{error}; it was ignored.")
        return found

    def _checked_index(self, value: Any, label: str, count: int, array: str) -> int:
        number = _finite(value)
        if number is None or number != math.floor(number) or not 0 <= number < count:
            raise self.error(f"{label} must be an index into {array} (there are {count}), not {_kind(value)}")
        return int(value)

    def vector(
        self, key: str, default: tuple[float, ...], low: float = -math.inf, high: float = math.inf
    ) -> tuple[float, ...]:
        """Return finite numbers within [low, high]; `default` sets their count."""
        values = self._get(key)
        if values is None:
            return default
        numbers = [_finite(v) for v in values] if isinstance(values, list | tuple) else []
        finite = [n for n in numbers if n is not None]
        problem = f"{key} must be {len(default)} finite numbers{_range(low, high)}, not {_kind(values)}"
        if not len(finite) == len(numbers) == len(default):
            return self._replaced(problem, default)
        limited = tuple(min(max(n, low), high) for n in finite)
        return limited if limited == tuple(finite) else self._replaced(problem, limited, "it was limited")

    def numbers(self, key: str) -> tuple[float, ...]:
        """Return a list of finite numbers, empty if absent."""
        values = self.values(key)
        found = [n for n in map(_finite, values) if n is not None]
        if len(found) == len(values):
            return tuple(found)
        return self._replaced(f"{key} must be finite numbers, not {_kind(values)}", ())

    def text(self, key: str, default: str | None = "") -> str:
        """Return a string."""
        value = self._get(key)
        if value is None:
            return self._absent(key, default, "a string")
        if not isinstance(value, str):
            return self._replaced(f"{key} must be a string, not {_kind(value)}", default)
        # Lone surrogates are legal JSON escapes, but cannot be printed.
        return value.encode("utf-8", "replace").decode("utf-8")

    def flag(self, key: str, default: bool = False) -> bool:
        """Return a boolean."""
        value = self._get(key)
        if value is None or isinstance(value, bool):
            return default if value is None else value
        return self._replaced(f"{key} must be true or false, not {_kind(value)}", default)

    def choice(self, key: str, options: Mapping[Any, T], default: Any = None) -> T:
        """Return the option for the value (a number or a string) of `key`; `default` is a value, too."""
        value = self._get(key)
        if value is None:
            return options[self._absent(key, default, "one of " + _listed(options))]
        if isinstance(value, bool) or not isinstance(value, str | int | float) or value not in options:
            value = self._replaced(f"{key} must be one of {_listed(options)}, not {_kind(value)}", default)
        return options[value]

    def values(self, key: str) -> list[Any]:
        """Return a list, empty if absent."""
        values = self._get(key)
        if values is None or isinstance(values, list):
            return values or []
        return self._replaced(f"{key} must be a list, not {_kind(values)}", [])

    def objects(self, key: str) -> list[JsonObject]:
        """Return a list of objects, empty if absent; an element that is no object becomes an empty one."""
        return [JsonObject(value, f"{self.where}.{key}[{i}]", self.notes) for i, value in enumerate(self.values(key))]

    def child(self, key: str) -> JsonObject:
        """Return the object under `key`, an empty one if absent."""
        value = self._get(key)
        return JsonObject({} if value is None else value, f"{self.where}.{key}", self.notes)

    def extension(self, name: str) -> JsonObject | None:
        """Return the extension object `name`, or None if this object does not have it."""
        if "extensions" not in self.raw:
            return None
        extensions = self.child("extensions")
        if not isinstance(extensions.raw.get(name, {}), dict):
            extensions.child(name)  # notes the wrong type
            return None
        return extensions.child(name) if name in extensions else None

    def extension_or_empty(self, name: str) -> JsonObject:
        """Return the extension object `name`, or an empty object."""
        return self.extension(name) or self.empty()

    def empty(self) -> JsonObject:
        """Return an empty object at this place."""
        return JsonObject({}, self.where, self.notes)


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
