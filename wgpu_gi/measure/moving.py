"""Metrics of moving pictures: flicker, lag, and ghosts behind what moved.

All are relative to the technique's own converged pictures of the same views, so that they measure motion alone. The
floors of relative errors are those of `metrics`, with m the mean of the truth.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..pictures.color import REC709_LUMINANCE

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

REACHED = 0.9  # share of a step of light that ends its lag
# Two pixels show the same point of a surface if their planes are at most this share of the distance apart, and the
# points this share: a pixel is far smaller, its neighbour at a grazing angle hardly farther.
SAME_PLANE, SAME_PLACE = 0.005, 0.05


def relative_errors(picture: NDArray[np.float32], truth: NDArray[np.float32]) -> Array:
    """Return (x - t) / (t + 0.1 m) of the luminance, (h, w), for linear pictures (h, w, 3)."""
    x, t = (np.asarray(p, np.float64) @ REC709_LUMINANCE for p in (picture, truth))
    floor = 0.1 * float(t.mean())
    return np.asarray((x - t) / (t + floor) if floor > 0 else np.zeros_like(t))


def flicker(errors: NDArray[np.floating], seen: Mask) -> float | None:
    """Return the mean over points of the variance over frames; None if no point is seen in all frames.

    errors: `relative_errors` at the same points in each frame, (frames, points), two frames or more. seen: of the same
    shape.
    """
    always: Mask = np.logical_and.reduce(seen)
    return float(np.var(errors[:, always], axis=0, ddof=1).mean()) if always.any() else None


def lag(progress: Sequence[float]) -> int:
    """Return how many frames pass until a step of light is, and stays, 90 % there; len + 1 if it never is.

    progress: share of the step in each frame; the first frame is the first that has the new light.
    """
    below = [number for number, share in enumerate(progress, 1) if share < REACHED]
    return (below[-1] if below else 0) + 1


def squared_errors(picture: NDArray[np.float32], truth: NDArray[np.float32]) -> Array:
    """Return (x - t)^2 / (t^2 + 0.01 m^2), the mean of the channels, (h, w), for linear pictures (h, w, 3)."""
    x, t = np.asarray(picture, np.float64), np.asarray(truth, np.float64)
    floor = 0.01 * float(t.mean()) ** 2
    return np.asarray(((x - t) ** 2 / (t**2 + floor)).mean(-1) if floor > 0 else np.zeros(t.shape[:2]))


class Seen:
    """The surfaces that a frame shows: world positions and normals (h, w, 3), and where there is one (h, w)."""

    def __init__(
        self, camera: Camera, position: NDArray[np.float32], normal: NDArray[np.float32], surface: Mask
    ) -> None:
        self.camera = camera
        self.position, self.normal = np.asarray(position, np.float64), np.asarray(normal, np.float64)
        self.surface = surface

    def places(self, points: Array) -> Array:
        """Return where world points (..., 3) are in the picture: pixels (..., 2), NaN behind the camera."""
        height, width = self.surface.shape
        clip = self.camera.clip_from_world((width, height), np.zeros(3), 1e-3, 1e9)
        projected = points @ clip[:, :3].T + clip[:, 3]
        w = projected[..., 3:]
        with np.errstate(divide="ignore", invalid="ignore"):
            ndc = np.where(w > 0, projected[..., :2] / w, np.nan)
        return np.asarray((ndc * (0.5, -0.5) + 0.5) * (width, height) - 0.5)

    def shows(self, points: Array, normals: Array) -> tuple[Mask, NDArray[np.int64]]:
        """Return whether this frame shows surface points (n, 3), and the row and column nearest to each (n, 2)."""
        height, width = self.surface.shape
        places = np.round(np.nan_to_num(self.places(points), nan=-1.0, posinf=-1.0, neginf=-1.0))[:, ::-1]
        inside = np.asarray(((places >= 0) & (places < (height, width))).all(-1))
        pixels = np.where(inside[:, None], places, 0).astype(np.int64)
        found = self.position[tuple(pixels.T)] - points
        distance = np.linalg.norm(points - self.camera.position, axis=-1)
        off_plane, off_place = np.abs((found * normals).sum(-1)), np.linalg.norm(found, axis=-1)
        same = (off_plane <= SAME_PLANE * distance) & (off_place <= SAME_PLACE * distance)
        return np.asarray(inside & same & self.surface[tuple(pixels.T)]), pixels


def revealed(now: Seen, before: Seen, points_before: Array, ages: NDArray[np.int64] | None) -> NDArray[np.int64]:
    """Return for how many frames each pixel's surface point has been in view, (h, w); 0: the last frame hid it.

    points_before: where the surface points of `now` were in the last frame, world, (h, w, 3). ages: the result for
    the last frame; None if it was the first, whose points count as old.
    """
    height, width = now.surface.shape
    old = np.iinfo(np.int64).max // 2
    shown, pixels = before.shows(points_before.reshape(-1, 3), now.normal.reshape(-1, 3))
    last = np.full((height, width), old) if ages is None else ages
    found = np.where(shown, last[tuple(pixels.T)] + 1, 0).reshape(height, width)
    return np.where(now.surface, found, old)
