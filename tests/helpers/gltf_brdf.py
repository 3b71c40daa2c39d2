"""The BRDF of `common/brdf.wgsl` in numpy, with its directional albedos by quadrature instead of fits."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from fit_coat_albedo import MIN_ALPHA, coat_losses, hemisphere


def gltf_brdf(
    base_color: np.ndarray, metallic: float, alpha: float, n: np.ndarray, w_o: np.ndarray, w_i: np.ndarray
) -> np.ndarray:
    """Return f_r, (..., 3) in 1/sr, for unit vectors (..., 3); `alpha` is roughness squared.

    glTF's specular term (2.0, appendix B.3); multiple scattering in metals (Kulla and Conty 2017); a base that gets
    what the coat transmits both ways (Kelemen and Szirmay-Kalos 2001).
    """
    n, w_o, w_i = (np.asarray(v, np.float64) for v in (n, w_o, w_i))
    base = np.asarray(base_color, np.float64)
    h = w_o + w_i
    h = h / np.linalg.norm(h, axis=-1, keepdims=True)
    n_h, n_i, n_o, h_o = ((a * b).sum(-1)[..., None] for a, b in ((n, h), (n, w_i), (n, w_o), (h, w_o)))
    a2 = alpha * alpha
    distribution = a2 / (np.pi * (n_h**2 * (a2 - 1) + 1) ** 2)
    root_i, root_o = np.sqrt(a2 + (1 - a2) * n_i**2), np.sqrt(a2 + (1 - a2) * n_o**2)
    visibility = 0.5 / (n_i * root_o + n_o * root_i)
    f0 = 0.04 * (1 - metallic) + base * metallic
    fresnel = f0 + (1 - f0) * (1 - np.abs(h_o)) ** 5
    (missing_i, passed_i), (missing_o, passed_o) = losses(n_i, alpha), losses(n_o, alpha)
    missing, passed = mean_losses(alpha)
    again = multiple_albedo(base, metallic, missing) * missing_i * missing_o / missing
    below = base * (1 - metallic) * passed_i * passed_o / passed
    f = fresnel * distribution * visibility + (again + below) / np.pi
    return np.where((n_i > 0) & (n_o > 0), f, 0.0)


def reflectance(
    base_color: np.ndarray, metallic: np.ndarray | float, alpha: np.ndarray | float, cosine: np.ndarray | float
) -> np.ndarray:
    """Return the integral of f_r cos over the hemisphere, (n, 3); `metallic`, `alpha` and `cosine` are (n,)."""
    base = np.atleast_2d(np.asarray(base_color, np.float64))
    metallic = np.reshape(metallic, (-1, 1)).astype(np.float64)
    missing, passed = (v[:, None] for v in coat_losses(np.clip(cosine, 1e-5, 0.99999), alpha, 256, 64))
    # The two known albedos give the integrals of D V cos (1 - m^5) and D V cos m^5, m = 1 - v.h.
    by_fresnel = (1 - passed - 0.04 * (1 - missing)) / 0.96
    f0 = 0.04 * (1 - metallic) + base * metallic
    single = f0 * (1 - missing - by_fresnel) + by_fresnel
    return single + multiple_albedo(base, metallic, mean_losses(alpha)[0]) * missing + base * (1 - metallic) * passed


def multiple_albedo(base: np.ndarray, metallic: np.ndarray | float, mean_missing: np.ndarray) -> np.ndarray:
    """Return F_ms for base colours (..., 3)."""
    fresnel, missing = (20 * base + 1) / 21, np.reshape(mean_missing, (-1, 1))
    return metallic * fresnel**2 * (1 - missing) / (1 - fresnel * missing)


def losses(cosine: np.ndarray, alpha: float | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return M and T at cosines of any shape."""
    cosine = np.clip(cosine, 1e-7, 0.99999)
    if np.ndim(alpha) == 0:
        return _interpolated_losses(cosine, float(alpha))
    pairs = np.stack(np.broadcast_arrays(cosine, alpha)).reshape(2, -1).T
    values = [coat_losses(*part.T, 96, 32) for part in np.array_split(pairs, len(pairs) // 1000 + 1)]
    return tuple(np.concatenate(v).reshape(np.shape(cosine)) for v in zip(*values, strict=True))


def _interpolated_losses(cosine: np.ndarray, alpha: float) -> tuple[np.ndarray, np.ndarray]:
    return tuple(np.interp(cosine**0.25, *column) for column in _table(alpha))


@lru_cache(maxsize=64)
def _table(alpha: float) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
    root = np.linspace(0.01, 1, 300)
    return tuple((root, values) for values in coat_losses(np.minimum(root**4, 0.99999), alpha, 96, 32))


def mean_losses(alpha: float | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the cosine-weighted means of M and T over the hemisphere."""
    log_alpha, log_missing, transmitted = _means()
    at = np.log(np.asarray(alpha, np.float64))
    return np.exp(np.interp(at, log_alpha, log_missing)), np.interp(at, log_alpha, transmitted)


@lru_cache(maxsize=1)
def _means() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    mu, weights = hemisphere(40)
    alphas = np.geomspace(MIN_ALPHA, 1, 36)
    # The mean of M is 2e-5 at alpha 0.002: coarser quadrature is off by a fifth there.
    missing, transmitted = np.array([coat_losses(mu, a, 256, 64) for a in alphas]).transpose(1, 0, 2) @ weights
    return np.log(alphas), np.log(missing), transmitted
