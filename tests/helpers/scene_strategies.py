"""Hypothesis strategies of generated scenes, and a digest of all that a scene holds."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import MISSING, Field, fields, is_dataclass

import numpy as np
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

from wgpu_gi.measure.scenes import KINDS, make_scene
from wgpu_gi.scene.scene import Scene

# Fixed examples, no database and no deadline: a run is the same on every machine.
FIXED = settings(
    derandomize=True, database=None, deadline=None, max_examples=30, suppress_health_check=list(HealthCheck)
)


def scenes(kinds: Sequence[str] = KINDS, seeds: int = 1 << 16) -> st.SearchStrategy[Scene]:
    """Return generated scenes of `kinds` with seeds below `seeds`; a failing example shrinks to the smallest seed."""
    return st.builds(make_scene, st.sampled_from(tuple(kinds)), st.integers(0, seeds - 1))


def digest(value: object) -> str:
    """Return a hash of all numbers, names and arrays of a scene, or of any part of it.

    Fields that have their default are left out, so that a new field changes no hash.
    """
    result = hashlib.sha256()
    _feed(result, value)
    return result.hexdigest()[:16]


def _feed(result: hashlib._Hash, value: object) -> None:
    if is_dataclass(value):
        for field in fields(value):
            if not _is_default(field, getattr(value, field.name)):
                result.update(field.name.encode())
                _feed(result, getattr(value, field.name))
    elif isinstance(value, np.ndarray):
        result.update(f"{value.dtype.str}{value.shape}".encode() + np.ascontiguousarray(value).tobytes())
    elif isinstance(value, list | tuple):
        for item in value:
            _feed(result, item)
    else:
        result.update(repr(value).encode())


def _is_default(field: Field, value: object) -> bool:
    default = field.default if field.default_factory is MISSING else field.default_factory()
    return type(value) is type(default) and not isinstance(value, np.ndarray) and value == default
