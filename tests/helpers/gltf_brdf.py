"""The glTF 2.0 metallic-roughness BRDF in numpy, written from appendix B.3.5 of its specification."""

from __future__ import annotations

import numpy as np


def gltf_brdf(
    base_color: np.ndarray, metallic: float, alpha: float, n: np.ndarray, w_o: np.ndarray, w_i: np.ndarray
) -> np.ndarray:
    """Return f_r, (..., 3) in 1/sr, for unit vectors (..., 3); `alpha` is roughness squared."""
    n, w_o, w_i = (np.asarray(v, np.float64) for v in (n, w_o, w_i))
    base = np.asarray(base_color, np.float64)
    h = w_o + w_i
    h = h / np.linalg.norm(h, axis=-1, keepdims=True)
    n_h, n_i, n_o, h_o = ((a * b).sum(-1)[..., None] for a, b in ((n, h), (n, w_i), (n, w_o), (h, w_o)))
    a2 = alpha * alpha
    distribution = a2 / (np.pi * (n_h**2 * (a2 - 1) + 1) ** 2)
    root_i, root_o = np.sqrt(a2 + (1 - a2) * n_i**2), np.sqrt(a2 + (1 - a2) * n_o**2)
    visibility = 0.5 / (n_i * root_o + n_o * root_i)
    c_diffuse, f0 = base * (1 - metallic), 0.04 * (1 - metallic) + base * metallic
    fresnel = f0 + (1 - f0) * (1 - np.abs(h_o)) ** 5
    f = (1 - fresnel) * c_diffuse / np.pi + fresnel * distribution * visibility
    return np.where((n_i > 0) & (n_o > 0), f, 0.0)
