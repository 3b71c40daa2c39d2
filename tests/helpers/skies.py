"""Environment maps: a gradient sky, bilinear lookup by direction, and brute-force integrals over the sphere."""

from __future__ import annotations

import numpy as np


def sphere_grid(rows: int = 512) -> tuple[np.ndarray, np.ndarray]:
    """Return the directions (n, 3) of a latitude-longitude grid and the exact solid angles of its cells, (n,)."""
    columns = 2 * rows
    theta, phi = np.meshgrid((np.arange(rows) + 0.5) / rows * np.pi, (np.arange(columns) + 0.5) / columns * 2 * np.pi)
    d = np.stack([np.sin(theta) * np.sin(phi), np.cos(theta), -np.sin(theta) * np.cos(phi)], -1)
    return d.reshape(-1, 3), (2 * np.sin(theta) * np.sin(np.pi / rows / 2) * 2 * np.pi / columns).ravel()


def radiance(image: np.ndarray, directions: np.ndarray, rotation: float = 0.0) -> np.ndarray:
    """Return the bilinearly filtered radiance of a map: u = atan2(x, -z)/2pi + rotation/2pi, v = acos(y)/pi."""
    d = np.asarray(directions, np.float64)
    height, width = image.shape[:2]
    u = (np.arctan2(d[..., 0], -d[..., 2]) + rotation) / (2 * np.pi)
    v = np.arctan2(np.hypot(d[..., 0], d[..., 2]), d[..., 1]) / np.pi
    x, y = (u % 1) * width - 0.5, v * height - 0.5
    x0, y0 = np.floor(x).astype(int), np.floor(y).astype(int)
    fx, fy = (x - x0)[..., None], (y - y0)[..., None]
    rows, columns = [np.clip(y0 + k, 0, height - 1) for k in (0, 1)], [(x0 + k) % width for k in (0, 1)]
    top, low = (image[r, columns[0]] * (1 - fx) + image[r, columns[1]] * fx for r in rows)
    return top * (1 - fy) + low * fy


def gradient_sky(height: int = 64, sun: float = 0.0) -> np.ndarray:
    """Return a map of brown ground, a sky that is bluer and darker towards the zenith, and a sun of that radiance."""
    width = 2 * height
    y, x = np.mgrid[:height, :width]
    theta, phi = (y + 0.5) / height * np.pi, (x + 0.5) / width * 2 * np.pi
    up = np.cos(theta)[..., None]
    sky = np.array([1.0, 1.0, 1.0]) + np.clip(up, 0, 1) * np.array([-0.8, -0.6, -0.2])
    ground = np.array([0.3, 0.25, 0.2]) * np.ones_like(sky)
    blend = np.clip(up / 0.2 + 0.5, 0, 1)
    image = ground + (sky - ground) * blend + 0.2 * (1 + np.sin(phi) * np.sin(theta))[..., None]
    image[height // 4, width // 3] += sun * np.array([1.0, 0.9, 0.8])
    return image.astype(np.float32)
