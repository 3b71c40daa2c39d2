"""Errors of a picture against a truth, on linear radiance: relMSE, bias, percentile of the error, FLIP.

FLIP: Andersson et al. 2020. Departures: all measures are independent of exposure. The floor of relMSE and of the
percentile is relative to the mean of the truth; an absolute floor is common. FLIP takes its exposure from the truth.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import GiError
from ..pictures.color import REC709_LUMINANCE
from ..pictures.image import Array

MIDDLE_GREY = 0.18  # displayed mean luminance of the truth: the reflectance of a photographer's grey card
MOST_REGIONS = 64  # a mask with more distinct values has smooth edges, or is a picture


@dataclass(frozen=True)
class Errors:
    """The result of `measure`."""

    pixels: int
    relmse: float  # minus the noise floor, if the noise of the truth is known
    floor: float | None  # the relMSE of a perfect picture, None if the noise of the truth is unknown
    bias: float  # a fraction, not percent
    percentile: float  # 99.9th
    flip: float | None  # mean, None without a map


def measure(
    image: ArrayLike,
    truth: ArrayLike,
    noise: ArrayLike | None = None,
    mask: ArrayLike | None = None,
    flip_error: ArrayLike | None = None,
) -> Errors:
    """Return every measure; `flip_error` is the result of `flip_map`. Arguments and errors as for `relmse`."""
    chosen = np.ones(np.shape(truth)[:2], bool) if mask is None else np.asarray(mask, bool)
    return Errors(
        pixels=int(chosen.sum()),
        relmse=relmse(image, truth, noise, mask),
        floor=None if noise is None else noise_floor(noise, truth, mask),
        bias=bias(image, truth, mask),
        percentile=percentile_error(image, truth, mask=mask),
        flip=None if flip_error is None else float(np.asarray(flip_error)[chosen].mean()),
    )


def relmse(image: ArrayLike, truth: ArrayLike, noise: ArrayLike | None = None, mask: ArrayLike | None = None) -> float:
    """Return mean((x - t)^2 / (t^2 + 0.01 m^2)), m the mean of the truth.

    `image` x and `truth` t are linear radiance, (h, w, 3) or (h, w). `mask` (h, w) selects the pixels that count; m is
    the mean over these. `noise` is the standard error of the truth, of the same shape. Its share is subtracted, so that
    a perfect image has 0 on average (and may be slightly negative). Raises GiError for differing shapes, an empty mask,
    a black truth, or NaN and Inf.
    """
    x, t, m = _prepared(image, truth, mask)
    squared = (x - t) ** 2
    if noise is not None:
        squared = squared - _prepared(noise, truth, mask)[0] ** 2
    return float(np.mean(squared / (t**2 + 0.01 * m**2)))


def noise_floor(noise: ArrayLike, truth: ArrayLike, mask: ArrayLike | None = None) -> float:
    """Return the relMSE of a perfect image against a truth of standard error `noise` (same shape)."""
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
    return float(np.percentile(_relative(x, t, m), percentile))


def relative_error(image: ArrayLike, truth: ArrayLike) -> Array:
    """Return |x - t| / (t + 0.1 m) at every pixel, (h, w), the mean of the channels. Errors as for `relmse`."""
    _, _, m = _prepared(image, truth, None)
    error = _relative(np.asarray(image, np.float64), np.asarray(truth, np.float64), m)
    return (error.mean(-1) if error.ndim == 3 else error).astype(np.float32)


def flip(image: ArrayLike, truth: ArrayLike, mask: ArrayLike | None = None) -> float:
    """Return the mean of `flip_map`, over `mask` (h, w) if one is given."""
    error = flip_map(image, truth)
    return float((error if mask is None else error[np.asarray(mask, bool)]).mean())


def flip_map(image: ArrayLike, truth: ArrayLike) -> Array:
    """Return LDR-FLIP (Andersson et al. 2020) at every pixel, (h, w), from 0 (equal) to 1 (black against white).

    Both pictures are scaled by `display_scale(truth)` and clipped to [0, 1]; FLIP assumes its default of 67 pixels per
    degree. Raises GiError without the package flip-evaluator, and as `relmse`.
    """
    _prepared(image, truth, None)
    try:
        evaluator = importlib.import_module("flip_evaluator")
    except ImportError:
        raise GiError("FLIP needs a package: pip install flip-evaluator") from None
    scale = display_scale(truth)
    x, t = (np.clip(in_color(picture) * scale, 0.0, 1.0).astype(np.float32) for picture in (image, truth))
    error, _, _ = evaluator.evaluate(t, x, "LDR", inputsRGB=False, applyMagma=False)
    return np.asarray(error, np.float32)[..., 0]


def display_scale(truth: ArrayLike) -> float:
    """Return the factor that brings the mean luminance of the truth to 0.18: one fixed exposure for both pictures."""
    mean = float((in_color(truth) @ REC709_LUMINANCE).mean())
    if not (np.isfinite(mean) and mean > 0):
        raise GiError("a truth that is black, or holds NaN or Inf, sets no exposure; measure another layer")
    return MIDDLE_GREY / mean


def in_color(picture: ArrayLike) -> NDArray[np.float64]:
    """Return a picture (h, w, 3) or (h, w) as (h, w, 3)."""
    values = np.asarray(picture, np.float64)
    return values if values.ndim == 3 else np.repeat(values[..., None], 3, axis=-1)


def regions(labels: ArrayLike) -> dict[str, NDArray[np.bool_]]:
    """Return a mask (h, w) for each distinct value of `labels`, (h, w) or (h, w, 3), in the order of the values.

    The name is the value: "2", or "255,0,0" where channels differ. Raises GiError for more than 64 values.
    """
    values = np.asarray(labels)
    grey = values if values.ndim == 2 else values[..., 0]
    if values.ndim == 2 or (values == values[..., :1]).all():
        distinct, index = np.unique(grey, return_inverse=True)
    else:
        distinct, index = np.unique(values.reshape(-1, values.shape[2]), axis=0, return_inverse=True)
    if len(distinct) > MOST_REGIONS:
        raise GiError(f"the mask has {len(distinct)} distinct values (regions); at most {MOST_REGIONS} are supported")
    index = index.reshape(grey.shape)
    names = [",".join(f"{value:.9g}" for value in np.atleast_1d(row)) for row in distinct]
    return {name: index == i for i, name in enumerate(names)}


def _relative(x: NDArray[np.float64], t: NDArray[np.float64], m: float) -> NDArray[np.float64]:
    """Return |x - t| / (|t| + 0.1 m); some filters leave a negative truth, so its magnitude counts."""
    return np.abs(x - t) / (np.abs(t) + 0.1 * m)


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
