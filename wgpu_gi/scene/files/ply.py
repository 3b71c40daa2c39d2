"""Reads the elements of PLY files, text and binary, as columns (Turk 1994, "The PLY Polygon File Format").

Own code, since trimesh reads neither list properties beside the corners of faces nor binary lists of several lengths,
plyfile has a licence that this package cannot take on, and meshio reads row by row.

Departures: rows of text may span lines. Nothing is allocated by an announced count.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...errors import GiError
from .polygons import Floats, Ints

_TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"}
_TYPES |= {"float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2"}
_TYPES |= {"int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8"}
_FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_LONGEST_HEADER = 1 << 20  # bytes


class Lists(NamedTuple):
    """A list property: the values of all rows in sequence, and how many each row has."""

    values: NDArray
    counts: Ints


@dataclass
class Element:
    """An element of a header, and later its columns, each as long as `count`."""

    name: str
    count: int
    properties: list[tuple[str, str, str | None]] = field(default_factory=list)  # name, type, type of the list's count
    columns: dict[str, NDArray] = field(default_factory=dict)
    lists: dict[str, Lists] = field(default_factory=dict)


@dataclass
class PlyFile:
    """The elements of a file by name, the files of its textures, and how much of the file belongs to none."""

    elements: dict[str, Element]
    textures: list[str]
    rest: int  # bytes of binary files, words of text


def read_ply(source: str, data: bytes) -> PlyFile:
    """Return the elements of a file. Raises GiError, which begins with `source`, for one that is damaged or truncated.

    Words of text files that are no numbers become NaN.
    """
    order, elements, textures, start = _header(source, data)
    body = memoryview(data)[start:]
    if order:
        at = 0
        for element in elements:
            at = _read_binary(source, body, at, element, order)
        rest = len(body) - at
    else:
        lines = [line.split() for line in bytes(body).splitlines() if line.strip()]
        words, at, row = _floats([word for line in lines for word in line]), 0, 0
        # Where each row has a line of its own, what follows its properties there is no part of the next row.
        starts = np.concatenate([[0], np.cumsum([len(line) for line in lines])]).astype(np.int64)
        of_rows = len(lines) == sum(element.count for element in elements if element.properties)
        rest = 0
        for element in elements:
            last = row + (element.count if element.properties else 0)
            at, unread = _read_words(source, words, at, element, starts[row : last + 1] if of_rows else None)
            row, rest = last, rest + unread
        rest += len(words) - at
    return PlyFile({element.name: element for element in elements}, textures, rest)


def _header(source: str, data: bytes) -> tuple[str, list[Element], list[str], int]:
    """Return the byte order ("" for text), the elements, the names of textures, and where the header ends.

    Lines of other words are comments that lack the word. A line that announces data must be right.
    """
    if data[:3] != b"ply" or data[3:4] not in (b"\n", b"\r"):
        raise GiError(f"{source} is not a PLY file: it does not begin with the line 'ply'")
    # All lines end as the first one does.
    end_of_line = b"\r\n" if data[3:5] == b"\r\n" else data[3:4]
    end = data.find(end_of_line + b"end_header", 0, _LONGEST_HEADER)
    stop = data.find(end_of_line, end + 2) if end >= 0 else -1
    if stop < 0:
        raise GiError(f"{source} is truncated or not a PLY file: its header has no 'end_header'")
    order: str | None = None
    elements: list[Element] = []
    textures: list[str] = []
    for line in data[:end].decode("utf-8", errors="replace").split(end_of_line.decode())[1:]:
        words = line.split()
        match words:
            case ["format", kind, *_] if kind in _FORMATS:
                order = _FORMATS[kind]
            case ["comment", "TextureFile", _, *_]:
                textures.append(line.split(None, 2)[2].strip())
            case ["element", name, count] if count.isdecimal() and len(count) < 16:
                elements.append(Element(name, int(count)))
            case ["property", "list", count_type, kind, name] if elements and {count_type, kind} <= _TYPES.keys():
                elements[-1].properties.append((name, _TYPES[kind], _TYPES[count_type]))
            case ["property", kind, name] if elements and kind in _TYPES:
                elements[-1].properties.append((name, _TYPES[kind], None))
            case ["element" | "property" | "format", *_]:
                raise GiError(f"{source} is not a readable PLY file: its header has the line {line[:60]!r}")
    if order is None:
        raise GiError(f"{source} is not a readable PLY file: its header has no format")
    return order, elements, textures, stop + len(end_of_line)


def _truncated(source: str, element: Element) -> GiError:
    return GiError(f"{source} is truncated or damaged: it ends within its {element.count} {element.name!r} rows")


def _unlike(source: str, element: Element) -> GiError:
    return GiError(f"{source} is damaged: a {element.name!r} row has a list of negative or fractional length")


def _floats(words: list[bytes]) -> Floats:
    """Return words as numbers; those that are none become NaN."""
    try:
        return np.array(words, np.float64)
    except ValueError:
        return np.array([_float(word) for word in words], np.float64)


def _float(word: bytes) -> float:
    try:
        return float(word)
    except ValueError:
        return np.nan


def _read_words(source: str, words: Floats, at: int, element: Element, lines: Ints | None) -> tuple[int, int]:
    """Fill the columns of an element from the word `at`; return where it ends and how many words were passed over.

    `lines` holds where the line of each row starts, and where the last one ends; None if lines are no rows.
    """
    properties, count = element.properties, element.count
    if not properties or not count:
        return at, 0
    if count * len(properties) > len(words) - at:
        raise _truncated(source, element)
    # Place the properties of all rows by the lengths of the lists in the first row.
    lengths, end = [], at
    for _, _, count_type in properties:
        lengths.append(_length(source, words, end, element) if count_type else 0)
        end += 1 + lengths[-1]
    width = end - at
    firsts = np.cumsum([0, *(1 + length for length in lengths)])[:-1]
    if count * width <= len(words) - at and (lines is None or (np.diff(lines) == width).all()):
        table = words[at : at + count * width].reshape(count, width)
        if all((table[:, f] == n).all() for (_, _, c), f, n in zip(properties, firsts, lengths, strict=True) if c):
            for (name, _, count_type), first, length in zip(properties, firsts, lengths, strict=True):
                if count_type is None:
                    element.columns[name] = table[:, first]
                else:
                    values = table[:, first + 1 : first + 1 + length].ravel()
                    element.lists[name] = Lists(values, np.full(count, length))
            return at + count * width, 0
    return _walk_words(source, words, at, element, lines)


def _walk_words(source: str, words: Floats, at: int, element: Element, lines: Ints | None) -> tuple[int, int]:
    """Fill the columns of an element whose rows have several lengths, as `_read_words` does."""
    properties, unread = element.properties, 0
    starts = np.zeros((len(properties), element.count), np.int64)
    counts = np.zeros_like(starts)
    for row in range(element.count):
        if lines is not None:
            unread += int(lines[row]) - at
            at = int(lines[row])
        for k, (_, _, count_type) in enumerate(properties):
            if at >= len(words):
                raise _truncated(source, element)
            starts[k, row] = at
            if count_type:
                counts[k, row] = length = _length(source, words, at, element)
                starts[k, row] += 1
                at += length
            at += 1
        if lines is not None and at > lines[row + 1]:
            raise GiError(f"{source} is damaged: a {element.name!r} row has too few numbers")
    if lines is not None:
        unread += int(lines[-1]) - at
        at = int(lines[-1])
    if at > len(words):
        raise _truncated(source, element)
    for k, (name, _, count_type) in enumerate(properties):
        if count_type is None:
            element.columns[name] = words[starts[k]]
        else:
            element.lists[name] = Lists(words[_spans(starts[k], counts[k])], counts[k])
    return at, unread


def _length(source: str, words: Floats, at: int, element: Element) -> int:
    """Return the length of a list in a text file."""
    if at >= len(words):
        raise _truncated(source, element)
    length = float(words[at])
    if not (length >= 0 and length == int(min(length, 1e15))):
        raise _unlike(source, element)
    if length > len(words) - at:
        raise _truncated(source, element)
    return int(length)


def _read_binary(source: str, body: memoryview, at: int, element: Element, order: str) -> int:
    """Fill the columns of an element from the byte `at`; return where it ends."""
    properties, count = element.properties, element.count
    if not properties or not count:
        return at
    smallest = sum(np.dtype(count_type or kind).itemsize for _, kind, count_type in properties)
    if count * smallest > len(body) - at:
        raise _truncated(source, element)
    # Take all rows at once by the lengths of the lists in the first row.
    fields, offset = [], at
    for k, (_, kind, count_type) in enumerate(properties):
        length = None
        if count_type:
            length = _binary_length(source, body, offset, element, order + count_type)
            fields.append((f"count{k}", order + count_type))
            offset += np.dtype(count_type).itemsize
        fields.append((f"value{k}", order + kind, () if length is None else (length,)))  # type: ignore[arg-type]
        offset += np.dtype(kind).itemsize * (1 if length is None else length)
    row_type = np.dtype(fields)
    if count * row_type.itemsize <= len(body) - at:
        table = np.frombuffer(body, row_type, count, at)
        listed = [k for k, (_, _, count_type) in enumerate(properties) if count_type]
        if all((table[f"count{k}"] == table[f"count{k}"][0]).all() for k in listed):
            for k, (name, _, count_type) in enumerate(properties):
                values = table[f"value{k}"]
                if count_type is None:
                    element.columns[name] = values
                else:
                    element.lists[name] = Lists(values.reshape(-1), np.full(count, values.shape[1]))
            return at + count * row_type.itemsize
    return _walk_binary(source, body, at, element, order)


def _walk_binary(source: str, body: memoryview, at: int, element: Element, order: str) -> int:
    """Fill the columns of an element whose lists have several lengths."""
    properties = element.properties
    sizes = [np.dtype(kind).itemsize for _, kind, _ in properties]
    starts = np.zeros((len(properties), element.count), np.int64)
    counts = np.ones_like(starts)
    for row in range(element.count):
        for k, (_, _, count_type) in enumerate(properties):
            length = 1
            if count_type:
                counts[k, row] = length = _binary_length(source, body, at, element, order + count_type)
                at += int(count_type[1])
            starts[k, row] = at
            at += length * sizes[k]
    if at > len(body):
        raise _truncated(source, element)
    # Gather the bytes of each property.
    octets = np.frombuffer(body, np.uint8)
    for k, (name, kind, count_type) in enumerate(properties):
        values = octets[_spans(starts[k], counts[k] * sizes[k])].view(order + kind)
        if count_type is None:
            element.columns[name] = values
        else:
            element.lists[name] = Lists(values, counts[k])
    return at


def _binary_length(source: str, body: memoryview, at: int, element: Element, kind: str) -> int:
    """Return the length of a list in a binary file."""
    size = int(kind[2])
    if at + size > len(body):
        raise _truncated(source, element)
    if kind[1] == "f":
        length = float(np.frombuffer(body, kind, 1, at)[0])
        if not (0 <= length <= len(body) and length == int(length)):
            raise _unlike(source, element)
    else:
        length = int.from_bytes(body[at : at + size], "little" if kind[0] == "<" else "big", signed=kind[1] == "i")
    if length < 0:
        raise _unlike(source, element)
    if length > len(body) - at:
        raise _truncated(source, element)
    return int(length)


def _spans(starts: Ints, lengths: Ints) -> Ints:
    """Return the indices start, start + 1, ... of each span, one span after the other."""
    before = np.cumsum(lengths) - lengths
    return np.arange(int(lengths.sum())) + np.repeat(starts - before, lengths)
