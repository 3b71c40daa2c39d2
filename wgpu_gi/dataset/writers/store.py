"""The files of a writer: each is complete or absent, whoever else writes into the same folder, whenever it is killed.

A writer owns a folder. What is unfinished lies in its folder `.work`: files that are being written, and parts, one for
each frame, which wait until all frames of a final file are there (a .tar, or a .json of all frames). Whoever finds the
parts complete joins them in the order of the frames. So the bytes of a final file depend neither on the order in which
the frames came, nor on who rendered them, nor on interruptions; two processes that join at once write the same bytes.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

from ...errors import GiError
from ...pictures.atomic_file import atomic_file

MOST_IN_A_FOLDER = 10_000  # files of one kind; with more frames, each thousand has a folder of its own
Read = Callable[[], Iterator[bytes]]  # returns the parts in the order of the frames, as often as it is called


class Store:
    """The folder of a writer of `frames` frames."""

    def __init__(self, folder: Path, frames: int) -> None:
        self.folder, self.frames = folder, frames
        self.work = folder / ".work"
        self._digits = max(6, len(str(frames - 1)))

    def name(self, frame: int) -> str:
        """Return the name of a frame: its number with at least six digits, such as 000123."""
        return f"{frame:0{self._digits}d}"

    def path(self, frame: int) -> str:
        """Return where files of a frame lie in a folder of them, without extension: 000123, or 000/000123."""
        name = self.name(frame)
        return name if self.frames <= MOST_IN_A_FOLDER else f"{name[:-3]}/{name}"

    def write(self, path: Path, write: Callable[[Path], None]) -> None:
        """Let `write` fill a file, then give it its name. Raises GiError if the file system refuses."""
        try:
            self._write(path, write)
        except GiError:
            # Another process has written the same bytes, and `clean` has taken the temporary file.
            if not path.is_file():
                raise

    def _write(self, path: Path, write: Callable[[Path], None]) -> None:
        try:
            self.work.mkdir(parents=True, exist_ok=True)
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise GiError(f"{path}: its folder cannot be made ({error.strerror or error})") from None
        with atomic_file(path, self.work) as temporary:
            write(temporary)
            # To the disk before the name: a power failure must not leave an empty file that counts as finished.
            with temporary.open("rb+") as file:
                os.fsync(file.fileno())

    def write_bytes(self, path: Path, content: bytes) -> None:
        """Write a file. Raises GiError if the file system refuses."""
        self.write(path, lambda temporary: _fill(temporary, content))

    def clean(self) -> None:
        """Remove what processes that were killed left behind, once all final files are there."""
        shutil.rmtree(self.work, ignore_errors=True)


class Parts:
    """The parts of the frames `frames`, which become the file `final`."""

    def __init__(self, store: Store, final: Path, frames: range) -> None:
        self._store, self.final, self.frames = store, final, frames
        self._folder = store.work / final.name

    def _path(self, frame: int) -> Path:
        return self._folder / self._store.path(frame)

    def has(self, frame: int) -> bool:
        """Tell whether a frame is there, as a part or in the final file."""
        # In this order: a part goes only after the final file has come.
        return self._path(frame).is_file() or self.final.is_file()

    def add(self, frame: int, content: bytes) -> None:
        """Write the part of a frame, unless it is there. Raises GiError if the file system refuses."""
        try:
            if not self.has(frame):
                self._store.write_bytes(self._path(frame), content)
        except GiError:
            # Another process has written and joined it.
            if not self.has(frame):
                raise

    def missing(self) -> int:
        """Return how many frames are not there."""
        folders = {self._path(frame).parent for frame in (*self.frames[::1000], self.frames[-1])}
        known = {self._store.name(frame) for frame in self.frames}
        there = sum(len(known.intersection(_names(folder))) for folder in folders)
        return 0 if self.final.is_file() else len(self.frames) - there

    def join(self, write: Callable[[BinaryIO, Read], None]) -> int:
        """Let `write` make the final file of all parts, then remove them; return how many are missing, 0 if none.

        Does nothing but tidy up if the final file is there. Raises GiError if the file system refuses.
        """
        missing = self.missing()
        if missing:
            return missing
        if not self.final.is_file():
            try:
                self._store.write(self.final, lambda temporary: self._fill(temporary, write))
            except GiError:
                # Another process has joined them, and removed them while this one read.
                if not self.final.is_file():
                    raise
        shutil.rmtree(self._folder, ignore_errors=True)
        return 0

    def _fill(self, temporary: Path, write: Callable[[BinaryIO, Read], None]) -> None:
        def read() -> Iterator[bytes]:
            return (self._path(frame).read_bytes() for frame in self.frames)

        with temporary.open("wb") as file:
            write(file, read)


def _fill(path: Path, content: bytes) -> None:
    path.write_bytes(content)


def _names(folder: Path) -> list[str]:
    with suppress(FileNotFoundError, NotADirectoryError):
        return os.listdir(folder)
    return []
