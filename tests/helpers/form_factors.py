"""Closed forms of form factors."""

from __future__ import annotations

import math

import numpy as np


def polygon_form_factor(corners, points, normal):
    """Return the form factor from points (n, 3) to a polygon wholly above their plane (Lambert 1760).

    F = 1 / 2 pi sum_i angle_i cos_i, over the polygon's edges.
    """
    rays = corners - points[:, None]
    rays /= np.linalg.norm(rays, axis=2, keepdims=True)
    others = np.roll(rays, -1, axis=1)
    angles = np.arccos(np.clip((rays * others).sum(2), -1, 1))
    across = np.cross(rays, others)
    across /= np.linalg.norm(across, axis=2, keepdims=True)
    return np.abs((angles * (across @ normal)).sum(1)) / (2 * math.pi)
