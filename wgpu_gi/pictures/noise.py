"""The error that a picture's own noise causes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..errors import GiError


def expected_relmse(picture: ArrayLike, standard_error: ArrayLike) -> float:
    """Return the relMSE that noise alone causes: mean(s^2 / (x^2 + 0.01 m^2)), m the mean of the picture.

    `picture` x is linear radiance and `standard_error` s the buffer of that name, of the same shape, (h, w, 3) or
    (h, w). Bias is not in it. A black picture without noise has 0. Raises GiError for differing shapes, NaN and Inf.
    """
    x, s = np.asarray(picture, np.float64), np.asarray(standard_error, np.float64)
    if x.shape != s.shape or x.size == 0:
        raise GiError(f"a picture of shape {x.shape} and a standard error of shape {s.shape} do not fit together")
    if not (np.isfinite(x).all() and np.isfinite(s).all()):
        raise GiError("a picture with NaN or infinite values has no expected error")
    if not s.any():
        return 0.0
    # In units of the largest value no square overflows or vanishes.
    unit = max(float(np.abs(x).max()), float(s.max()))
    x, s = x / unit, s / unit
    floor = max(0.01 * float(x.mean()) ** 2, np.finfo(np.float64).tiny)
    return float(np.mean(s**2 / (x**2 + floor)))
