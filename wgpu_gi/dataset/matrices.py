"""The matrices of a camera as computer vision and OpenGL state them, by name: `target_from_source`.

    opencv_pixel_from_camera    K, 3x3: (x, y, z) in the camera to (u z, v z, z); absent if the camera is orthographic
    opencv_camera_from_world    4x4, rigid; camera: +X right, +Y down, looks along +Z
    opencv_world_from_camera    4x4, its inverse
    opengl_view_from_world      4x4, rigid; view: +X right, +Y up, looks along -Z
    opengl_world_from_view      4x4, its inverse
    opengl_clip_from_view       4x4; x / w, y / w and z / w from -1 to 1, +Y up, z / w = -1 at the near plane

They multiply column vectors; the world is the scene's: metres, +Y up. Pixels (u, v) are measured from the top left
corner of the picture, to the right and down, so that pixel (i, j) has its centre at (i + 0.5, j + 0.5) and the
principal point is (width / 2, height / 2). Programs that put the centre of the first pixel at (0, 0), as OpenCV's
functions do, take K with 0.5 less in the last column. The far plane of perspective cameras is at infinity.

Source: R. Hartley and A. Zisserman, "Multiple View Geometry in Computer Vision", section 6.1; OpenGL 4.6, section 13.8.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera

# Distances of the clipping planes, metres: only the depth of `opengl_clip_from_view` depends on them.
NEAR = 0.01
ORTHOGRAPHIC_FAR = 10_000.0  # of an orthographic camera; that of a perspective camera is infinite
FLIPPED = np.diag([1.0, -1.0, -1.0, 1.0])  # between OpenCV's axes and OpenGL's


def matrices(camera: Camera, size: tuple[int, int]) -> dict[str, NDArray[np.float64]]:
    """Return the matrices of a camera for a picture of `size` (width, height) pixels."""
    width, height = size
    world_from_view = np.array(camera.world_from_view, np.float64)
    view_from_world = _inverse(world_from_view)
    known = {
        "opencv_camera_from_world": FLIPPED @ view_from_world,
        "opencv_world_from_camera": world_from_view @ FLIPPED,
        "opengl_view_from_world": view_from_world,
        "opengl_world_from_view": world_from_view,
    }
    clip = np.zeros((4, 4))
    if camera.orthographic_height is None:
        focal = height / 2 / math.tan(camera.yfov / 2)
        clip[0, 0], clip[1, 1] = 2 * focal / width, 2 * focal / height
        clip[2, 2], clip[2, 3], clip[3, 2] = -1.0, -2 * NEAR, -1.0
        pixel_from_camera = np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1.0]])
        return {"opencv_pixel_from_camera": pixel_from_camera, **known, "opengl_clip_from_view": clip}
    clip[0, 0] = 2 / (camera.orthographic_height * width / height)
    clip[1, 1] = 2 / camera.orthographic_height
    clip[2, 2], clip[3, 3] = -2 / (ORTHOGRAPHIC_FAR - NEAR), 1.0
    clip[2, 3] = -(ORTHOGRAPHIC_FAR + NEAR) / (ORTHOGRAPHIC_FAR - NEAR)
    return {**known, "opengl_clip_from_view": clip}


def _inverse(rigid: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the inverse of a rotation and a translation."""
    inverse = np.eye(4)
    inverse[:3, :3] = rigid[:3, :3].T
    inverse[:3, 3] = -rigid[:3, :3].T @ rigid[:3, 3]
    return inverse
