"""Settings, each with a sentence, a unit and a range: declared once, checked, listed, and set from text.

A technique declares a dataclass of `setting()` fields; the renderer's settings hold such dataclasses as sections:

>>> @dataclass
... class PathSettings:
...     samples_per_run: int = setting(4, "Samples per pixel in one run.", unit="samples", range=(1, 64))

A setting may have another default for each quality: `presets={"low": 1, "high": 16}`; `apply_quality` sets them all.
"""

from __future__ import annotations

import dataclasses
import difflib
import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from numbers import Integral, Real
from types import NoneType
from typing import Any, Literal, NamedTuple, get_args, get_origin, get_type_hints

from .errors import GiError, known_names

QUALITIES = ("low", "medium", "high")  # the defaults of all settings are for medium

_TRUTHS = {"true": True, "1": True, "yes": True, "on": True, "false": False, "0": False, "no": False, "off": False}
_NO_VALUE = ("none", "unlimited")
_TYPES: dict[type, dict[str, Any]] = {}  # types of the fields of each dataclass


class Row(NamedTuple):
    """One setting, described for users; `name` is that of `--set`."""

    name: str
    value: Any
    default: Any
    unit: str
    range: tuple[float, float] | None
    choices: tuple[str, ...]
    sentence: str
    presets: Mapping[str, Any]
    kind: type  # bool, int, float or str
    optional: bool  # None is allowed


def setting(
    default: Any,
    sentence: str,
    unit: str = "",
    range: tuple[float, float] | None = None,
    choices: Sequence[str] = (),
    presets: Mapping[str, Any] | None = None,
) -> Any:
    """Return a dataclass field with its documentation: one sentence, a unit, an inclusive range or the choices.

    `presets` are the values at other qualities than medium, such as {"low": 256, "high": 1024}. Medium and qualities
    without a preset have the default.
    """
    metadata = {
        "sentence": sentence,
        "unit": unit,
        "range": range,
        "choices": tuple(choices),
        "presets": dict(presets or {}),
    }
    return dataclasses.field(default=default, metadata=metadata)


def validate(section: Any, name: str = "") -> None:
    """Check every setting of a dataclass and of its sections.

    Raises GiError naming the setting (`name.field`), its range and its unit for a value of a wrong type, out of range,
    NaN or infinite.
    """
    for path, owner, field in _fields(section, name):
        _check(path, getattr(owner, field.name), field, _type_of(owner, field))


def assign(settings: Any, text: str) -> None:
    """Apply `section.name=value` or `name=value` to a settings dataclass.

    `true false 1 0` are booleans; `none` and `unlimited` mean None where that is allowed. Raises GiError for an unknown
    name, with the nearest three, and for a value that does not fit.
    """
    name, equals, value_text = text.partition("=")
    name, value_text = name.strip(), value_text.strip()
    if not equals:
        raise GiError(f"--set takes section.name=value, not {text!r}")
    known = {path: (owner, field) for path, owner, field in _fields(settings)}
    if name not in known:
        raise GiError(f"there is no setting {name!r}; {known_names(name, known)}")
    owner, field = known[name]
    kind = _type_of(owner, field)
    value = _parse(name, value_text, kind)
    _check(name, value, field, kind)
    setattr(owner, field.name, value)


def apply_quality(settings: Any, quality: str) -> None:
    """Set every setting with presets, in all sections, to its value at `quality`.

    Call it before `assign`, because it overrides assigned values. Raises GiError for an unknown quality, and for a
    preset outside the range of its setting.
    """
    if quality not in QUALITIES:
        raise GiError(f"there is no quality {_given(quality)}; available: {', '.join(QUALITIES)}")
    for path, owner, field in _fields(settings):
        presets = field.metadata["presets"]
        if presets:
            value = presets.get(quality, field.default)
            _check(path, value, field, _type_of(owner, field))
            setattr(owner, field.name, value)


def describe(settings: Any) -> list[Row]:
    """List every setting of a settings dataclass and of its sections, in order of declaration."""
    rows = []
    for path, owner, field in _fields(settings):
        meta, annotated = field.metadata, _type_of(owner, field)
        kind, optional = _split_optional(annotated)
        rows.append(
            Row(
                name=path,
                value=getattr(owner, field.name),
                default=field.default,
                unit=meta["unit"],
                range=meta["range"],
                choices=_choices(field, annotated),
                sentence=meta["sentence"],
                presets=meta["presets"],
                kind=kind if isinstance(kind, type) else str,
                optional=optional,
            )
        )
    return rows


def format_rows(rows: Sequence[Row]) -> str:
    """Return the rows as an aligned text table, one line each: name=value, range with unit, sentence, presets."""
    cells = cells_of(rows)
    widths = [max((len(line[column]) for line in cells), default=0) for column in (0, 1)]
    return "\n".join(f"  {a:<{widths[0]}}  {b:<{widths[1]}}  {c}".rstrip() for a, b, c in cells)


def cells_of(rows: Sequence[Row]) -> list[tuple[str, str, str]]:
    """Return the three cells of each row: name=value, range with unit or choices, sentence with presets."""
    cells = []
    for row in rows:
        limits = " .. ".join(map(_text, row.range)) if row.range else " | ".join(row.choices)
        presets = ", ".join(f"{quality} {_text(value)}" for quality, value in row.presets.items())
        sentence = f"{row.sentence} ({presets})" if presets else row.sentence
        cells.append((f"{row.name}={_text(row.value)}", f"{limits} {row.unit}".strip(), sentence))
    return cells


def _fields(settings: Any, prefix: str = "") -> Iterator[tuple[str, Any, dataclasses.Field]]:
    """Yield (dotted name, owner, field) of every setting, entering sections. Raises GiError for one of a wrong type."""
    for field in dataclasses.fields(settings):
        path = f"{prefix}.{field.name}" if prefix else field.name
        if "sentence" in field.metadata:
            yield path, settings, field
        elif isinstance(kind := _type_of(settings, field), type) and dataclasses.is_dataclass(kind):
            section = getattr(settings, field.name)
            if not isinstance(section, kind):
                raise GiError(f"{path} must be {kind.__name__}(...), not a {type(section).__name__}")
            yield from _fields(section, path)


def _type_of(owner: Any, field: dataclasses.Field) -> Any:
    kind = type(owner)
    # Resolving annotations is slow, so it is done once per class.
    if kind not in _TYPES:
        _TYPES[kind] = get_type_hints(kind)
    return _TYPES[kind][field.name]


@cache
def _split_optional(kind: Any) -> tuple[Any, bool]:
    """Split `T | None` into T and whether None is allowed."""
    arguments = get_args(kind)
    if get_origin(kind) is Literal or NoneType not in arguments:
        return kind, False
    return next(argument for argument in arguments if argument is not NoneType), True


def _choices(field: dataclasses.Field, kind: Any) -> tuple[str, ...]:
    base, _ = _split_optional(kind)
    return field.metadata["choices"] or (get_args(base) if get_origin(base) is Literal else ())


def _parse(name: str, text: str, kind: Any) -> Any:
    """Read `text` as a value of the annotated type."""
    base, optional = _split_optional(kind)
    if optional and text.lower() in _NO_VALUE:
        return None
    try:
        if base is bool:
            return _TRUTHS[text.lower()]
        return base(text) if base in (int, float) else text
    except (KeyError, ValueError):
        extra = " or none" if optional else ""
        raise GiError(f"{name} takes {_kind_name(base)}{extra}, not {text!r}") from None


def _check(name: str, value: Any, field: dataclasses.Field, kind: Any) -> None:
    """Raise GiError if `value` is not of the annotated type or outside the range or the choices."""
    base, optional = _split_optional(kind)
    if value is None and optional:
        return
    choices, limits, unit = _choices(field, kind), field.metadata["range"], field.metadata["unit"]
    if choices:
        if value not in choices:
            near = difflib.get_close_matches(value, choices, n=1) if isinstance(value, str) else []
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise GiError(f"{name} must be one of {', '.join(choices)}, not {_given(value)}{hint}")
        return
    if base is float:
        fits = isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)
    elif base is int:
        fits = isinstance(value, Integral) and not isinstance(value, bool)
    else:
        fits = isinstance(value, base)
    if not fits:
        raise GiError(f"{name} takes {_kind_name(base)}{f' ({unit})' if unit else ''}, not {_given(value)}")
    if limits and not limits[0] <= value <= limits[1]:
        between = f"{_text(limits[0])} and {_text(limits[1])} {unit}".rstrip()
        raise GiError(f"{name} must lie between {between}, not {_text(value)}")


def _kind_name(kind: Any) -> str:
    names = {int: "a whole number", float: "a finite number", bool: "true or false", str: "a text"}
    return names.get(kind, str(kind))


def _given(value: Any) -> str:
    """Return a wrong value in a few words."""
    if isinstance(value, (bool, int, float, NoneType)):
        return _text(value)
    if not isinstance(value, str):
        return f"a {type(value).__name__}"
    return repr(value if len(value) <= 60 else f"{value[:57]}...")


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return "none" if value is None else f"{value:g}" if isinstance(value, float) else str(value)
