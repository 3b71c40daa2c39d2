"""Writes .tar files as the library `webdataset` reads them.

`shard-000000.tar`, `shard-000001.tar` ... hold `frames_per_shard` consecutive frames each. A sample has these fields:

    __key__         the number of the frame, such as 000123
    frame.json      what is not an array (`sample`)
    picture.png     the picture: 8-bit sRGB, with exposure and tone curve
    picture.npy, depth_z.npy, instance.npy ...   arrays, by the names and types of `frame_data.FrameData`

    webdataset.WebDataset("data/webdataset/shard-{000000..000001}.tar").decode("rgb8")

Source: T. Breuel, the WebDataset format: POSIX tar; files of a sample share the name up to the first dot and follow
one another. The bytes are determined: samples in order, files sorted by name, no times and no owners.
"""

from __future__ import annotations

import tarfile
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

import numpy as np

from ..frame_data import FrameData
from .sample import Record, frame_json, json_text, png
from .store import Parts, Read, Store


class WebdatasetWriter:
    """Shards of `frames_per_shard` frames."""

    def __init__(self, folder: Path, frames: int, exposure: float | None, frames_per_shard: int) -> None:
        self._store, self._exposure, self._per_shard = Store(folder, frames), exposure, frames_per_shard
        starts = range(0, frames, frames_per_shard)
        self._shards = [
            Parts(self._store, folder / f"shard-{i:06d}.tar", range(start, min(start + frames_per_shard, frames)))
            for i, start in enumerate(starts)
        ]

    def has(self, frame: int) -> bool:
        """Tell whether a frame is complete."""
        return self._shards[frame // self._per_shard].has(frame)

    def write(self, frame: int, data: FrameData, record: Record) -> None:
        """Write a frame, and its shard if that is then complete. Raises GiError if the file system refuses."""
        files = {f"{name}.npy": _npy(array) for name, array in data.arrays().items()}
        if data.picture is not None:
            files["picture.png"] = png(data, self._exposure)
        files["frame.json"] = json_text(frame_json(frame, data, record, self._exposure)).encode()
        shard = self._shards[frame // self._per_shard]
        shard.add(frame, members(self._store.name(frame), files))
        shard.join(_join)

    def finish(self) -> int:
        """Write the shards whose frames are all there; return how many frames are missing."""
        missing = sum(shard.join(_join) for shard in self._shards)
        if not missing:
            self._store.clean()
        return missing


def members(key: str, files: dict[str, bytes]) -> bytes:
    """Return the entries of a .tar for a sample, without the zeros that end an archive."""
    buffer = BytesIO()
    with tarfile.open(fileobj=buffer, mode="w", format=tarfile.USTAR_FORMAT) as archive:
        for name, content in sorted(files.items()):
            entry = tarfile.TarInfo(f"{key}.{name}")  # no time, no owner, mode 644
            entry.size = len(content)
            archive.addfile(entry, BytesIO(content))
        end = archive.offset
    return buffer.getvalue()[:end]


def _join(file: BinaryIO, read: Read) -> None:
    for part in read():
        file.write(part)
    # Two blocks of zeros end an archive; its size is a multiple of a record.
    end = file.tell() + 2 * tarfile.BLOCKSIZE
    file.write(bytes(-(-end // tarfile.RECORDSIZE) * tarfile.RECORDSIZE - file.tell()))


def _npy(array: np.ndarray) -> bytes:
    buffer = BytesIO()
    np.save(buffer, array, allow_pickle=False)
    return buffer.getvalue()
