"""The sky of scenes without light: the CIE overcast sky above a grey ground, both without colour.

Moon and Spencer, "Illumination from a non-uniform sky", Illuminating Engineering 37 (1942); CIE S 011/E:2003, type 16:
the radiance at elevation g is L(g) = L_z (1 + 2 sin g) / 3, and the irradiance of level ground 7 pi L_z / 9. That is
pi here, so a level, unoccluded, matte surface of albedo rho has radiance rho. A uniform sky would hide white objects,
which have its radiance from all sides.
"""

from __future__ import annotations

import numpy as np

from .scene import Environment

ZENITH = 9 / 7  # radiance L_z, W/(m2 sr)
GROUND = 0.2  # radiance of the ground: the albedo of soil and grass (Liu and Jordan 1963) times pi / pi
_ROWS = 64  # of the image: the horizon is blurred over 3 degrees


def default_sky() -> Environment:
    """Return the sky as an equirectangular image."""
    # Average the sky over each row, as the texture's texels are.
    fine = (np.arange(_ROWS * 8) + 0.5) / (_ROWS * 8)
    height = np.cos(np.pi * fine)  # sine of the elevation
    radiance = np.where(height > 0.0, ZENITH * (1.0 + 2.0 * height) / 3.0, GROUND).reshape(_ROWS, 8).mean(axis=1)
    image = np.broadcast_to(radiance[:, None, None], (_ROWS, 2 * _ROWS, 3))
    return Environment(image=np.ascontiguousarray(image, np.float32), name="default sky")
