"""Denoises a finished picture with Open Image Denoise (Áfra 2019), a neural network that reads albedo and normal, too.

Departures: the network errs by how light the picture is; here the picture is scaled by a power of two first, so that
twice the light gives exactly twice the picture.
"""

from __future__ import annotations

import importlib
import importlib.util
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import GiError

PACKAGE = "pyoidn"


def has_denoiser() -> bool:
    """Return whether Open Image Denoise is installed."""
    return importlib.util.find_spec(PACKAGE) is not None


def require_denoiser() -> Any:
    """Return the module of Open Image Denoise. Raises GiError if it is not installed or does not run here."""
    try:
        return importlib.import_module(PACKAGE)
    except ImportError:
        raise GiError(f"denoising needs a package: pip install {PACKAGE}") from None
    except OSError as error:
        raise GiError(f"the package {PACKAGE} does not run on this machine ({error})") from None


def denoised(radiance: NDArray, albedo: NDArray, normal: NDArray) -> NDArray[np.float32]:
    """Return linear `radiance` (h, w, 3) without noise, W/(m2 sr).

    `albedo` in 0 to 1 and `normal` (h, w, 3) are those of the surfaces in view, without noise, averaged over each pixel
    as the radiance is. The result is smooth and slightly biased. Raises GiError as `require_denoiser`, and if the
    library fails.
    """
    oidn = require_denoiser()
    color = np.asarray(radiance, np.float32)
    mean = float(color.mean(dtype=np.float64))
    if not mean > 0.0:
        return color.copy()
    # Bring the mean to between 1/2 and 1.
    exponent = np.frexp(mean)[1]
    scaled = np.ldexp(color, -exponent)
    features = [np.ascontiguousarray(feature, np.float32) for feature in (albedo, normal)]
    try:
        smooth = oidn.denoise(scaled, *features, hdr=True, clean_aux=True)
    except RuntimeError as error:
        raise GiError(f"Open Image Denoise failed ({error})") from None
    return np.ldexp(smooth, exponent).astype(np.float32)
