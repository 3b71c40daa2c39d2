"""Rays through pixel centres and projections of points, in float64: the camera of `wgsl/scene/info.wgsl`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera

Array = NDArray[np.float64]


def forward_of(camera: Camera) -> Array:
    """Return the unit direction in which a camera looks, (3,)."""
    forward: Array = -np.asarray(camera.world_from_view, np.float64)[:3, 2]
    return forward


def pixel_rays(camera: Camera, size: tuple[int, int]) -> tuple[Array, Array]:
    """Return origins and unit directions (h, w, 3) of the rays through the pixel centres, in world space, metres."""
    width, height = size
    right, up, back, position = np.asarray(camera.world_from_view, np.float64)[:3].T
    half = np.tan(camera.yfov / 2) if camera.orthographic_height is None else camera.orthographic_height / 2
    x = ((np.arange(width) + 0.5) * 2 / width - 1) * half * width / height
    y = (1 - (np.arange(height) + 0.5) * 2 / height) * half
    offsets = x[None, :, None] * right + y[:, None, None] * up
    if camera.orthographic_height is not None:
        return position + offsets, np.broadcast_to(-back, offsets.shape)
    directions = offsets - back
    directions /= np.linalg.norm(directions, axis=2, keepdims=True)
    return np.broadcast_to(position, offsets.shape), directions


def project(camera: Camera, size: tuple[int, int], points: Array) -> tuple[Array, Array]:
    """Return pixel coordinates (..., 2), from the picture's top left corner, and the depth z (...) of world points.

    Coordinates of points that a perspective camera has not in front of it, z <= 0, mean nothing.
    """
    clip = camera.clip_from_world(size, camera.position, 1.0, 1.0)
    relative = points - camera.position
    x, y = (relative @ clip[row, :3] for row in (0, 1))
    z = relative @ forward_of(camera)
    if camera.orthographic_height is None:
        with np.errstate(divide="ignore", invalid="ignore"):
            x, y = x / z, y / z
    return np.stack([(x + 1) / 2 * size[0], (1 - y) / 2 * size[1]], -1), z
