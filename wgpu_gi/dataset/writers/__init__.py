"""Writers store the frames of a data set in formats that other programs read: a module each.

`make_writers` makes them from a configuration. Each writes into a folder of its own, OUTPUT/NAME. Frames may come in
any order, from any number of processes and machines, and again after any interruption; the bytes of the finished files
are the same (`store`).
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Any, Protocol

from ...errors import GiError, near_names
from ..frame_data import FrameData
from .coco import CocoWriter
from .folder import FILES, FolderWriter
from .nerf import NerfWriter
from .sample import Record
from .webdataset import WebdatasetWriter


class Writer(Protocol):
    """Stores the frames 0, 1, ... of a data set. All methods raise GiError if the file system refuses."""

    def has(self, frame: int) -> bool:
        """Tell whether a frame is complete."""

    def write(self, frame: int, data: FrameData, record: Record) -> None:
        """Write a frame; `record` holds the values that were drawn for it, as JSON can hold them."""

    def finish(self) -> int:
        """Write the files of all frames, if all are there; return how many are missing. May be called again."""


# The options of each writer, with their defaults.
OPTIONS: dict[str, dict[str, Any]] = {
    "folder": {"files": ["png", "npz"]},
    "webdataset": {"frames_per_shard": 100},
    "coco": {},
    "nerf": {},
}
REQUIRED = {"coco": {"picture", "instance", "amodal"}, "nerf": {"picture"}}


def required(writers: Iterable[str]) -> set[str]:
    """Return the names of the data that these writers need."""
    return {name for writer in writers for name in REQUIRED.get(writer, ())}


def make_writers(
    output: Path,
    writers: dict[str, dict[str, Any]],
    frames: int,
    wanted: Collection[str],
    categories: dict[int, str],
    exposure: float | None,
) -> list[Writer]:
    """Return writers by name, with their options, for a data set of `frames` frames; none touches a file yet.

    `wanted` names the data that each frame has, `categories` names by id, from 1; `exposure` is the EV of pictures in
    8 bits, None automatic for each frame. Raises GiError for unknown writers and options, wrong values, missing data.
    """
    made: list[Writer] = []
    for name, options in writers.items():
        if name not in OPTIONS:
            raise GiError(f"unknown writer {name!r}; {near_names(name, OPTIONS)}")
        missing = sorted(required([name]) - set(wanted))
        if missing:
            raise GiError(f"the writer {name} needs the data {', '.join(missing)}")
        chosen = {**OPTIONS[name], **_checked(name, options)}
        folder = output / name
        if name == "folder":
            made.append(FolderWriter(folder, frames, exposure, chosen["files"]))
        elif name == "webdataset":
            made.append(WebdatasetWriter(folder, frames, exposure, chosen["frames_per_shard"]))
        elif name == "coco":
            made.append(CocoWriter(folder, frames, exposure, categories))
        else:
            made.append(NerfWriter(folder, frames, exposure))
    return made


def _checked(name: str, options: dict[str, Any]) -> dict[str, Any]:
    """Return the options of a writer. Raises GiError for an unknown one or a wrong value."""
    for key, value in options.items():
        if key not in OPTIONS[name]:
            known = near_names(key, OPTIONS[name]) if OPTIONS[name] else "it has none"
            raise GiError(f"the writer {name} has no option {key!r}; {known}")
        if key == "files" and not (isinstance(value, list) and value and all(each in FILES for each in value)):
            raise GiError(f"the writer {name}: files must be a list of {', '.join(FILES)}, not {value!r}")
        if key == "frames_per_shard" and not (type(value) is int and value >= 1):
            raise GiError(f"the writer {name}: frames_per_shard must be a whole number from 1, not {value!r}")
    return options
