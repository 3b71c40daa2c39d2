"""How far a picture is from the truth, on linear radiance: relMSE, bias, percentile of the error, FLIP.

Departures: relMSE, the percentile and the bias are independent of exposure, by a floor relative to the mean of the
truth, not an absolute one as is common.
"""

from __future__ import annotations

import importlib

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import GiError


def relmse(image: ArrayLike, truth: ArrayLike, noise: ArrayLike | None = None, mask: ArrayLike | None = None) -> float:
    """Return mean((x - t)^2 / (t^2 + 0.01 m^2)), m the mean of the truth.

    `image` x and `truth` t are (h, w, 3) linear radiance, `mask` (h, w) booleans of the pixels that count. `noise` is
    the standard error of the truth, (h, w, 3): its share is subtracted, so that an image as good as the truth has 0
    on average (and may be slightly negative). Raises GiError for differing shapes, an empty mask or NaN and Inf.
    """
    x, t, m = _prepared(image, truth, mask)
    squared = (x - t) ** 2
    if noise is not None:
        squared = squared - _prepared(noise, truth, mask)[0] ** 2
    return float(np.mean(squared / (t**2 + 0.01 * m**2)))


def noise_floor(noise: ArrayLike, truth: ArrayLike, mask: ArrayLike | None = None) -> float:
    """Return the relMSE that a perfect image has against a truth of standard error `noise` (h, w, 3)."""
    error, t, m = _prepared(noise, truth, mask)
    return float(np.mean(error**2 / (t**2 + 0.01 * m**2)))


def bias(image: ArrayLike, truth: ArrayLike, mask: ArrayLike | None = None) -> float:
    """Return mean(x - t) / mean(t): positive if the image is too bright. Arguments and errors as for `relmse`."""
    x, t, m = _prepared(image, truth, mask)
    return float(np.mean(x - t) / m)


def percentile_error(
    image: ArrayLike, truth: ArrayLike, percentile: float = 99.9, mask: ArrayLike | None = None
) -> float:
    """Return a high percentile of |x - t| / (t + 0.1 m), for fireflies. Arguments and errors as for `relmse`."""
    x, t, m = _prepared(image, truth, mask)
    return float(np.percentile(np.abs(x - t) / (t + 0.1 * m), percentile))


def flip(image: ArrayLike, truth: ArrayLike) -> float:
    """Return the mean LDR-FLIP (0 to 1; Andersson et al. 2020) of two linear pictures, both shown clipped at 1.

    Scale both to one fixed exposure first. Raises GiError without the package flip-evaluator.
    """
    try:
        evaluator = importlib.import_module("flip_evaluator")
    except ImportError:
        raise GiError("FLIP needs the package flip-evaluator: pip install 'wgpu_gi[bench]'") from None
    x, t = (np.clip(np.asarray(a, np.float32), 0, 1) for a in (image, truth))
    _prepared(x, t, None)
    _, mean, _ = evaluator.evaluate(t, x, "LDR", inputsRGB=False, computeMeanError=True)
    return float(mean)


def _prepared(
    image: ArrayLike, truth: ArrayLike, mask: ArrayLike | None
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Return both as float64 (pixels, channels) and the mean of the truth over the pixels that count."""
    x, t = np.asarray(image, np.float64), np.asarray(truth, np.float64)
    if x.shape != t.shape or x.size == 0:
        raise GiError(f"pictures of shape {x.shape} and {t.shape} cannot be compared; render both at the same size")
    if mask is not None:
        chosen = np.asarray(mask, bool)
        if chosen.shape != t.shape[: chosen.ndim] or not chosen.any():
            raise GiError(f"the mask of shape {chosen.shape} selects no pixel of a picture of shape {t.shape}")
        x, t = x[chosen], t[chosen]
    if not (np.isfinite(x).all() and np.isfinite(t).all()):
        raise GiError("a picture with NaN or infinite values cannot be measured")
    mean = float(t.mean())
    if mean <= 0:
        raise GiError("a truth that is black has no relative error; measure another layer")
    return x, t, mean
