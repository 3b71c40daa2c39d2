"""Chi-square tests without scipy."""

from __future__ import annotations

import numpy as np


def chi_square_z(observed: np.ndarray, expected: np.ndarray) -> float:
    """Return Pearson's chi-square as a normal score, standard deviations above its mean (Wilson and Hilferty 1931).

    Cells with an expected count below 10 are pooled.
    """
    o, e = np.asarray(observed, np.float64).ravel(), np.asarray(expected, np.float64).ravel()
    few = e < 10
    o, e = np.append(o[~few], o[few].sum()), np.append(e[~few], e[few].sum())
    if e[-1] < 10:
        # The expected count is too small for a test, unless the observed one is large.
        assert o[-1] < 50, f"{o[-1]:.0f} samples where {e[-1]:.2g} are expected"
        o, e = o[:-1], e[:-1]
    freedom = len(e) - 1
    chi = ((o - e) ** 2 / e).sum()
    return float(((chi / freedom) ** (1 / 3) - (1 - 2 / (9 * freedom))) / np.sqrt(2 / (9 * freedom)))
