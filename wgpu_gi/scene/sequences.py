"""Steps whose multiples, modulo 1, spread evenly over the unit interval and the unit square."""

from __future__ import annotations

import numpy as np

GOLDEN = (5**0.5 - 1) / 2
# The same for the plane, 1 / g and 1 / g^2 with g^3 = g + 1 (Roberts 2018, "The Unreasonable Effectiveness of
# Quasirandom Sequences").
R2 = np.array([0.7548776662466927, 0.5698402909980532])
