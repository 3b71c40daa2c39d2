"""Denoises a finished picture with Open Image Denoise (Áfra 2019), a neural network that reads albedo and normal, too.

The smooth picture is mixed with the noisy one where the two differ by more than noise explains, after Firmino et al.
2022, "Progressive Denoising of Monte Carlo Rendered Images". So the result converges with the samples.
Departures: the shares of the two come from means over a window, not from a second network. The picture is scaled by a
power of two first, so that twice the light gives exactly twice the picture.
"""

from __future__ import annotations

import importlib
import importlib.util
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import GiError

PACKAGE = "pyoidn"
# Half the width of the window in which bias and noise are compared, and the multiple of the variance that counts as
# noise. relMSE over six scenes with 4 to 256 samples: radius 2 has up to 2.4 times that of 4 in the corridor, whose
# noise is rare bright dots, 8 up to 1.8 times on metal. With caution 1, the corridor at 4 samples has 1.8 times the
# relMSE of the smooth picture alone, with 2 at most 1.03 times, for which Sponza and metal have up to 1.2 times theirs.
RADIUS, CAUTION = 4, 2.0


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


def denoised(radiance: NDArray, albedo: NDArray, normal: NDArray, standard_error: NDArray) -> NDArray[np.float32]:
    """Return linear `radiance` (h, w, 3) with less noise, W/(m2 sr); its `standard_error` in the same unit.

    `albedo` in 0 to 1 and `normal` (h, w, 3) are those of the surfaces in view, without noise, averaged over each pixel
    as the radiance is. The result is slightly biased. Raises GiError as `require_denoiser`, and if the library fails.
    """
    oidn = require_denoiser()
    color = np.asarray(radiance, np.float32)
    mean = float(color.mean(dtype=np.float64))
    if not mean > 0.0:
        return color.copy()
    # Bring the mean to between 1/2 and 1.
    exponent = np.frexp(mean)[1]
    noisy, error = (np.ldexp(np.asarray(layer, np.float32), -exponent) for layer in (color, standard_error))
    features = [np.ascontiguousarray(feature, np.float32) for feature in (albedo, normal)]
    try:
        smooth = oidn.denoise(noisy, *features, hdr=True, clean_aux=True)
    except RuntimeError as failure:
        raise GiError(f"Open Image Denoise failed ({failure})") from None
    return np.ldexp(_mixed(noisy, smooth, error), exponent).astype(np.float32)


def _mixed(noisy: NDArray, smooth: NDArray, error: NDArray) -> NDArray[np.float64]:
    """Return smooth + w (noisy - smooth), in which w is the share of the bias in the error of the two.

    Over a window, v = mean(error^2) estimates the variance of `noisy`, and b = mean((noisy - smooth)^2) - CAUTION v, if
    positive, the squared bias of `smooth`; w = b / (b + v) minimises the expected error.
    """
    difference = noisy.astype(np.float64) - smooth
    distance = _window_mean((difference**2).sum(-1))
    variance = _window_mean((error.astype(np.float64) ** 2).sum(-1))
    bias = np.maximum(distance - CAUTION * variance, 0.0)
    total = bias + variance
    share = np.divide(bias, total, out=np.zeros_like(total), where=total > 0.0)
    return smooth + share[..., None] * difference


def _window_mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the mean of (h, w) over the window about each pixel; beyond the picture, its border repeats.

    It adds the values one by one: differences of running sums would lose dark pixels beside bright ones.
    """
    for axis in (0, 1):
        padded = np.pad(values, [(RADIUS, RADIUS) if axis == a else (0, 0) for a in (0, 1)], mode="edge")
        count = values.shape[axis]
        shifted = [np.take(padded, range(k, k + count), axis) for k in range(2 * RADIUS + 1)]
        values = np.sum(shifted, axis=0) / len(shifted)
    return values
