"""Values of tracks at a time (glTF 2.0, appendix C): steps, linear and spherical interpolation, cubic splines.

With t the share of the segment from key k to k + 1 that has passed, t_d its length in seconds:
    step       v_k
    linear     (1 - t) v_k + t v_{k+1}
    spherical  sin(a (1 - t)) / sin(a) v_k + s sin(a t) / sin(a) v_{k+1},  d = v_k . v_{k+1}, s = d / |d|, cos(a) = |d|
    cubic      (2t^3 - 3t^2 + 1) v_k + t_d (t^3 - 2t^2 + t) b_k + (3t^2 - 2t^3) v_{k+1} + t_d (t^3 - t^2) a_{k+1}
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .animation import Interpolation, Track

Array = NDArray[np.float64]
_STRAIGHT = 1e-6  # radians: below, sin(a) loses digits and the chord is the arc to 1e-13


def value_at(track: Track, time: float, spherical: bool = False) -> Array:
    """Return the values (w,) of a track at `time` seconds; `spherical` for quaternions, which get unit length."""
    return values_at(track.times, track.values[None], track.interpolation, time, spherical)[0]


def values_at(times: Array, values: Array, interpolation: Interpolation, time: float, spherical: bool) -> Array:
    """Return the values (c, w) at a time of c tracks with the same `times` (k,); values are (c, k, w).

    Those of "cubic" are (c, k, 3, w): in-tangent, value, out-tangent. Quaternions (`spherical`) get unit length.
    """
    after = int(np.searchsorted(times, time, side="right"))
    keys = values[:, :, 1] if interpolation == "cubic" else values
    last = len(times) - 1
    if after == 0 or after > last or interpolation == "step":
        found = keys[:, min(max(after - 1, 0), last)]
    else:
        length = times[after] - times[after - 1]
        share = (time - times[after - 1]) / length
        start, end = keys[:, after - 1], keys[:, after]
        if interpolation == "cubic":
            found = _spline(start, values[:, after - 1, 2], end, values[:, after, 0], share, length)
        elif spherical:
            found = _slerp(_unit(start), _unit(end), share)
        else:
            found = (1 - share) * start + share * end
    return _unit(found) if spherical else found


def _spline(start: Array, leaving: Array, end: Array, arriving: Array, t: float, length: float) -> Array:
    """Return the point of the cubic Hermite splines with tangents per second."""
    t2, t3 = t * t, t * t * t
    tangents = length * ((t3 - 2 * t2 + t) * leaving + (t3 - t2) * arriving)
    return (2 * t3 - 3 * t2 + 1) * start + (3 * t2 - 2 * t3) * end + tangents


def _slerp(start: Array, end: Array, t: float) -> Array:
    """Return unit quaternions (c, 4) on the shorter arcs between two."""
    end = np.where((start * end).sum(1, keepdims=True) < 0, -end, end)
    # The half angle from the chord is exact also near 0, where the arc cosine loses half of the digits.
    chord, sum_ = np.linalg.norm(end - start, axis=1), np.linalg.norm(end + start, axis=1)
    angle = 2 * np.arctan2(chord, sum_)[:, None]
    straight = angle < _STRAIGHT
    sine = np.where(straight, 1.0, np.sin(angle))
    near = np.where(straight, 1 - t, np.sin(angle * (1 - t)) / sine)
    far = np.where(straight, t, np.sin(angle * t) / sine)
    return near * start + far * end


def _unit(quaternions: Array) -> Array:
    """Return quaternions (c, 4) with unit length; zeros become the identity."""
    largest = np.abs(quaternions).max(1, keepdims=True)
    scaled = np.where(largest > 0, quaternions / np.where(largest > 0, largest, 1.0), (0.0, 0.0, 0.0, 1.0))
    unit: Array = scaled / np.linalg.norm(scaled, axis=1, keepdims=True)
    return unit
