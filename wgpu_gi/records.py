"""The base of the dataclasses of scenes and settings: known attributes only, and a short text for each object."""

from __future__ import annotations

from dataclasses import MISSING, Field, fields
from typing import TYPE_CHECKING, Any

from .errors import near_names

LONGEST = 60  # characters of a value in a text


class KnownAttributes:
    """Base of dataclasses with slots.

    Reading or setting a misspelt attribute raises AttributeError, with the near name. `repr` shows the fields that
    differ from their defaults, and of arrays and lists the size.
    """

    __slots__ = ("__weakref__",)

    def __repr__(self) -> str:
        parts = [(field, getattr(self, field.name)) for field in fields(self)]  # type: ignore[arg-type]
        told = [f"{field.name}={_brief(value)}" for field, value in parts if not _is_default(field, value)]
        return f"{type(self).__name__}({', '.join(told)})"

    if not TYPE_CHECKING:  # a type checker would take these methods as a permission of any attribute

        def __setattr__(self, name: str, value: Any) -> None:
            try:
                object.__setattr__(self, name, value)
            except AttributeError:
                if hasattr(type(self), name):  # a property or a method
                    raise
                raise _unknown_attribute(self, name) from None

        def __getattr__(self, name: str) -> Any:
            found = getattr(type(self), name, None)
            if isinstance(found, property):
                return found.fget(self)  # the property failed: raise its own error again
            if name.startswith("__") and name.endswith("__"):
                # Python asks for its own protocols, such as `__deepcopy__`: a search for near names would slow that.
                raise AttributeError(name)
            raise _unknown_attribute(self, name)


def _is_default(field: Field, value: Any) -> bool:
    """Tell whether a field has its default; an array counts as given."""
    default = field.default if field.default_factory is MISSING else field.default_factory()
    return type(value) is type(default) and not hasattr(value, "dtype") and bool(value == default)


def _brief(value: Any) -> str:
    """Return a value in a few words: arrays and lists by their size, parts by their class and name."""
    if hasattr(value, "dtype") and getattr(value, "shape", None):
        return f"<{' x '.join(map(str, value.shape))} {value.dtype}>"
    if isinstance(value, (list, tuple)) and len(value) > 4:
        return f"<{len(value)} items>"
    if isinstance(value, (list, tuple)):
        text = ", ".join(map(_brief, value))
        return f"[{text}]" if isinstance(value, list) else f"({text}{',' * (len(value) == 1)})"
    if isinstance(value, KnownAttributes) and isinstance(getattr(value, "name", None), str):
        return f"{type(value).__name__}({value.name!r})"  # type: ignore[attr-defined]
    text = repr(value)
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}..."


def _unknown_attribute(owner: object, name: str) -> AttributeError:
    kind = type(owner)
    known = [known for known in dir(kind) if not known.startswith("_")]
    article = "an" if kind.__name__[0] in "AEIOU" else "a"
    return AttributeError(f"{article} {kind.__name__} has no attribute {name!r}; {near_names(name, known)}")
