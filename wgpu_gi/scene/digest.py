"""Digests of scenes, cameras and settings: names of cache entries that depend on all values."""

from __future__ import annotations

import hashlib
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

INVISIBLE = ("name", "notes", "cameras", "animations")  # fields of a scene that do not change a picture


def digest(value: Any, most: int | None = None) -> str:
    """Return the digest of dataclasses, arrays, lists, numbers and texts, as 32 hexadecimal digits.

    most: number of values, evenly spaced, that stand for a larger array; None: all of them.
    """
    return _digest(value, most, {}).hex()


def _digest(value: Any, most: int | None, known: dict[int, bytes]) -> bytes:
    """Return a digest; `known` holds those of dataclasses by id."""
    if id(value) in known:
        return known[id(value)]
    total = hashlib.blake2b(type(value).__name__.encode(), digest_size=16)
    if is_dataclass(value):
        for field in fields(value):
            if field.name not in INVISIBLE:
                total.update(field.name.encode() + _digest(getattr(value, field.name), most, known))
        known[id(value)] = total.digest()  # a mesh with many instances is hashed once
    elif isinstance(value, np.ndarray):
        total.update(f"{value.dtype.str}{value.shape}".encode() + _sample(value, most).tobytes())
    elif isinstance(value, list | tuple):
        for item in value:
            total.update(_digest(item, most, known))
    else:
        total.update(repr(value).encode())
    return total.digest()


def _sample(array: np.ndarray, most: int | None) -> np.ndarray:
    """Return the values of an array, or `most` of them, evenly spaced."""
    if most is None or array.size <= most:
        return array
    return array.reshape(-1)[:: -(-array.size // most)]
