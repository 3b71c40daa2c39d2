"""Writes files for each frame into a plain folder.

    000123.json  what is not an array (`sample`), written last: with it, the frame is complete
    000123.png   the picture: 8-bit sRGB, with exposure and tone curve
    000123.npz   all arrays, by the names and types of `frame_data.FrameData`
    000123.exr   the same arrays as layers of float32, the picture as R, G, B; flow as the layers flow_x and flow_y

The option `files` names those to write beside the .json: "png", "npz", "exr". With more than 10,000 frames, each
thousand has a folder of its own: 000/000123.png.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...pictures.writers import WRITERS
from ..frame_data import FrameData
from .sample import Record, frame_json, json_text, png
from .store import Store

FILES = ("png", "npz", "exr")


class FolderWriter:
    """Files for each frame. `files` are extensions out of FILES."""

    def __init__(self, folder: Path, frames: int, exposure: float | None, files: list[str]) -> None:
        self._store, self._exposure, self._files = Store(folder, frames), exposure, files

    def _path(self, frame: int, extension: str) -> Path:
        return self._store.folder / f"{self._store.path(frame)}.{extension}"

    def has(self, frame: int) -> bool:
        """Tell whether a frame is complete."""
        return self._path(frame, "json").is_file()

    def write(self, frame: int, data: FrameData, record: Record) -> None:
        """Write the files of a frame. Raises GiError if the file system refuses."""
        if "png" in self._files and data.picture is not None:
            self._store.write_bytes(self._path(frame, "png"), png(data, self._exposure))
        arrays = data.arrays()
        if "npz" in self._files and arrays:
            self._store.write(self._path(frame, "npz"), lambda path: WRITERS[".npz"](path, arrays, None, {}))
        if "exr" in self._files and arrays:
            layers = _float_layers(data)
            self._store.write(self._path(frame, "exr"), lambda path: WRITERS[".exr"](path, layers, None, {}))
        text = json_text(frame_json(frame, data, record, self._exposure), indent=1)
        self._store.write_bytes(self._path(frame, "json"), text.encode())

    def finish(self) -> int:
        """Return how many frames are missing; if none is, remove what interrupted processes left."""
        missing = sum(not self.has(frame) for frame in range(self._store.frames))
        if not missing:
            self._store.clean()
        return missing


def _float_layers(data: FrameData) -> dict[str, np.ndarray]:
    """Return the arrays as float32 layers of one or three channels."""
    arrays = data.arrays()
    flow = arrays.pop("flow", None)
    if flow is not None:
        arrays |= {"flow_x": flow[..., 0], "flow_y": flow[..., 1]}
    return {name: array.astype(np.float32, copy=False) for name, array in arrays.items()}
