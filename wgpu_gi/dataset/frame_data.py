"""What a data set knows of one frame: arrays for every pixel, the objects in view, and the camera.

Arrays are (height, width) or (height, width, channels), row 0 on top; the centre of pixel (x, y) lies at (x + 0.5,
y + 0.5), in pixels from the top left corner of the picture. Boxes are (x, y, width, height) in the same coordinates,
so that the box of the pixel (3, 2) alone is (3, 2, 1, 1).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Box = tuple[float, float, float, float]  # x, y, width, height: pixels from the top left corner of the picture


@dataclass(frozen=True)
class ObjectData:
    """An object of a frame: what is seen of it, and where all of it would be seen without anything in front."""

    id: int  # its value in FrameData.instance, from 1
    name: str
    category: int  # a key of FrameData.categories; 0: none
    visible_pixels: int
    amodal_pixels: int | None = None  # pixels of the picture that it would cover alone
    visible_fraction: float | None = None  # visible_pixels / amodal_pixels
    box: Box | None = None  # of its visible pixels; None: no pixel shows it
    amodal_box: Box | None = None  # of its projected vertices, beyond the picture, too; None: it reaches behind the eye
    amodal_box_clipped: Box | None = None  # of the pixels that it would cover alone


@dataclass(frozen=True)
class FrameData:
    """A frame. An array is None if nobody asked for it.

    `cameras` holds float64 matrices by name, see `dataset.matrices`.
    """

    size: tuple[int, int]  # width, height in pixels
    picture: NDArray[np.float32] | None = None  # (h, w, 3), linear Rec.709 radiance, W/(m2 sr)
    direct: NDArray[np.float32] | None = None  # (h, w, 3), emission, and light reflected once
    indirect: NDArray[np.float32] | None = None  # (h, w, 3), the rest of the picture
    standard_error: NDArray[np.float32] | None = None  # (h, w, 3), of the picture's noise
    depth_ray: NDArray[np.float32] | None = None  # (h, w), metres along the ray; 0 where nothing is seen
    depth_z: NDArray[np.float32] | None = None  # (h, w), metres along the camera's axis; 0 where nothing is seen
    normal: NDArray[np.float32] | None = None  # (h, w, 3), unit length, world space
    albedo: NDArray[np.float32] | None = None  # (h, w, 3), linear
    instance: NDArray[np.int32] | None = None  # (h, w), ObjectData.id; 0 where nothing is seen
    category: NDArray[np.int32] | None = None  # (h, w), a key of `categories`; 0: none
    flow: NDArray[np.float32] | None = None  # (h, w, 2), pixels to the right and down to the second time
    occlusion: NDArray[np.bool_] | None = None  # (h, w), true where the second time does not show the point
    objects: list[ObjectData] = field(default_factory=list)
    categories: dict[int, str] = field(default_factory=dict)  # names by id, from 1
    cameras: dict[str, NDArray[np.float64]] = field(default_factory=dict)

    def arrays(self) -> dict[str, NDArray]:
        """Return the arrays that are there, by name."""
        values = {name: getattr(self, name) for name in ARRAYS}
        return {name: value for name, value in values.items() if value is not None}


ARRAYS = (
    "picture",
    "direct",
    "indirect",
    "standard_error",
    "depth_ray",
    "depth_z",
    "normal",
    "albedo",
    "instance",
    "category",
    "flow",
    "occlusion",
)
