"""The camera: its pose, its lens and its projection matrix.

World space is right-handed with Y up; the camera looks along its -Z. Clip depth is reversed and infinite: 1 at the near
plane, 0 at infinity (Upchurch and Desbrun 2012, "Tightening the Precision of Perspective Rendering").
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .errors import GiError
from .float_limits import LARGEST_YFOV, MAX_COORDINATE, SMALLEST_YFOV
from .records import KnownAttributes

YFOV_DEG = math.degrees(SMALLEST_YFOV), math.degrees(LARGEST_YFOV)  # range of full vertical angles


class Window(NamedTuple):
    """Which part of a larger picture a picture is: its first pixel in it (x, y), and the size of the `whole`.

    A camera's angle, height and projection are those of the whole.
    """

    corner: tuple[int, int]
    whole: tuple[int, int]


@dataclass(repr=False, slots=True)
class Camera(KnownAttributes):
    """A pinhole or orthographic camera.

    `world_from_view` is a rigid (4, 4) float64 transform (no scale), `yfov` the full vertical angle in radians. With
    `orthographic_height`, the height of the picture in metres, the projection is orthographic and `yfov` is unused.
    """

    world_from_view: NDArray[np.float64] = field(default_factory=lambda: np.eye(4))
    yfov: float = math.radians(60.0)
    orthographic_height: float | None = None
    name: str = ""

    @classmethod
    def look_at(
        cls,
        position: Sequence[float],
        target: Sequence[float],
        up: Sequence[float] = (0.0, 1.0, 0.0),
        yfov_deg: float = 60.0,
        name: str = "",
    ) -> Camera:
        """Return a perspective camera at `position` (metres) that looks at `target`.

        An `up` parallel to the view direction is replaced by another axis. Raises GiError if position and target
        coincide, a value is not finite or out of range, or the angle is not between 0 and 180 degrees.
        """
        # Check the arguments.
        eye, aim = _point(name, "position", position), _point(name, "target", target)
        upward = _point(name, "up", up, math.inf)
        upward /= max(float(np.abs(upward).max()), 1e-300)
        if not isinstance(yfov_deg, (int, float, np.number)) or not YFOV_DEG[0] <= yfov_deg <= YFOV_DEG[1]:
            raise GiError(f"camera {name!r}: yfov_deg must lie between {YFOV_DEG[0]:.4f} and {YFOV_DEG[1]:.4f} degrees")
        # Build the axes: the camera's +Z points away from the target.
        back = eye - aim
        length = float(np.linalg.norm(back))
        if length == 0.0:
            raise GiError(f"camera {name!r}: position and target are the same point; move one of them")
        back /= length
        right = np.cross(upward, back)
        if np.linalg.norm(right) < 1e-9:
            # The view is parallel to `up`: use -Z for a vertical view (a camera tilted down from the front), else +Y.
            right = np.cross((0.0, 0.0, -1.0) if abs(back[1]) > 0.5 else (0.0, 1.0, 0.0), back)
        right /= np.linalg.norm(right)
        world_from_view = np.eye(4)
        world_from_view[:3, 0] = right
        world_from_view[:3, 1] = np.cross(back, right)
        world_from_view[:3, 2] = back
        world_from_view[:3, 3] = eye
        return cls(world_from_view, math.radians(yfov_deg), None, name)

    @property
    def position(self) -> NDArray[np.float64]:
        """World position, (3,) metres."""
        return self.world_from_view[:3, 3]

    def clip_from_world(
        self,
        size: tuple[int, int],
        origin: NDArray[np.float64],
        near: float,
        far: float,
        offset: tuple[float, float] = (0.5, 0.5),
    ) -> NDArray[np.float64]:
        """Return the (4, 4) projection of positions relative to `origin` for a picture of `size` (width, height).

        Perspective depth is near / view depth; orthographic depth falls from 1 at the camera to 0 at `far` metres.
        `offset` is the position of the sample inside its pixel (subpixel jitter); (0.5, 0.5) is the centre.
        """
        half_height = np.tan(self.yfov / 2) if self.orthographic_height is None else self.orthographic_height / 2
        half_width = half_height * size[0] / size[1]
        axes = self.world_from_view[:3, :3].T * [[1.0], [1.0], [-1.0]]  # right, up, forward
        view = np.column_stack([axes, axes @ (np.asarray(origin, np.float64) - self.position)])
        # Project x and y, then depth.
        clip = np.zeros((4, 4))
        clip[0], clip[1] = view[0] / half_width, view[1] / half_height
        if self.orthographic_height is None:
            clip[2, 3], clip[3] = near, view[2]
        else:
            clip[2], clip[3, 3] = -view[2] / far, 1.0
            clip[2, 3] += 1.0
        # Shift by the offset from the pixel's centre.
        clip[0] += (1.0 - 2.0 * offset[0]) / size[0] * clip[3]
        clip[1] -= (1.0 - 2.0 * offset[1]) / size[1] * clip[3]
        return clip


def _point(camera: str, label: str, value: Sequence[float], limit: float = MAX_COORDINATE) -> NDArray[np.float64]:
    """Return three finite numbers of at most `limit`. Raises GiError for anything else."""
    try:
        numbers = np.array(value, np.float64)
    except (TypeError, ValueError, OverflowError):
        numbers = np.zeros(0)
    if numbers.shape != (3,) or not np.isfinite(numbers).all() or np.abs(numbers).max() > limit:
        most = "" if limit == math.inf else f" of at most {limit:g} m"
        raise GiError(f"camera {camera!r}: {label} must be three finite numbers{most}")
    return numbers
