"""Writes `transforms.json` with pictures, as Instant-NGP and nerfstudio read them, for frames of one still scene.

    images/000123.png   the picture: 8-bit sRGB, with the same exposure for all frames, and tone curve
    depth/000123.png    if depth_z is among the data: metres along the camera's axis times 1000, 16 bits; 0 where
                        nothing is seen, or farther than 65.535 m
    transforms.json     once all frames are there

`transforms.json` holds `camera_model` ("OPENCV", without distortion), `applied_transform`, `frames`, and either once
or, if the cameras differ, in each frame: `w`, `h`, `fl_x`, `fl_y` (focal lengths in pixels), `cx`, `cy` (principal
point, pixels from the top left corner), `camera_angle_x`, `camera_angle_y` (full angles, radians). Each frame has
`file_path`; `depth_file_path` (nerfstudio) and `depth_path` (Instant-NGP), with `integer_depth_scale` 0.001 once;
`record`, the values drawn for the frame; and

    transform_matrix   world from camera, 4x4, rows first. Camera: +X right, +Y up, looks along -Z (OpenGL). World:
                       metres, +Z up, so ours turned by 90 degrees: (x, y, z) there is (x, -z, y) of the scene,
                       which `applied_transform` (3x4) states.

Sources: nerfstudio's documentation, "Data conventions", and its `nerfstudio_dataparser.py`; Instant-NGP's
`nerf_loader.cu` and "Tips for training NeRF models".
"""

from __future__ import annotations

import json
import math
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from ...errors import GiError
from ..frame_data import FrameData
from .sample import Record, json_text, png
from .store import Parts, Read, Store

Z_UP_FROM_Y_UP = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]])
DEPTH_STEP = 0.001  # metres; what nerfstudio expects
LARGEST_DEPTH = 65535 * DEPTH_STEP
LENS = ("w", "h", "fl_x", "fl_y", "cx", "cy", "camera_angle_x", "camera_angle_y")


class NerfWriter:
    """Pictures, depth, and one file of cameras."""

    def __init__(self, folder: Path, frames: int, exposure: float | None) -> None:
        """Raise GiError without an exposure, since it must be the same for all frames."""
        if exposure is None:
            raise GiError("the writer nerf needs the same exposure for all frames; give it as a number of EV")
        self._store, self._exposure = Store(folder, frames), exposure
        self._parts = Parts(self._store, folder / "transforms.json", range(frames))

    def has(self, frame: int) -> bool:
        """Tell whether a frame is complete."""
        return self._parts.has(frame)

    def write(self, frame: int, data: FrameData, record: Record) -> None:
        """Write the pictures of a frame and keep its camera.

        Raises GiError if the file system refuses, and for an orthographic camera.
        """
        path = f"{self._store.path(frame)}.png"
        part: dict[str, Any] = {"file_path": f"images/{path}"}
        self._store.write_bytes(self._store.folder / part["file_path"], png(data, self._exposure))
        if data.depth_z is not None:
            part |= {"depth_file_path": f"depth/{path}", "depth_path": f"depth/{path}"}
            self._store.write_bytes(self._store.folder / part["depth_path"], depth_png(data.depth_z))
        part |= lens(data)
        part["transform_matrix"] = Z_UP_FROM_Y_UP @ data.cameras["opengl_world_from_view"]
        part["record"] = record
        self._parts.add(frame, json_text(part).encode())

    def finish(self) -> int:
        """Write `transforms.json` if all frames are there; return how many are missing."""
        missing = self._parts.join(_join)
        if not missing:
            self._store.clean()
        return missing


def lens(data: FrameData) -> dict[str, float]:
    """Return size, focal lengths, principal point and angles of a frame. Raises GiError for an orthographic camera."""
    if "opencv_pixel_from_camera" not in data.cameras:
        raise GiError("the writer nerf needs perspective cameras; an orthographic one has no focal length")
    (fl_x, _, cx), (_, fl_y, cy), _ = data.cameras["opencv_pixel_from_camera"].tolist()
    w, h = data.size
    angles = 2 * math.atan(w / 2 / fl_x), 2 * math.atan(h / 2 / fl_y)
    return dict(zip(LENS, (w, h, fl_x, fl_y, cx, cy, *angles), strict=True))


def depth_png(depth_z: NDArray[np.float32]) -> bytes:
    """Return depth in metres as a PNG of 16 bits, in millimetres; 0 for what is farther than LARGEST_DEPTH."""
    from PIL import Image

    steps = np.round(np.where(depth_z <= LARGEST_DEPTH, depth_z, 0.0) / DEPTH_STEP).astype(np.uint16)
    buffer = BytesIO()
    Image.fromarray(steps).save(buffer, format="PNG", compress_level=1)  # as for pictures: a third of the time
    return buffer.getvalue()


def _join(file: BinaryIO, read: Read) -> None:
    """Write the file of all frames; what the cameras have in common stands before them."""
    first = json.loads(next(read()))
    shared = all(json.loads(part)[key] == first[key] for part in read() for key in LENS)
    head: dict[str, Any] = {"camera_model": "OPENCV", "applied_transform": Z_UP_FROM_Y_UP[:3]}
    if shared:
        head |= {key: first[key] for key in LENS}
    if "depth_path" in first:
        head["integer_depth_scale"] = DEPTH_STEP
    file.write(json_text(head)[:-1].encode() + b',"frames":[')
    for number, part in enumerate(read()):
        each = {key: value for key, value in json.loads(part).items() if not shared or key not in LENS}
        file.write((b",\n" if number else b"\n") + json_text(each).encode())
    file.write(b"]}\n")
